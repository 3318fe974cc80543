"""`jerkbench compare`: the gate for CI."""

import hashlib
import json

import pytest

from commands import verb
from jerkbench.jobs.store import Store
from stored_cells import LABELS, about, row, store_cell


def put(folder, rmse_m, rmse_mps=1.0, changes=None, **labels):
    """Store a cell with the errors of three runs; ``changes`` has other values of some seeds."""
    key = hashlib.sha256(str(labels).encode()).hexdigest()[:16]
    rows = [row(rmse_m * (1 + seed / 10), seed, **labels) | {"velocity_rmse_mps": rmse_mps} for seed in range(3)]
    for seed, values in (changes or {}).items():
        rows[seed].update(values)
    store_cell(Store(folder), key, rows, about(labels={**LABELS, **labels}))


def study(folder, outage=1.0, nothing=1.0, velocity=1.0):
    """Two methods in two scenarios; the errors of mtf are times a factor, all velocities as well."""
    for disturbance, factor in (("gnss_outage", outage), ("none", nothing)):
        put(folder, 2.0, velocity, adaptation="none", disturbance=disturbance)
        put(folder, 2.0 * factor, velocity, adaptation="mtf", disturbance=disturbance)
    return folder


@pytest.fixture
def before(tmp_path):
    return study(tmp_path / "before")


@pytest.fixture
def ruined(before, tmp_path):
    """A later version in which seed 2 of one combination is 50 times as wrong, and seed 1 of another diverged."""
    for disturbance, changes in (
        ("none", {2: {"position_rmse_m": 2.0 * 1.2 * 50}}),
        ("gnss_outage", {1: {"status": "diverged", "reason": "x"}}),
    ):
        put(tmp_path / "after", 2.0, adaptation="none", disturbance=disturbance)
        put(tmp_path / "after", 2.0, changes=changes, adaptation="mtf", disturbance=disturbance)
    return ["compare", "before", "after", "--fail-above", "1000", "--format"]


REASONS = {
    "gnss_outage, mtf": ["1 of 3 runs diverged or failed in B, 0 in A (seed 1)"],
    "none, mtf": ["1 of 3 runs increased by more than 10 times, at most by 50 times (seed 2)"],
}


@pytest.mark.parametrize("name", ["terminal", "md"])
def test_the_gate_prints_which_combination_and_which_seed_failed(ruined, tmp_path, name):
    done = verb(*ruined, name, cwd=tmp_path)
    text = " ".join((done.stdout + done.stderr).split())

    assert done.returncode == 3
    assert all(f"{combination} fails: {reason}." in text for combination, (reason,) in REASONS.items())
    assert text.count(" fails: ") == 2
    assert "2 of 4 combinations fail (allowed: 1000 %)." in text


def test_the_gate_gives_its_reasons_to_programs(ruined, tmp_path):
    answer = json.loads(verb(*ruined, "json", cwd=tmp_path).stdout)

    found = {
        ", ".join(change["combination"][key] for key in ("disturbance", "adaptation")): change["failures"]
        for change in answer["changes"]
        if change["worse"]
    }
    assert (answer["ok"], found) == (False, REASONS)


def test_the_gate_fails_for_studies_without_a_common_seed(before, tmp_path):
    store_cell(Store(tmp_path / "one"), "a" * 16, [row(2.0, 9, adaptation="mtf")], about())
    store_cell(Store(tmp_path / "two"), "b" * 16, [row(2.0, 8, adaptation="mtf")], about())
    done = verb("compare", "one", "two", "--fail-above", "3", cwd=tmp_path)

    assert done.returncode == 4
    assert "1 of the 1 combinations of A cannot be compared: 1 because A and B have no seed in common." in done.stdout


def test_exit_codes_tell_worse_from_what_cannot_be_compared_and_from_wrong_input(before, tmp_path):
    study(tmp_path / "after", outage=1.6)
    put(tmp_path / "part", 2.0, adaptation="none", disturbance="none")
    put(tmp_path / "other", 2.0, filter="baseline", disturbance="elsewhere")
    put(tmp_path / "bad", 8.0, adaptation="none", disturbance="none")
    codes = {
        b: verb("compare", "before", b, "--fail-above", "3", cwd=tmp_path).returncode
        for b in ("before", "after", "part", "other", "bad", "absent")
    }

    assert codes == {"before": 0, "after": 3, "part": 4, "other": 4, "bad": 3, "absent": 2}
