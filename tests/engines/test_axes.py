"""Runs whose axes have nothing to do with each other: each axis by itself gives what all together give."""

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import ClassVar

import numpy as np
import pytest
from test_side_by_side import BURN_IN_S, one, side_by_side

from jerkbench import plugins
from jerkbench.compilation.lanes import chosen
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.evaluation.evaluated_run import evaluate_run, prepare_reference, sums_from
from jerkbench.kinematic import packs, runs
from jerkbench.timeline import Run, build_timeline, step_lengths
from synthetic import level_attitude, recording_at_rest

AXES = 1
"""What reads it goes over each axis by itself (`jerkbench.adaptation.linalg`)."""

RULES = ("none", "mtf", "chi2", "iae", "scalar_q", "huber_r", "cerkf_r", "variational_bayes")
DENSE = ("huber", "maximum_correntropy", "ssmkf")
ONE_MODEL = ("strong_tracking", "sif", "sage_husa_qr")  # they see whole matrices too; each takes long to compile
ERRORS = [plugins.create("metric", {"name": name}) for name in ("position_rmse", "velocity_rmse", "outage")]


@dataclass(frozen=True)
class Couples:
    """Gives two axes a covariance, from an update on."""

    after: int = 20

    def memory_size(self):
        return 1

    def adapt(self, innovation, HPHt, R, rows, memory):
        memory[0] += 1.0
        adapted = R.copy()
        if memory[0] > self.after and len(rows) > 1:
            adapted[0, 1] = adapted[1, 0] = 0.3 * np.sqrt(R[0, 0] * R[1, 1])
        return adapted


def uncoupled(pair):
    """The same run with an R and a start without covariances between axes."""
    recording, timeline = pair
    own = timeline.measurements
    R = np.where((np.arange(6)[:, None] - np.arange(6)) % 3 == 0, own.R, 0.0)
    P0 = np.diag(np.diag(timeline.P0))
    return recording, replace(timeline, measurements=replace(own, R=R, R_true=R), P0=P0, start=None)


@pytest.fixture(scope="module")
def several():
    return [uncoupled(one(seed)) for seed in (1, 2, 3)]


@pytest.fixture(autouse=True)
def many_runs(monkeypatch):
    """A process that has made so many runs that loops for decoupled axes pay."""
    monkeypatch.setattr(runs, "MANY_RUNS", 0)


@pytest.fixture
def strides(monkeypatch):
    """The strides of the loops that run from here on."""
    seen, loop_for = [], runs.loop_for
    monkeypatch.setattr(
        runs, "loop_for", lambda *given, **named: seen.append(named["stride"]) or loop_for(*given, **named)
    )
    return seen


def errors_alone(pairs, model, adaptation):
    """The metrics of errors of each pair, run side by side without anything of the covariances."""
    scores = [prepare_reference(recording, timeline, BURN_IN_S) for recording, timeline in pairs]
    bare = [Run(timeline, score.errors_alone) for (_, timeline), score in zip(pairs, scores, strict=True)]
    several = [model] * len(pairs), [adaptation] * len(pairs)
    results = CompiledEngine().run_settings(bare, *several, updates=False, threads=1)
    columns = []
    for result, score, (recording, _) in zip(results, scores, pairs, strict=True):
        sums = sums_from(result, score, recording)
        columns.append({name: value for metric in ERRORS for name, value in metric.summarise(sums).items()})
    return columns


@pytest.mark.parametrize(
    ("rule", "name"), [*product([*RULES, *DENSE], ["jerk", "baseline"]), *product(ONE_MODEL, ["jerk"])]
)
def test_each_axis_by_itself_gives_what_all_together_give(several, rule, name, strides, monkeypatch):
    model, adaptation = plugins.create("filter", {"name": name}), plugins.create("adaptation", {"name": rule})
    got = errors_alone(several, model, adaptation)
    monkeypatch.setattr(packs, "axes_apart", lambda P0: np.zeros(len(P0), dtype=bool))
    together = errors_alone(several, model, adaptation)
    assert strides == [3, 1]
    for own, wanted in zip(got, together, strict=True):
        assert own == pytest.approx(wanted, rel=1e-12, abs=1e-15, nan_ok=True)


def test_a_process_with_few_runs_compiles_no_loop_for_decoupled_axes(several, strides, monkeypatch):
    monkeypatch.setattr(runs, "MANY_RUNS", 100_000)
    monkeypatch.setattr(runs, "RUNS_MADE", [100_000 - 4])
    pair = plugins.create("filter", {"name": "baseline"}), plugins.create("adaptation", {"name": "none"})
    for _ in range(2):
        errors_alone(several, *pair)
    assert strides == [1, 3]


@dataclass(frozen=True)
class CouplesPrior(Couples):
    """The same in the prior covariance, of which it goes over each axis by itself otherwise."""

    def adapt_prior(self, x, P, F, Q, innovation, R, rows, memory):
        memory[0] += 1.0
        T = AXES * np.eye(len(P))
        if memory[0] > self.after:
            T[0, 1] = 0.3
        return T @ P @ T.T

    def adapt(self, innovation, HPHt, R, rows, memory):
        return R


@dataclass(frozen=True)
class CouplesGain(CouplesPrior):
    """The same in the gain."""

    def adapt_prior(self, x, P, F, Q, innovation, R, rows, memory):
        return P

    def adapt_gain(self, x, P, innovation, R, rows, memory):
        memory[0] += 1.0
        K = np.zeros((len(x), len(rows)))
        for i, row in enumerate(rows):
            K[row, i] = AXES * P[row, row] / (P[row, row] + R[i, i])
        if memory[0] > self.after and len(rows) > 1:
            K[0, 1] = 0.1
        return K


@dataclass(frozen=True)
class CouplesInLanes:
    """Gives two axes a covariance in R, of all runs at once."""

    after: int = 20
    lanes: ClassVar[bool] = True

    def memory_size(self):
        return 1

    def adapt(self, innovation, HPHt, R, rows, memory):
        memory[0] += 1.0
        adapted = R.copy()
        if len(rows) > 1:
            adapted[0, 1] += chosen(memory[0], self.after, 0.3 * math.sqrt(R[0, 0] * R[1, 1]), 0.0)
            adapted[1, 0] = adapted[0, 1]
        return adapted


COUPLING = (Couples, CouplesPrior, CouplesGain, CouplesInLanes)


@pytest.mark.parametrize("rows", ["all", "some"])
@pytest.mark.parametrize("adaptation", [kind() for kind in COUPLING], ids=lambda of: type(of).__name__)
def test_an_adaptation_that_couples_axes_has_all_together(several, strides, adaptation, rows):
    model = plugins.create("filter", {"name": "jerk"})
    pairs = several if rows == "all" else [several[0], missing(several[1]), several[2]]
    for (recording, timeline), got in zip(pairs, errors_alone(pairs, model, adaptation), strict=True):
        estimate = FilterpyEngine().run(timeline, model, adaptation)
        assert got == pytest.approx(evaluate_run(estimate, recording, BURN_IN_S, ERRORS), rel=1e-9, nan_ok=True)
    assert strides == [3, 1]


@pytest.mark.parametrize("rule", ["none", "mtf", "huber"])
def test_what_reads_no_velocity_has_the_same_positions_to_the_bit(several, rule):
    model, adaptation = plugins.create("filter", {"name": "jerk"}), plugins.create("adaptation", {"name": rule})
    scores = [prepare_reference(recording, timeline, BURN_IN_S) for recording, timeline in several]
    both, bare = (
        CompiledEngine().run_settings(
            [Run(timeline, getattr(score, of)) for (_, timeline), score in zip(several, scores, strict=True)],
            [model] * len(several),
            [adaptation] * len(several),
            updates=False,
            threads=1,
        )
        for of in ("errors_alone", "positions_alone")
    )
    for own, wanted in zip(bare, both, strict=True):
        for part in ("position_m2", "whole_m2", "outage_m2", "largest_m2", "marked_m"):
            np.testing.assert_array_equal(getattr(own, part), getattr(wanted, part), err_msg=part)
        assert (wanted.velocity_m2ps2 > 0.0).all()
        assert np.isnan(own.velocity_m2ps2).all()


def test_a_state_that_is_no_number_at_the_end_is_run_alone_whatever_is_scored(several):
    recording, timeline = several[0]
    u, last = timeline.accel_enu_mps2.copy(), np.flatnonzero(timeline.dt_s > 0.0)[-1]
    u[timeline.sample[last]] = math.inf
    before = np.arange(len(timeline.dt_s)) < last  # neither an update nor a stamp of the reference sees it
    seen = {name: np.where(before, getattr(timeline, name), -1) for name in ("update", "reference")}
    broken = replace(timeline, accel_enu_mps2=u, **seen)
    score = prepare_reference(recording, broken, BURN_IN_S)
    model, adaptation = plugins.create("filter", {"name": "jerk"}), plugins.create("adaptation", {"name": "none"})
    for scoring in (score.errors_alone, score.positions_alone):
        run = [Run(broken, scoring)]
        assert CompiledEngine().run_settings(run, [model], [adaptation], updates=False, threads=1) == [None]


def even(seed):
    """A run at rest whose fixes come with samples of the IMU: all of its steps are equally long."""
    rng, recording = np.random.default_rng(seed), recording_at_rest(duration_s=6.0)
    p = recording.position
    recording = replace(recording, position=replace(p, enu_m=p.enu_m + 0.1 * rng.standard_normal(p.enu_m.shape)))
    u = rng.normal(0.0, 0.2, (len(recording.imu.t_s), 3))
    timeline = build_timeline(recording, level_attitude(recording, u))
    assert len(step_lengths(timeline.dt_s)[0]) == 1
    return uncoupled((recording, timeline))


def missing(pair):
    """The same run, in which rows are missing here and there, whole updates too, and for a while all of them."""
    recording, timeline = pair
    z, rng = timeline.measurements.z.copy(), np.random.default_rng(1)
    z[rng.random(z.shape) < 0.1] = np.nan
    z[rng.random(len(z)) < 0.2] = np.nan
    z[10:16] = np.nan
    return recording, replace(timeline, measurements=replace(timeline.measurements, z=z))


def fewer(pair):
    """The same run without every third update, so that there are twice as many steps between two now and then."""
    recording, timeline = pair
    update = timeline.update.copy()
    update[np.flatnonzero(update >= 0)[2::3]] = -1
    return recording, replace(timeline, update=update)


@pytest.mark.parametrize("rule", ["none", "mtf", "variational_bayes", "strong_tracking"])
@pytest.mark.parametrize("make", [even, lambda seed: uncoupled(one(seed))], ids=["even", "uneven"])
def test_where_p_is_read_at_updates_alone_they_may_come_as_they_like(rule, make):
    several = [make(seed) for seed in (1, 2, 3)]
    model, adaptation = plugins.create("filter", {"name": "jerk"}), plugins.create("adaptation", {"name": rule})
    for pairs in (list(map(fewer, several)), [missing(several[0]), fewer(several[1]), fewer(missing(several[2]))]):
        got = errors_alone(pairs, model, adaptation)

        for own, (recording, timeline) in zip(got, pairs, strict=True):
            estimate = FilterpyEngine().run(timeline, model, adaptation)
            assert own == pytest.approx(evaluate_run(estimate, recording, BURN_IN_S, ERRORS), rel=1e-9, nan_ok=True)
            (alone,) = errors_alone([(recording, timeline)], model, adaptation)
            np.testing.assert_array_equal(list(own.values()), list(alone.values()))


def coupled(pair):
    """The same run with a covariance of two axes in R."""
    recording, timeline = pair
    own = timeline.measurements
    R = own.R.copy()
    R[:, 0, 1] = R[:, 1, 0] = 0.4 * np.sqrt(R[:, 0, 0] * R[:, 1, 1])
    return recording, replace(timeline, measurements=replace(own, R=R, R_true=R))


@pytest.mark.parametrize("way", [errors_alone, side_by_side])
@pytest.mark.parametrize("rule", ["none", "mtf"])
def test_no_run_depends_on_what_its_neighbours_measure_where_axes_are_coupled(rule, way):
    pairs = [coupled(even(1)), missing(coupled(even(2))), fewer(coupled(even(3)))]
    model, adaptation = plugins.create("filter", {"name": "jerk"}), plugins.create("adaptation", {"name": rule})
    for own, pair in zip(way(pairs, model, adaptation), pairs, strict=True):
        (alone,) = way([pair], model, adaptation)
        np.testing.assert_array_equal(list(own.values()), list(alone.values()))
