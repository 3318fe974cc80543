"""Invariants of adaptations, and parameters in seconds."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jerkbench import plugins
from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.sage_husa import SageHusa
from jerkbench.adaptation.scalar_r import ScalarR
from jerkbench.attitude.tilt import Tilt
from jerkbench.contracts import empty_memory
from jerkbench.datasets.field import FieldWhite
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.evaluation.evaluated_run import prepare_reference
from jerkbench.timeline import RecordedRun, Run, build_timeline

ALL_ROWS = np.arange(6)


def random_case(rng, rows=ALL_ROWS, scale=3.0):
    """An innovation, HPH' and a full R, for the given rows."""
    m = len(rows)
    half = rng.normal(size=(2, m, 2 * m))
    HPHt, R = half @ half.transpose(0, 2, 1)
    return scale * rng.normal(size=m) * np.sqrt(np.diag(HPHt + R)), HPHt, R


CASES = st.builds(
    lambda seed, scale: random_case(np.random.default_rng(seed), scale=scale),
    st.integers(0, 2**32 - 1),
    st.floats(0.05, 50.0),
)
"""Random covariances. With a small scale the innovation is below the threshold, with a large scale far above."""


def adapt(adaptation, case, rows=ALL_ROWS, memory=None):
    memory = empty_memory(adaptation) if memory is None else memory
    return adaptation.adapt(*case, rows, memory)


@given(CASES)
def test_mtf_bounds_squared_innovations_and_does_not_change_off_diagonals(case):
    y, HPHt, R = case
    adapted = adapt(Mtf(), case)

    assert (y @ y >= np.trace(HPHt) + np.trace(R)) == (adapted != R).any()
    if (adapted != R).any():
        assert (y**2 <= np.diag(HPHt + adapted) * (1 + 1e-12)).all()
    np.testing.assert_array_equal(adapted - np.diag(np.diag(adapted)), R - np.diag(np.diag(R)))


@given(CASES)
def test_after_scalar_r_the_trace_of_s_is_the_squared_innovation(case):
    y, HPHt, R = case
    adapted = adapt(ScalarR(), case)
    triggered = y @ y >= np.trace(HPHt) + np.trace(R)

    assert np.trace(HPHt + adapted) == pytest.approx(y @ y if triggered else np.trace(HPHt + R))
    np.testing.assert_allclose(adapted / R, adapted[0, 0] / R[0, 0])


def test_it_starts_after_the_number_of_updates_but_fills_its_window_before():
    hit = np.array([10.0, 0, 0, 0, 0, 0]), np.eye(6), np.eye(6)
    mtf, other = Mtf(window=4, after=3), Mtf(window=4)
    memory, others = empty_memory(mtf), empty_memory(other)
    late, early = ([adapt(rule, hit, memory=m)[0, 0] for _ in range(5)] for rule, m in ((mtf, memory), (other, others)))

    assert late == [1.0, 1.0, 1.0, *early[3:]]
    assert min(early) > 1.0


def test_the_memory_of_a_row_changes_only_if_the_row_is_present():
    sage, memory = SageHusa(), empty_memory(SageHusa())
    position, velocity = np.arange(3), np.arange(3, 6)
    y, eye = np.full(3, 5.0), np.eye(3)
    for _ in range(3):
        adapt(sage, (y, eye, eye), rows=position, memory=memory)
    adapted = adapt(sage, (y, eye, eye), rows=velocity, memory=memory)

    np.testing.assert_array_equal(memory[6:12], [3, 3, 3, 1, 1, 1])
    np.testing.assert_array_equal(adapted, eye)  # the first update of these rows uses the reported variance


def test_sage_husa_estimates_a_larger_variance_and_stays_within_its_bounds():
    rng, sage = np.random.default_rng(4), SageHusa(forgetting=0.995)
    memory, row, found = empty_memory(SageHusa()), np.array([0]), []
    for _ in range(4000):
        y = rng.normal(0.0, np.sqrt(2.0 + 9.0), 1)  # h = 2; the true r is 9 and the reported r is 1
        found.append(adapt(sage, (y, np.array([[2.0]]), np.array([[1.0]])), rows=row, memory=memory)[0, 0])
    assert np.mean(found[1000:]) == pytest.approx(9.0, rel=0.1)
    rng, sage = np.random.default_rng(5), SageHusa(low=0.5, high=2.0)
    memory = empty_memory(sage)
    for k in range(50):
        case = random_case(rng, scale=10.0 if k % 2 else 0.01)
        adapted = adapt(sage, case, memory=memory)
        ratio = np.diag(adapted) / np.diag(case[2])
        assert ((ratio >= 0.5 - 1e-12) & (ratio <= 2.0 + 1e-12)).all()
        assert np.count_nonzero(adapted) == 6


AFTER_S = 4.1


@pytest.fixture(scope="module")
def jumping():
    """Drives of 9 s with fixes at 5 and at 2 Hz that have an error of 3 m after the start."""
    drives = []
    for rate_hz in (5.0, 2.0):
        recording = FieldWhite(duration_s=9.0, gnss_rate_hz=rate_hz).load(1)
        fixes = recording.position
        off = 3.0 * np.where(np.arange(len(fixes.t_s)) % 2, 1.0, -1.0)
        off[0] = 0.0
        moved = fixes.enu_m + off[:, None]
        recording = replace(recording, position=replace(fixes, enu_m=moved))
        drives.append((recording, Tilt().estimate(recording)))
    return drives


def start_s(estimate, timeline):
    """Time from the start to the first update with an inflated R."""
    inflated = (estimate.updates.R_diagonal[:, :3] > 1.0).any(axis=1)
    return estimate.updates.t_s[np.argmax(inflated)] - timeline.t_s[0]


def first_after_s(timeline):
    at = timeline.t_s[timeline.update >= 0] - timeline.t_s[0]
    return at[at >= AFTER_S][0]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["jerk", "imm", "rts", "constant_turn", "eskf15", "iekf", "eskf15_rts"])
def test_a_run_starts_at_that_time_with_both_engines(jumping, name):
    model, rule = plugins.create("filter", {"name": name}), Mtf(after_s=AFTER_S)
    for recording, attitude in jumping:
        timeline = build_timeline(recording, attitude)
        if name == "jerk":
            estimates = [engine.run(timeline, model, rule) for engine in (FilterpyEngine(), CompiledEngine())]
        else:
            ways = [getattr(model, way) for way in ("estimate", "estimate_compiled") if hasattr(model, way)]
            estimates = [way(recording, attitude, rule) for way in ways]
        for estimate in filter(None, estimates):
            assert start_s(estimate, timeline) == pytest.approx(first_after_s(timeline), abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["jerk", "imm", "eskf15"])
def test_runs_of_a_batch_with_different_rates_start_at_that_time(jumping, name):
    model, adaptation = plugins.create("filter", {"name": name}), Mtf(after_s=AFTER_S)
    runs, wanted = [], []
    for recording, attitude in jumping:
        timeline = build_timeline(recording, attitude)
        runs.append(RecordedRun(recording, attitude, timeline, prepare_reference(recording, timeline, 0.0).scoring))
        count = int(np.sum(timeline.t_s[timeline.update >= 0] - timeline.t_s[0] < AFTER_S))
        wanted.append(Mtf(after=count))
    given = {"updates": False, "threads": 1}

    def errors(adapting):
        every = adapting if isinstance(adapting, list) else [adapting] * len(runs)
        if name == "jerk":
            bare = [Run(run.timeline, run.scoring) for run in runs]
            sums = CompiledEngine().run_settings(bare, [model] * len(runs), every, **given)
        else:
            sums = model.run_settings(runs, [model] * len(runs), every, attitude=False, **given)
        return [float(s.position_m2.sum()) for s in sums]

    assert errors(adaptation) == errors(wanted)
    assert errors(adaptation) != errors(Mtf())


def test_the_later_one_of_updates_and_seconds_applies():
    times_s = np.arange(10.0)
    assert Mtf(after_s=4.5).at_updates(times_s) == Mtf(after=5)
    assert Mtf(after=7, after_s=4.5).at_updates(times_s) == Mtf(after=7)
    assert Mtf(after=3).at_updates(times_s) == Mtf(after=3)
