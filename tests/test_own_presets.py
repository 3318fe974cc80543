"""Presets in a folder of one's own, given by --config-dir, with every verb that takes a name."""

import pytest

from commands import SHORT, verb

DRIVE = """\
# A short drive of my own.
defaults:
  - field
  - _self_

duration_s: 14
"""
NOISE = "# A noise of my own.\naccel_mps2: 0.7\n"
QUICK = ["seeds=1", "figures=false", "workers=1"]


@pytest.fixture
def own(tmp_path):
    for kind, name, text in (("dataset", "mine", DRIVE), ("noise", "loud", NOISE)):
        folder = tmp_path / f"of {kind}" / kind
        folder.mkdir(parents=True)
        (folder / f"{name}.yaml").write_text(text)
    return ["--config-dir", "of dataset", "--config-dir=of noise"]


def said(tmp_path, *words):
    done = verb(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_preset_of_ones_own_is_listed_shown_and_inspected(tmp_path, own):
    assert "A short drive of my own." in said(tmp_path, "list", "dataset", *own)
    assert "A noise of my own." in said(tmp_path, *own, "list", "noise")
    assert "duration_s: 14" in said(tmp_path, "show", "dataset", "mine", *own)
    assert "14.00 s" in said(tmp_path, "data", "inspect", "mine", *own)
    said(tmp_path, "data", "convert", "mine", "mine.csv", *own)


def test_a_preset_of_ones_own_runs_alone_and_in_a_sweep(tmp_path, own):
    words = ["dataset=mine", "noise=loud", *QUICK]
    alone = said(tmp_path, "run", *own, *words)
    swept = said(tmp_path, "run", "-m", "filter=gnss_only,jerk", *words, *own)

    assert "mine" in alone
    assert "mine" in swept


def test_a_preset_of_ones_own_is_exported_scored_and_tuned(tmp_path, own):
    words = ["dataset=mine", "noise=loud"]
    said(tmp_path, "data", "export", "out", *words, "seeds=1", *own)
    said(tmp_path, "data", "convert", "mine", "mine.tum", *own)
    said(tmp_path, "score", "mine.tum", *own, *words, "study=scored")
    tuned = said(
        tmp_path, "tune", "filter=jerk", *own, "dataset=mine", *QUICK[1:], "trials=2", "finalists=1",
        "tune_seeds=1", "choose_seeds=1", "test_seeds=2", "study=tuned",
    )  # fmt: skip
    command = next(line for line in tuned.splitlines() if line.startswith("Take it with: jerkbench "))

    assert command.count("--config-dir") == 3


def test_files_of_one_name_that_are_no_presets_are_not_compared(tmp_path, own):
    for folder in ("of dataset", "of noise"):
        (tmp_path / folder / "notes").mkdir()
        (tmp_path / folder / "notes" / "mine.yaml").write_text(f"# what {folder} is for\n")

    assert "A noise of my own." in said(tmp_path, "list", "noise", *own)


def test_a_preset_is_forgotten_by_the_next_command(tmp_path, own):
    said(tmp_path, "list", "dataset", *own)

    assert "no dataset 'mine'" in verb("run", "dataset=mine", *SHORT[1:], cwd=tmp_path).stderr


@pytest.mark.parametrize("words", [["--config-dir", "nowhere"], ["--config-dir"]])
def test_a_folder_that_is_not_there_is_a_sentence(tmp_path, words):
    done = verb("list", *words, cwd=tmp_path)

    assert done.returncode == 2
    assert "--config-dir names one with presets" in done.stderr
