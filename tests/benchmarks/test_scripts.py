"""The scripts of the folder benchmarks on small inputs."""

import sys
from time import sleep

import numpy as np
import pytest

from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.plugins import create


@pytest.fixture
def drive(script):
    return script("drive")


@pytest.fixture(scope="module")
def given():
    recording = FieldWhite(duration_s=8.0).load(0)
    return recording, Tilt().estimate(recording)


def test_what_is_not_there_is_named_and_the_error_is_that_after_a_minute(drive, given, monkeypatch):
    assert "--kf-gins names no copy of its source" in drive.kf_gins(*given, None)
    monkeypatch.setitem(sys.modules, "pyins", None)
    assert "pip install python-ins" in drive.python_ins(*given, 1.0)
    recording, _ = given
    monkeypatch.setattr(drive, "SETTLED_S", 4.0)
    reference = recording.reference
    shifted = reference.enu_m + np.where(reference.t_s[:, None] < 4.0, 9.0, [3.0, 0.0, 4.0])
    assert drive.rmse_m(recording, reference.t_s, shifted) == pytest.approx(5.0)


@pytest.mark.slow
def test_every_stage_of_a_sweep_has_its_line(script, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["sweep.py", "--seeds", "1"])
    script("sweep").main()
    printed = capsys.readouterr().out
    stages = "read from the disk", "disturbed", "attitude", "timeline", "filtered and scored", "stored", "looked up"
    assert all(stage in printed for stage in stages)


MODULES = {"simdkalman_runs": "simdkalman", "torch_kf_runs": "torch_kf"}
MODULES |= {"lgssm_filter_runs": "dynamax", "scan_runs": "dynamax"}
MAX_DIFFERENCE_M = {"simdkalman": 1e-12, "torch_kf": 1e-12, "dynamax": 1e-6}
"""dynamax adds 1e-9 to the diagonal of S before it solves; the eigenvalues of R are about 1e-4, innovations 0.1 m."""


@pytest.fixture
def timeline(script, monkeypatch):
    engines = script("engines")
    monkeypatch.setattr(engines, "STEPS", 200)
    return engines.workload()


@pytest.mark.filterwarnings("ignore:jax.*is deprecated:DeprecationWarning")  # by what dynamax depends on
@pytest.mark.parametrize("runs", [1, 3])
@pytest.mark.parametrize("way", MODULES)
def test_every_run_of_a_library_is_that_of_the_plain_loop(script, timeline, way, runs):
    pytest.importorskip(MODULES[way])
    peers, loop = script("peers"), script("plain_loops").filterpy_loop
    model = create("filter", {"name": "jerk"})

    position_m = getattr(peers, way)(timeline, model, runs)()

    assert position_m.shape == (runs, 201, 3)
    for shift in range(runs):
        x, _ = loop(peers.later(timeline, shift), model)
        assert abs(position_m[shift] - x[:, :3]).max() < MAX_DIFFERENCE_M[MODULES[way]]
        assert abs(position_m[shift] - position_m[shift - 1]).max() > 1e-3 or runs == 1


COUNT, SEED = 25, 20240514


@pytest.fixture
def hostile(script, monkeypatch):
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    return script("hostile")


@pytest.mark.slow
def test_random_command_lines_end_in_words(hostile, tmp_path, monkeypatch):
    monkeypatch.setattr(hostile, "MAX_CHORD_S", 600)  # a busy machine is no fault of theirs
    outcomes = list(hostile.command_lines(COUNT, SEED, tmp_path))

    assert [outcome for outcome in outcomes if outcome.kind == "broken"] == []
    assert {outcome.kind for outcome in outcomes} == {"refused", "survived"}


@pytest.mark.parametrize("family", ["tracks", "arrays"])
def test_damaged_recordings_end_in_words(hostile, tmp_path, monkeypatch, family):
    monkeypatch.setattr(hostile, "MAX_CHORD_S", 600)
    monkeypatch.setattr(hostile, "SMOOTHED", COUNT + 1)  # the search takes seconds
    outcomes = list(hostile.FAMILIES[family](COUNT, SEED, tmp_path))

    assert [outcome for outcome in outcomes if outcome.kind == "broken"] == []
    assert {outcome.kind for outcome in outcomes} == {"refused", "survived"}


@pytest.mark.parametrize(
    ("raised", "why"),
    [(ValueError("x"), "ValueError: x"), (SystemExit(1), "without a word"), (RecursionError("deep"), "deep")],
)
def test_what_ends_without_words_is_broken(hostile, tmp_path, monkeypatch, raised, why):
    def fail(_):
        raise raised

    monkeypatch.setattr(hostile, "jerkbench", fail)
    outcome = hostile.attempt(["run"], tmp_path)
    assert outcome.kind == "broken"
    assert why in outcome.why


@pytest.mark.parametrize(
    ("limit", "work"), [("SILENT_S", lambda _: all(iter(lambda: True, 0))), ("MAX_CHORD_S", lambda _: sleep(9))]
)
def test_silence_is_broken(hostile, tmp_path, monkeypatch, limit, work):
    monkeypatch.setattr(hostile, limit, 0.05)
    monkeypatch.setattr(hostile, "jerkbench", work)
    assert "silent" in hostile.attempt(["run"], tmp_path).why
