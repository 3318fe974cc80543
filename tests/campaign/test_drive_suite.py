"""The suite of random drives: frozen, scored from rows whose answer is known, and its entries in results/suite-v2."""

import dataclasses
import os
import re
import shutil
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from commands import verb
from jerkbench import plugins
from jerkbench.campaign import protocol as protocols
from jerkbench.campaign.board import frozen_mistakes, missing_mistakes, score_mistakes
from jerkbench.campaign.entry import (
    ENTRY_FILE,
    HASHED,
    drives_by_faults,
    entry_page,
    plugins_digest,
    ratios,
    read_entry,
    score_of,
)
from jerkbench.campaign.protocol import FROZEN, FROZEN_DRIVES, data_digest, read_suite, require_recordings
from jerkbench.campaign.stored_files import changed_files
from jerkbench.errors import PluginError, RecordingError
from jerkbench.presets import preset

DIGESTS = {"v2": "a81d3228b547", "v2-tiny": "172079cf7a5a"}
TINY = read_suite("v2-tiny")
DRAWN = plugins.create("dataset", preset("dataset", "mixture"))


@pytest.mark.parametrize("scale", DIGESTS)
def test_the_protocols_are_those_that_were_frozen(scale):
    protocol = read_suite(scale)
    assert protocol.digest == FROZEN[scale]["protocol"] == DIGESTS[scale]
    assert not set(protocol.seeds_to_tune_on) & set(protocol.seeds_to_test_on)


@pytest.mark.parametrize("scale", ["v2-tiny", pytest.param("v2", marks=pytest.mark.slow)])
def test_the_simulated_drives_are_those_that_were_frozen(scale):
    assert data_digest(read_suite(scale)) == FROZEN[scale]["data"]


def test_every_kind_of_fault_is_among_the_frozen_drives_and_other_drives_are_refused():
    protocol = read_suite("v2")
    seeds = protocol.seeds_to_test_on[:FROZEN_DRIVES]
    kinds = {kind for seed in seeds for kind in DRAWN.drawn(seed)[2]}
    assert kinds == {kind for kind, *_ in preset("dataset", "mixture")["faults"]}
    laws = {**TINY.dataset, "drive": [*TINY.dataset["drive"][1:], "roughness ~ always 2"]}
    with pytest.raises(RecordingError, match="The recordings differ from the frozen recordings of jerkbench-v2-tiny: "):
        require_recordings("v2-tiny", dataclasses.replace(TINY, dataset=laws))


@pytest.mark.parametrize(("kind", "change"), [("suite", {"trials": 33}), ("dataset", {"bases": ["field"]})])
def test_a_changed_protocol_or_law_is_refused(monkeypatch, kind, change):
    monkeypatch.setattr(
        protocols, "preset", lambda group, name: preset(group, name) | (change if group == kind else {})
    )
    with pytest.raises(
        PluginError, match=r"v2.yaml, with conf/dataset/mixture.yaml, differs from the frozen protocol of jerkbench-v2"
    ):
        read_suite("v2")


def rows(factors, lost=()):
    """Errors of each setting over the tuned plain filter's, on drives whose common error differs a thousandfold."""
    made = []
    for k, seed in enumerate(TINY.seeds_to_test_on):
        for (method, tuned_on), factor in factors.items():
            away = (method, tuned_on, k) in lost
            error = np.nan if away else 10.0 ** (k / 4 - 2) * (factor[k] if isinstance(factor, list) else factor)
            head = {"method": method, "tuned_on": tuned_on, "scenario": 0, "seed": seed}
            tail = {"status": "diverged" if away else "ok", "reason": "", "anees": 6.0, "seconds": 0.015}
            made.append({**head, **tail, "position_rmse_m": error})
    return pd.DataFrame(made)


FACTORS = {("plain", "given"): 2.0, ("plain", "drives"): 1.0, ("entry", "given"): 3.0, ("entry", "drives"): 0.5}


def test_the_ratio_is_that_of_the_tuned_settings_at_the_level_of_many_entries():
    rng = np.random.default_rng(4)
    factor = np.exp(rng.normal(-0.4, 0.3, 12)).tolist()
    score = score_of(rows({**FACTORS, ("entry", "drives"): factor}), TINY)
    d = np.log(factor)
    student = stats.t.interval(1 - 0.05 / 20, 11, d.mean(), stats.sem(d))
    assert (score["n"], score["lost"], score["anees"]) == (12, 0.0, 6.0)
    assert score["ratio"] == pytest.approx(np.exp(d.mean()), rel=1e-12)
    assert score["low"] <= np.exp(student[0]) * (1 + 1e-12)
    assert score["high"] >= np.exp(student[1]) * (1 - 1e-12)
    assert score["given"] == pytest.approx(3.0, rel=1e-12)
    assert score["worse"] == np.mean(d > np.log(1.03))
    assert score["step_ns"] == pytest.approx(1000.0)
    d = ratios(rows(FACTORS, lost={("entry", "drives", 7)}))
    np.testing.assert_allclose(np.exp(d), [0.5] * 7 + [200.0] + [0.5] * 4)
    untuned = {key: own for key, own in FACTORS.items() if key != ("entry", "drives")}
    made = rows(untuned)
    assert score_of(made, TINY)["ratio"] == pytest.approx(3.0)
    assert "not tuned." in entry_page("mine", made, TINY)
    assert "tuned, 4 settings." in entry_page("mine", rows(FACTORS), TINY)


def test_kinds_of_faults_are_those_that_the_drives_drew():
    known = drives_by_faults(TINY)
    for k, seed in enumerate(TINY.seeds_to_test_on):
        kinds = DRAWN.drawn(seed)[2]
        assert {name for name, of in known.items() if of[k] and " " not in name} == set(kinds)
    assert sum(of.sum() for name, of in known.items() if " fault" in name) == 12
    worst = max((name for name in known if " " not in name), key=lambda name: known[name].mean())
    factor = [2.0 if member else 0.5 for member in known[worst]]
    score = score_of(rows({**FACTORS, ("entry", "drives"): factor}), TINY)
    assert score["worst_ratio"] == pytest.approx(2.0)
    assert score["nominal"] == pytest.approx(np.exp(np.log(factor)[known["0 faults"]].mean()))


@pytest.mark.parametrize(("factor", "word"), [(0.5, "better"), (0.95, "better, by less than 10 %"), (1.3, "worse")])
def test_the_verdict_is_that_of_the_interval(factor, word):
    near = [factor * (1 + 0.001 * sign) for sign, _ in product((1, -1), range(6))]
    assert score_of(rows({**FACTORS, ("entry", "drives"): near}), TINY)["verdict"] == word


# Our own entries.

FOLDER = Path(__file__).parents[2] / "results" / "suite-v2"
ENTRIES = sorted(path.parent for path in FOLDER.glob(f"*/{ENTRY_FILE}"))


@pytest.mark.parametrize("folder", ENTRIES, ids=lambda folder: folder.name)
def test_a_committed_entry_is_whole_and_its_score_is_that_of_its_rows(folder):
    entry, protocol = read_entry(folder), read_suite("v2")
    assert [
        *frozen_mistakes(entry, protocol),
        *changed_files(folder, entry.manifest["files"], HASHED),
        *missing_mistakes(entry, protocol),
    ] == []
    assert list(score_mistakes(entry, protocol)) == []
    assert entry.manifest["tuned"] or entry.program
    assert not any(Path(word).is_absolute() for word in entry.program.split())
    assert not entry.manifest["git_commit"].endswith("+changes")


def test_rows_of_a_committed_entry_come_out_again_and_a_doctored_one_does_not(tmp_path):
    copy = tmp_path / "jerk-none"
    shutil.copytree(FOLDER / "jerk-none", copy)
    honest = verb("suite", "verify", str(copy), "--rows", "3", cwd=tmp_path)
    (copy / "entry.md").write_text((copy / "entry.md").read_text().replace("0.8", "0.4"))
    doctored = verb("suite", "verify", str(copy), "--rows", "0", cwd=tmp_path)

    assert honest.returncode == 0, honest.stdout
    assert "2 rows of the entry were computed again" in honest.stdout
    assert doctored.returncode == 1
    assert "entry.md was changed after it was made" in doctored.stdout


def test_the_board_shows_every_entry_with_its_score():
    protocol, board = read_suite("v2"), (FOLDER / "board.md").read_text(encoding="utf-8")
    line = r"^\| \d+ \(\d+ to \d+\) \| (.*?) \| 240 \| ([\d.]+) \[([\d.]+), ([\d.]+)\] \| (.*?) \|"
    shown = {name: rest for name, *rest in re.findall(line, board, flags=re.MULTILINE)}
    scores = {(entry := read_entry(folder)).name: score_of(entry.rows, protocol) for folder in ENTRIES}
    wanted = {
        name: [*(f"{value:.3f}" for value in (score["ratio"], score["low"], score["high"])), score["verdict"]]
        for name, score in scores.items()
    }
    assert shown == wanted
    programs = [folder for folder in ENTRIES if read_entry(folder).program]
    assert board.count("| no | its files only |") == len(programs)
    assert board.count("| yes | yes, 2 rows |") == len(ENTRIES) - len(programs) >= 8


PACKAGES = {"pyins_filter.py": "pyins", "gtsam_isam2.py": "gtsam", "vqf_attitude.py": "vqf", "ahrs_attitude.py": "ahrs"}
"""The package that an adapter in examples/any_language imports."""


@pytest.mark.slow
@pytest.mark.parametrize("folder", [folder for folder in ENTRIES if read_entry(folder).program], ids=lambda f: f.name)
def test_the_rows_of_a_program_come_out_again(folder, monkeypatch):
    entry, root = read_entry(folder), FOLDER.parents[1]
    for script, package in PACKAGES.items():
        if script in entry.program:
            pytest.importorskip(package)
    monkeypatch.chdir(root)
    monkeypatch.setenv("PATH", str(Path(sys.executable).parent), prepend=os.pathsep)
    try:
        digest = plugins_digest(entry.method, read_suite("v2"))
    except RecordingError as error:
        pytest.skip(str(error))
    if digest != entry.manifest["plugins"]:
        pytest.skip("the program or its adapter is not the one of the entry")
    done = verb("suite", "verify", str(folder), "--rows", "3", "--run-programs", cwd=root)
    assert done.returncode == 0, done.stdout
    assert "2 rows of the entry were computed again" in done.stdout
