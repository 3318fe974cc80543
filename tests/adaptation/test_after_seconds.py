"""mtf with ``after_s`` begins at that time of the run on every way, whatever the rate of its updates."""

from dataclasses import replace

import numpy as np
import pytest

from jerkbench import plugins
from jerkbench.adaptation.mtf import Mtf
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.evaluation.evaluated_run import prepare_reference
from jerkbench.timeline import RecordedRun, Run, build_timeline

AFTER_S = 4.1


@pytest.fixture(scope="module")
def jumping():
    """Drives of nine seconds whose fixes are off by 3 m all the time but at the start, at 5 and at 2 Hz."""
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


def begins_s(estimate, timeline):
    """The time since the start of the first update whose R was inflated."""
    inflated = (estimate.updates.R_diagonal[:, :3] > 1.0).any(axis=1)
    return estimate.updates.t_s[np.argmax(inflated)] - timeline.t_s[0]


def first_after_s(timeline):
    at = timeline.t_s[timeline.update >= 0] - timeline.t_s[0]
    return at[at >= AFTER_S][0]


@pytest.mark.slow
@pytest.mark.parametrize("engine", [FilterpyEngine(), CompiledEngine()], ids=["filterpy", "compiled"])
def test_a_kinematic_filter_begins_then_on_both_engines(jumping, engine):
    for recording, attitude in jumping:
        timeline = build_timeline(recording, attitude)
        estimate = engine.run(timeline, plugins.create("filter", {"name": "jerk"}), Mtf(after_s=AFTER_S))
        assert begins_s(estimate, timeline) == pytest.approx(first_after_s(timeline), abs=1e-6)
    none = engine.run(timeline, plugins.create("filter", {"name": "jerk"}), Mtf())
    assert begins_s(none, timeline) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["imm", "rts", "constant_turn", "eskf15", "iekf", "eskf15_rts"])
def test_an_estimator_too_in_each_of_its_ways(jumping, name):
    model = plugins.create("filter", {"name": name})
    for recording, attitude in jumping:
        timeline = build_timeline(recording, attitude)
        ways = [model.estimate(recording, attitude, Mtf(after_s=AFTER_S))]
        if hasattr(model, "estimate_compiled"):
            ways.append(model.estimate_compiled(recording, attitude, Mtf(after_s=AFTER_S)))
        for estimate in ways:
            if estimate is not None:
                assert begins_s(estimate, timeline) == pytest.approx(first_after_s(timeline), abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["jerk", "imm", "eskf15"])
def test_runs_side_by_side_each_at_its_own_rate(jumping, name):
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


def test_the_later_of_updates_and_seconds_counts():
    times_s = np.arange(10.0)
    assert Mtf(after_s=4.5).at_updates(times_s) == Mtf(after=5)
    assert Mtf(after=7, after_s=4.5).at_updates(times_s) == Mtf(after=7)
    assert Mtf(after=3).at_updates(times_s) == Mtf(after=3)
