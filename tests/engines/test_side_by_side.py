"""Runs side by side, without trajectories, against the metrics of the reference engine's trajectories."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from test_compiled_engine import ADAPTATIONS, FILTERS, Damped, Faded, slow_where_dense

from engine_agreement import with_other_last_bits
from jerkbench import plugins
from jerkbench.adaptation.huber import Huber
from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation, Oracle
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.evaluation.evaluated_run import can_stream, evaluate_run, prepare_reference, sums_from
from jerkbench.filters.kinematic import Baseline, Jerk
from jerkbench.timeline import VARIANCE_FLOOR, Measurements, Run, ScaledMeasurements, build_timeline
from rough import rough_recording
from synthetic import level_attitude

BURN_IN_S = 1.0
METRICS = [plugins.create("metric", {"name": name}) for name in plugins.names("metric")]
STREAMED = [metric for metric in METRICS if can_stream(metric)]


def one(seed, duration_s=4.0, **changes):
    """A rough recording with two outages in the sense of the metrics, and its timeline."""
    recording = replace(rough_recording(duration_s, seed), outages_s=np.array([[1.5, 2.0], [2.6, 3.1]]), **changes)
    u = np.random.default_rng(100 + seed).normal(0.0, 0.2, (len(recording.imu.t_s), 3))
    return recording, build_timeline(recording, level_attitude(recording, u))


@pytest.fixture(scope="module")
def several():
    """Eleven runs: one full vector, and one that is not."""
    return [one(seed) for seed in range(11)]


def side_by_side(pairs, model, adaptation, **options):
    score = [prepare_reference(recording, timeline, BURN_IN_S) for recording, timeline in pairs]
    runs = [Run(timeline, s.scoring) for (_, timeline), s in zip(pairs, score, strict=True)]
    models, adaptations = (of if isinstance(of, list) else [of] * len(runs) for of in (model, adaptation))
    results = CompiledEngine().run_settings(runs, models, adaptations, **{"updates": True, "threads": 1, **options})
    return [
        None if result is None else values(result, s, recording)
        for result, s, (recording, _) in zip(results, score, pairs, strict=True)
    ]


def values(result, score, recording):
    sums, seen = sums_from(result, score, recording), replace(score.outline, updates=result.updates)
    columns = {}
    for metric in STREAMED:
        summarises = hasattr(metric, "summarise")
        columns |= metric.summarise(sums) if summarises else metric.evaluate(seen, recording, score.counted)
    return columns


def trajectory(recording, timeline, model, adaptation):
    estimate = FilterpyEngine().run(timeline, model, adaptation)
    return evaluate_run(estimate, recording, BURN_IN_S, STREAMED)


def assert_same(got, wanted, tolerance):
    assert got.keys() == wanted.keys()
    for name, value in wanted.items():
        allowed = tolerance.get(name, 0.0) if np.isfinite(tolerance.get(name, 0.0)) else 0.0
        assert got[name] == pytest.approx(value, rel=1e-9, abs=max(allowed, 1e-15), nan_ok=True), name


PAIRS = [("jerk", name) for name in ADAPTATIONS]
PAIRS += [(name, rule) for name in FILTERS if name != "jerk" for rule in ("mtf", "huber")]
"""Every adaptation, and every filter with a rule that changes R and with a rule that changes the prior.

`test_compiled_engine.py` compares the trajectories of all pairs.
"""


@pytest.mark.parametrize(("model", "adaptation"), slow_where_dense(PAIRS))
def test_every_filter_and_every_adaptation_have_the_metrics_of_the_reference_engine(several, model, adaptation):
    pair = plugins.create("filter", {"name": model}), plugins.create("adaptation", {"name": adaptation})
    pairs = several[:2]

    got = side_by_side(pairs, *pair)

    for result, (recording, timeline) in zip(got, pairs, strict=True):
        wanted = trajectory(recording, timeline, *pair)
        try:
            assert_same(result, wanted, {})
        except AssertionError:  # only amplified rounding is an excuse
            moved = [trajectory(recording, with_other_last_bits(timeline, seed), *pair) for seed in range(2)]
            rounding = {name: 10.0 * max(abs(m[name] - wanted[name]) for m in moved) for name in wanted}
            assert_same(result, wanted, rounding)


def test_a_run_does_not_depend_on_its_neighbours(several):
    together = side_by_side(several, Jerk(), Mtf())
    backwards = side_by_side(several[::-1], Jerk(), Mtf(), threads=2)[::-1]
    alone = [side_by_side([pair], Jerk(), Mtf())[0] for pair in several]

    assert len({tuple(result.values()) for result in together}) == len(several)
    for a, b, c in zip(together, backwards, alone, strict=True):
        np.testing.assert_array_equal(list(a.values()), list(b.values()))
        np.testing.assert_array_equal(list(a.values()), list(c.values()))


def test_runs_of_other_lengths_and_steps_go_into_the_same_batch(several):
    pairs = [several[0], one(3, duration_s=2.0), several[1], one(4, duration_s=3.0, velocity=None)]

    for got, pair in zip(side_by_side(pairs, Jerk(), Mtf()), pairs, strict=True):
        assert_same(got, trajectory(*pair, Jerk(), Mtf()), {})


@dataclass(frozen=True)
class Halving(NoAdaptation):
    """Changes its argument, which it must not."""

    def adapt(self, innovation, HPHt, R, rows, memory):
        innovation *= 0.5
        return R


def test_an_argument_changed_in_place_does_not_reach_the_filter(several):
    """Neither where all rows are there nor where a neighbour lacks some."""
    fewer = one(4, velocity=None)
    for pairs in (several[:2], [several[0], fewer]):
        got, wanted = (side_by_side(pairs, Jerk(), rule)[0]["position_rmse_m"] for rule in (Halving(), NoAdaptation()))
        assert got == wanted


def test_runs_without_any_update(several):
    recording, timeline = several[0]
    nothing = (recording, replace(timeline, update=np.full_like(timeline.update, -1)))
    measured = timeline.measurements
    empty = Measurements(measured.t_ns[:0], measured.z[:0], measured.R[:0], measured.R_true[:0])
    none_there = (recording, replace(nothing[1], measurements=empty))

    for pairs in ([nothing], [none_there], [none_there, several[1]]):
        for got, pair in zip(side_by_side(pairs, Baseline(), Mtf()), pairs, strict=True):
            assert_same(got, trajectory(*pair, Baseline(), Mtf()), {})


def test_a_covariance_that_is_not_symmetric_is_left_to_the_run_alone(several):
    recording, timeline = several[0]
    R = timeline.measurements.R.copy()
    R[3, 0, 1] += 1e-5
    pairs = [(recording, replace(timeline, measurements=replace(timeline.measurements, R=R))), several[1]]

    lopsided, sound = side_by_side(pairs, Jerk(), Mtf())

    assert lopsided is None
    assert_same(sound, trajectory(*several[1], Jerk(), Mtf()), {})


def told(pair, position, velocity):
    recording, timeline = pair
    return recording, replace(timeline, measurements=ScaledMeasurements(timeline.measurements, position, velocity))


@pytest.mark.parametrize("rule", [NoAdaptation(), Mtf(), Oracle(), Huber()], ids=["none", "mtf", "oracle", "huber"])
def test_settings_that_share_a_recording_are_those_beside_other_recordings_to_the_bit(several, rule):
    settings = [told(several[0], 0.3 + 0.2 * k, 2.0 - 0.2 * k) for k in range(8)]
    models = [Jerk(jerk_mps3_per_sqrt_s=1.0 + k) for k in range(8)]

    sharing = side_by_side(settings, models, rule)

    assert len({result["position_rmse_m"] for result in sharing}) == len(settings)
    for k, result in enumerate(sharing):
        beside, _ = side_by_side([settings[k], several[1 + k]], [models[k], Jerk()], rule)
        np.testing.assert_array_equal(list(result.values()), list(beside.values()))


def test_a_filter_is_told_the_covariances_that_it_would_be_told_alone(several):
    # a variance that is reported at 3 mm^2 is told as 1 mm^2, the floor, not as less
    recording, timeline = several[0]
    R = timeline.measurements.R.copy()
    R[:, 0] = R[:, :, 0] = 0.0
    R[:, 0, 0] = 3e-6
    small = recording, replace(timeline, measurements=replace(timeline.measurements, R=R))
    scaled = told(small, 0.2, 3.0)
    wanted = replace(timeline.measurements, R=scaled[1].measurements.R)

    assert wanted.R[0, 0, 0] == VARIANCE_FLOOR
    eager = side_by_side([(recording, replace(timeline, measurements=wanted))], Jerk(), Mtf())[0]
    assert_same(side_by_side([scaled], Jerk(), Mtf())[0], eager, {})


@dataclass
class Loose:
    """A filter that can change, and so has no hash."""

    scale: float = 1.0

    def axis_model(self, dt, dt0):
        A, b, Q = Jerk().axis_model(dt, dt0)
        return A, b, Q * self.scale

    def initial_variances(self):
        variances = Jerk().initial_variances()
        variances.flags.writeable = False
        return variances


@dataclass(frozen=True)
class Broken(NoAdaptation):
    """A variance that makes the covariance lose its sign where the innovation is large."""

    def adapt(self, innovation, HPHt, R, rows, memory):
        return -0.9 * HPHt if np.abs(innovation).max() > 0.6 else R


def test_a_run_that_fails_is_left_to_the_run_alone_and_harms_no_other(several):
    got = side_by_side(several, Baseline(), Broken())
    failed = [bool(FilterpyEngine().run(timeline, Baseline(), Broken()).failure) for _, timeline in several]

    assert any(failed)
    for result, fails, pair in zip(got, failed, several, strict=True):
        assert not (fails and result is not None)
        if result is not None:
            assert_same(result, trajectory(*pair, Baseline(), Broken()), {})


@pytest.mark.slow
def test_each_run_may_have_its_own_filter_and_adaptation(several):
    """Other numbers, another class, another memory, another number of states, the true covariance or not."""
    models = [Jerk(0.1), Jerk(0.3), Jerk(0.1, 2.0), Loose(10.0), Baseline(0.5), Damped(), Baseline(0.2), Jerk(0.3)]
    rules = [Mtf(), Mtf(window=4, guard=2), NoAdaptation(), Faded(), Oracle(), Mtf(), Faded(factor=1.1), Mtf(window=2)]

    got = side_by_side(several[:8], models, rules)

    for result, pair, model, rule in zip(got, several, models, rules, strict=False):
        assert_same(result, trajectory(*pair, model, rule), {})


@dataclass(frozen=True)
class Raising(NoAdaptation):
    """Raises where the innovation is large."""

    limit: float = 0.6
    fades: bool = False

    def fade(self, innovation, HPHt, R, rows, memory):
        if self.fades and np.abs(innovation).max() > self.limit:
            raise ValueError("fade: too far")
        return 1.0

    def adapt(self, innovation, HPHt, R, rows, memory):
        if not self.fades and np.abs(innovation).max() > self.limit:
            raise ValueError("adapt: too far")
        return R


@pytest.mark.parametrize("fades", [False, True])
def test_an_adaptation_that_raises_in_one_run_harms_no_other(several, fades):
    rules = [Raising(1e9, fades), Raising(0.6, fades), Raising(1e9, fades)]
    healthy, lost, other = side_by_side(several[:3], Jerk(), rules)

    assert lost is None
    with pytest.raises(ValueError, match="too far"):
        CompiledEngine().run(several[1][1], Jerk(), rules[1])
    for got, pair in ((healthy, several[0]), (other, several[2])):
        assert_same(got, trajectory(*pair, Jerk(), NoAdaptation()), {})


def test_a_reference_with_holes_needs_a_trajectory(several):
    recording, timeline = several[0]
    truth = recording.reference.enu_m.copy()
    truth[20, 1] = np.nan
    holed = replace(recording, reference=replace(recording.reference, enu_m=truth))

    assert prepare_reference(holed, timeline, BURN_IN_S) is None
    assert prepare_reference(recording, timeline, burn_in_s=100.0) is None
