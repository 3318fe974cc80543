"""Entries of the suite: what a run writes, what a check finds, on this and on another processor."""

import hashlib
import json
import platform
import shutil
import sys

import pandas as pd
import pytest
import yaml

import pages
from commands import jerkbench, standing_program, verb
from jerkbench.campaign.entry import HASHED, entry_page, score_of
from jerkbench.campaign.protocol import read_suite
from jerkbench.compilation.compiled import COMPILED
from jerkbench.files import cache_folder
from jerkbench.jobs.study import SAME_WITHIN

TINY = ["--scale", "v2-tiny", "--workers", "1"]
ALL = ["--rows", "500"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder in which a method was entered, what was said, and its entry."""
    folder = tmp_path_factory.mktemp("suite")
    done = verb("suite", "run", "filter=baseline", "adaptation=chi2", *TINY, cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout, folder / "results/suite-v2-tiny/baseline-chi2"


@pytest.fixture
def doctored(made, tmp_path):
    """A copy of the entry, and what makes its hashes, its score and its page those of its rows again."""
    copy = tmp_path / "entry"
    shutil.copytree(made[2], copy, ignore=shutil.ignore_patterns("runs"))
    return copy


def smoothed(entry, **changed):
    """What somebody does who knows how entries are checked."""
    protocol, rows = read_suite("v2-tiny"), pd.read_parquet(entry / "rows.parquet")
    manifest = json.loads((entry / "manifest.json").read_text()) | changed
    if rows["seed"].nunique() == protocol.test_seeds:
        manifest["score"] = score_of(rows, protocol)
        (entry / "entry.md").write_text(entry_page(manifest["entry"], rows, protocol))
    manifest["files"] = {name: hashlib.sha256((entry / name).read_bytes()).hexdigest() for name in HASHED}
    (entry / "manifest.json").write_text(json.dumps(manifest))


def test_an_entry_has_a_line_a_table_and_both_settings_and_is_what_it_says(made):
    _, out, entry = made
    settings = yaml.safe_load((entry / "settings.yaml").read_text())
    assert out.startswith("baseline + chi2 on jerkbench-v2-tiny (n = 12 drives): ")
    assert "tuned, 4 settings." in out
    assert set(settings["entry"]) == set(settings["plain"]) == {"given", "drives"}
    assert "adaptation.longest" in settings["entry"]["drives"]
    rows = pd.read_parquet(entry / "rows.parquet")
    assert len(rows) == 2 * 12 * 2  # both methods, as given and tuned
    done = verb("suite", "verify", str(made[2]), cwd=made[0])
    assert done.returncode == 0, done.stdout
    assert "8 rows of the entry were computed again" in done.stdout


@pytest.mark.slow
def test_a_cluster_makes_the_same_entry(made, tmp_path):
    pytest.importorskip("distributed")
    shutil.copytree(cache_folder(COMPILED), tmp_path / "cache" / COMPILED)  # its own simulations, our machine code
    words = ["filter=baseline", "adaptation=chi2", "--scale", "v2-tiny", "--workers", "2", "--cluster", "dask"]
    done = jerkbench("suite", "run", *words, cwd=tmp_path, JERKBENCH_CACHE=str(tmp_path / "cache"))

    assert done.returncode == 0, done.stderr
    own, here = (folder / "results/suite-v2-tiny/baseline-chi2" for folder in (tmp_path, made[0]))
    rows = [pd.read_parquet(folder / "rows.parquet").drop(columns="seconds") for folder in (own, here)]
    pd.testing.assert_frame_equal(*rows, rtol=1e-12)
    assert (own / "settings.yaml").read_bytes() == (here / "settings.yaml").read_bytes()


def test_a_changed_error_is_found_by_computing_it_again(made, doctored):
    rows = pd.read_parquet(doctored / "rows.parquet")
    best = (rows["method"] == "entry") & (rows["tuned_on"] == "drives")
    rows.loc[best, "position_rmse_m"] *= 0.99
    rows.to_parquet(doctored / "rows.parquet", index=False)

    plain = verb("suite", "verify", str(doctored), "--rows", "0", cwd=made[0])
    smoothed(doctored)
    hidden = verb("suite", "verify", str(doctored), *ALL, cwd=made[0])

    assert plain.returncode == hidden.returncode == 1
    assert "rows.parquet was changed after it was made" in plain.stdout
    assert "The manifest says ratio =" in plain.stdout
    assert hidden.stdout.count("the stored position_rmse_m is") == 12


def test_a_drive_that_was_left_out_is_found(made, doctored):
    rows = pd.read_parquet(doctored / "rows.parquet")
    rows[rows["seed"] != rows["seed"].max()].to_parquet(doctored / "rows.parquet", index=False)
    smoothed(doctored)

    done = verb("suite", "verify", str(doctored), cwd=made[0])

    assert done.returncode == 1
    assert "The rows of the entry are not the rows of jerkbench-v2-tiny: 2" in done.stdout


def test_another_protocol_is_found(made, doctored):
    smoothed(doctored, protocol="0123456789ab")

    done = verb("suite", "verify", str(doctored), "--rows", "0", cwd=made[0])

    assert (done.returncode, done.stdout.count("\n")) == (1, 1)
    assert "The protocol in the manifest is 0123456789ab, but jerkbench-v2-tiny has " in done.stdout


def test_another_setting_is_found(made, doctored):
    settings = yaml.safe_load((doctored / "settings.yaml").read_text())
    settings["entry"]["drives"]["r_scale.position"] *= 1.01
    (doctored / "settings.yaml").write_text(yaml.safe_dump(settings, sort_keys=False))
    smoothed(doctored)

    done = verb("suite", "verify", str(doctored), "--rows", "0", cwd=made[0])

    assert done.returncode == 1
    assert (
        "The setting of the entry (drives) is not among the settings that the search of jerkbench-v2-tiny tries"
        in done.stdout
    )


@pytest.mark.slow
def test_a_program_is_scored_as_it_is_and_checked_where_it_is(made):
    folder = made[0]
    program = standing_program(folder / "stands")
    command = f"filter.command='{program} {{recording}} {{out}}'"

    done = verb("suite", "run", "filter=command", command, "--name", "stands", *TINY, cwd=folder)
    there = verb("suite", "verify", "results/suite-v2-tiny/stands", "--rows", "3", "--run-programs", cwd=folder)
    unasked = verb("suite", "verify", "results/suite-v2-tiny/stands", "--rows", "3", cwd=folder)
    program.unlink()
    gone = verb("suite", "verify", "results/suite-v2-tiny/stands", "--rows", "3", "--run-programs", cwd=folder)

    assert "not tuned." in done.stdout, done.stderr
    assert unasked.returncode == 2
    assert "give --run-programs if you trust the program" in unasked.stderr
    assert there.returncode == gone.returncode == 0
    assert "2 rows of the entry" in there.stdout
    assert "The rows of command + none cannot be computed here, and are not checked: The program" in gone.stdout


@pytest.mark.slow
def test_a_plugin_made_by_new_gets_its_entry_by_two_commands(made, tmp_path):
    assert verb("new", "adaptation", "mine", cwd=tmp_path).returncode == 0
    pages.install(tmp_path / "mine")

    done = jerkbench("suite", "run", "adaptation=mine", *TINY, cwd=tmp_path, PYTHONPATH=str(tmp_path / "mine"))

    assert done.returncode == 0, done.stderr
    assert (tmp_path / "results/suite-v2-tiny/baseline-mine/manifest.json").is_file()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["dataset=field"], "does not accept 'dataset=field'"),
        (["filter=jerrk"], "Did you mean 'jerk'"),
        (["filter=jerk", "--scale", "v9"], "There is no suite 'v9'"),
    ],
)
def test_what_cannot_enter_is_refused_in_a_sentence(tmp_path, words, sentence):
    done = verb("suite", "run", *words, cwd=tmp_path)

    assert done.returncode == 2
    assert sentence in done.stderr


def test_what_is_no_entry_is_refused_in_a_sentence(tmp_path):
    done = verb("suite", "verify", str(tmp_path), cwd=tmp_path)

    assert done.returncode == 2
    assert "manifest.json cannot be read: the file does not exist" in done.stderr


def test_the_board_shows_every_entry_and_escapes_what_it_says_of_itself(made, tmp_path):
    for name in ("honest", "other"):
        shutil.copytree(made[2], tmp_path / name, ignore=shutil.ignore_patterns("runs"))
    manifest = json.loads((tmp_path / "other/manifest.json").read_text())
    (tmp_path / "other/manifest.json").write_text(json.dumps(manifest | {"entry": "<img src=x onerror=alert(1)>|"}))

    done = verb("suite", "board", str(tmp_path), "--rows", "0", cwd=tmp_path)

    text = (tmp_path / "board.md").read_text()
    assert done.returncode == 0, done.stderr
    assert "<img" not in text
    assert "baseline + chi2" in text
    assert "&lt;img src=x onerror=alert(1)&gt;&#124; |" in text
    assert "1 (1 to 1)" in text  # both are the same, and share the first place
    assert "no: see below" in text  # its page says another name


OLDER = {
    "NUMBA_CPU_NAME": "x86-64-v2",
    "NUMBA_CPU_FEATURES": "",
    "NUMBA_DISABLE_INTEL_SVML": "1",
    "OPENBLAS_CORETYPE": "Nehalem",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F,-AVX2_Usable,-FMA_Usable,-FMA4_Usable",
}
"""Without instructions that fuse a product and a sum: in compiled code, in BLAS and in the C library."""


def features():
    from llvmlite import binding

    return binding.get_host_cpu_features()


@pytest.mark.slow
@pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64" or not features().get("fma"),
    reason="needs a processor that fuses a product and a sum, and can do without",
)
def test_an_entry_of_another_processor_is_what_it_says_to_the_stated_tolerance(made, tmp_path):
    done = jerkbench("suite", "run", "filter=baseline", "adaptation=chi2", *TINY, cwd=tmp_path, **OLDER)
    assert done.returncode == 0, done.stderr
    entry = tmp_path / "results/suite-v2-tiny/baseline-chi2"
    checked = verb("suite", "verify", entry, *ALL, cwd=tmp_path)
    assert checked.returncode == 0, checked.stdout

    own, older = (pd.read_parquet(folder / "rows.parquet") for folder in (made[2], entry))
    assert not own["position_rmse_m"].equals(older["position_rmse_m"])  # they do round otherwise
    numbers = ["position_rmse_m", "anees"]
    pd.testing.assert_frame_equal(own[numbers], older[numbers], rtol=SAME_WITHIN, atol=0.0)
