"""Random timelines: whatever comes, both engines agree, or refuse alike.

The default number takes seconds and always gives the same timelines. JERKBENCH_RANDOM_TIMELINES=700 draws new ones.

Two runs agree if they differ by less than the limits of `engine_agreement`, or by less than some times what rounding
itself explains: the reference runs again with other last bits of x and P after every step and of z at every update, and
with what the rounding of the factors of S and of the sum x + K y does to x and P (`ChangedRun`). An engine's factors
and solves are those of S + E with |E_ij| < (3 m + 1) u sqrt(S_ii S_jj), m = 6 (Higham, "Accuracy and Stability of
Numerical Algorithms", 10.1): 19 u, twice for two engines, where a changed run takes up to 4 u. FACTOR is twice that
ratio, for six draws need not point where the engines do. What cancels is whole units in the last place, so that the
three axes share the largest.

That must not be more than a twentieth of a sigma: where it is, a threshold has flipped, a rule has amplified rounding,
or a run has failed by it. Nothing after that is compared: the run is cut.
"""

import json
import os
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from test_compiled_engine import ADAPTATIONS, FILTERS, Damped

from engine_agreement import LIMITS
from jerkbench import plugins
from jerkbench.engines import filterpy_engine
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.kalman import innovation_factor
from jerkbench.timeline import Measurements, Timeline

SHARE = 3
COUNT = int(os.environ.get("JERKBENCH_RANDOM_TIMELINES", SHARE))
LAST_BITS, CHANGED, FACTOR, MAX_ERROR = 4, 6, 20.0, 0.05
"""Bits [ulp], changed runs, how much more than these the engine may differ, and the most that they may [sigma]."""
MAX_CHANGED = 60
"""Changed runs where six do not explain a difference: a threshold within an iteration flips in one of ten."""

LENGTHS_S = st.sampled_from([0.01, 0.01, 0.01, 0.1, 1.0, 100.0, 0.0, 1e-9])
ROWS = st.sampled_from(["both", "both", "position", "velocity", "none", "some"])
STEPS = st.lists(st.tuples(LENGTHS_S, st.booleans(), ROWS, st.sampled_from([1e-3, 1e-2, 1.0, 30.0])), max_size=25)
MODELS = {name: plugins.create("filter", {"name": name}) for name in FILTERS} | {"damped": Damped()}
SEEN, SELDOM = Counter(), []
SINGULAR, DIFFICULT = (
    json.loads(Path(__file__).with_name(f"{name}_timelines.json").read_text(encoding="utf-8"))
    for name in ("singular", "difficult")
)
"""Timelines at whose end rounding had decided which engine refuses, and timelines on which an engine was wrong."""


@pytest.mark.slow
@example(
    steps=[(0.01, False, "both", 1e-3), (100.0, True, "both", 1.0), (0.01, True, "both", 1e-3)], seed=0
)  # the smallest eigenvalue of the scaled P is 2e-12: no engine may refuse for its sign
@given(steps=STEPS, seed=st.integers(0, 2**32 - 1))
@settings(
    max_examples=COUNT,
    derandomize=COUNT <= SHARE,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    print_blob=True,
)
def test_both_engines_agree_or_refuse_alike(steps, seed):
    timeline = timeline_of(steps, seed, correlated=True)
    for model in MODELS.values():
        for name in ADAPTATIONS:
            adaptation = plugins.create("adaptation", {"name": name})
            SEEN[compare(timeline, model, adaptation)] += 1


@pytest.mark.slow
@pytest.mark.parametrize("case", DIFFICULT)
def test_difficult_timelines_agree_as_far_as_rounding_allows(case):
    given = dict(DIFFICULT[case])
    names, outcomes, never_fails = given.pop("models"), given.pop("outcomes"), given.pop("never_fails")
    adaptation, timeline = plugins.create("adaptation", {"name": given.pop("adaptation")}), timeline_of(**given)
    for model in (MODELS[name] for name in names or MODELS):
        assert compare(timeline, model, adaptation) in outcomes
        failures = {engine.run(timeline, model, adaptation).failure for engine in (FilterpyEngine(), CompiledEngine())}
        assert failures == {""} or not never_fails


@pytest.mark.slow
@pytest.mark.parametrize("timeline", SINGULAR)
def test_where_the_prior_is_singular_to_rounding_both_engines_end_alike(timeline):
    """`strong_tracking` makes it 1e14 to 1e20 R after a gap; what an update leaves of it is widened by rounding."""
    timeline = timeline_of(**SINGULAR[timeline])
    pair = plugins.create("filter", {"name": "bias"}), plugins.create("adaptation", {"name": "strong_tracking"})
    runs = [engine.run(timeline, *pair) for engine in (FilterpyEngine(), CompiledEngine())]
    assert runs[0].failure == runs[1].failure
    assert len(runs[0].updates.t_s) == len(runs[1].updates.t_s)
    assert len(runs[0].index) == len(runs[1].index)


@pytest.fixture(scope="module", autouse=True)
def _counted():
    """Nearly all runs are compared to their end, or the comparison would be empty."""
    yield
    print(dict(SEEN), len(SELDOM))  # noqa: T201 - pytest -s shows it
    assert len(SELDOM) <= max(1, 0.001 * sum(SEEN.values()))
    assert SEEN["cut"] <= 0.05 * sum(SEEN.values())


def timeline_of(steps, seed, *, correlated=False):
    """Steps of all lengths; measurements with outliers, full covariances, missing rows and NaN; P0 may be full."""
    rng = np.random.default_rng(seed)
    n = len(steps) + 1
    dt_s = np.array([0.0, *(dt for dt, *_ in steps)])
    measured = [(k + 1, rows, sigma) for k, (_, is_measured, rows, sigma) in enumerate(steps) if is_measured]
    z, R = np.empty((len(measured), 6)), np.empty((len(measured), 6, 6))
    update = np.full(n, -1)
    for m, (k, rows, sigma) in enumerate(measured):
        scale = sigma * np.repeat(rng.choice([0.5, 1.0, 5.0], 2), 3)
        half = rng.normal(size=(6, 8)) * scale[:, None]
        R[m] = half @ half.T + 0.1 * np.diag(scale**2)
        z[m] = rng.normal(0.0, scale * (40.0 if rng.random() < 0.2 else 1.0))
        z[m, absent(rows, rng)] = np.nan
        update[k] = m
    t_s = np.cumsum(dt_s)
    t_ns = np.round(t_s[update >= 0] * 1e9).astype(np.int64)
    P0 = np.diag(np.repeat(rng.choice([1e-6, 1e-2, 1.0, 100.0], 2), 3))
    u, sample = rng.normal(0.0, 0.3, (n, 3)), np.arange(n)
    euler, x0 = np.zeros((n, 3)), rng.normal(size=6)
    if correlated:
        half = np.sqrt(P0) @ rng.normal(size=(6, 8))
        P0 = half @ half.T + 0.1 * P0
    return Timeline(0.01, dt_s, sample, update, np.arange(n), u, Measurements(t_ns, z, R, 2.0 * R), x0, P0, euler, t_s)


def absent(rows, rng):
    """Which of the six rows are not there."""
    named = {"both": [], "position": [3, 4, 5], "velocity": [0, 1, 2], "none": range(6)}
    return list(named[rows]) if rows in named else np.flatnonzero(rng.random(6) < 0.5)


def compare(timeline, model, adaptation):
    """Return how far the two were compared: "strictly", "rounded", "refused" or "cut"."""
    reference, compiled = (
        FilterpyEngine().run(timeline, model, adaptation),
        CompiledEngine().run(timeline, model, adaptation),
    )
    scale = np.sqrt(np.maximum(diagonal(reference), 1e-300))
    difference = apart(compiled, reference, scale)
    alike = compiled.failure == reference.failure and len(compiled.index) == len(reference.index)
    if alike and (difference < strict_limits(scale)).all():
        return "refused" if reference.failure else "strictly"
    changed = []
    for seed in range(MAX_CHANGED):
        changed.append(with_other_bits(timeline, model, adaptation, seed))
        if len(changed) < CHANGED:
            continue
        largest = np.max([padded(apart(run, reference, scale), len(scale)) for run in changed], axis=0)
        spread = np.maximum.accumulate(shared_by_axes(largest), axis=0)
        told = int(np.argmax((spread > MAX_ERROR).any(axis=1))) if (spread > MAX_ERROR).any() else len(scale)
        end = min(told, len(difference))
        times = (difference / (strict_limits(scale) + FACTOR * spread)[: len(difference)])[:end]
        if (times <= 1.0).all():
            break
    if len(changed) > CHANGED:
        SELDOM.append(timeline)
    assert (times <= 1.0).all(), f"{times.max()} times what other last bits explain"
    same_end = all(run.failure == reference.failure for run in changed)
    if told == len(scale) and same_end:
        assert alike, f"{compiled.failure!r} is not {reference.failure!r}, and rounding does not explain it"
        return "rounded"
    return "cut"


def with_other_bits(timeline, model, adaptation, seed):
    """Run the reference with other last bits at every step."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(filterpy_engine, "_Run", partial(ChangedRun, np.random.default_rng(seed)))
        return FilterpyEngine().run(timeline, model, adaptation)


class ChangedRun(filterpy_engine._Run):
    """The reference with other last bits at every step."""

    def __init__(self, rng, *given, **named):
        super().__init__(*given, **named)
        self.rng = rng

    def predict(self, dt, u):
        super().predict(dt, u)
        n = len(self.kf.x)
        factor = np.tril(self._other((n, n)))
        self.kf.P = self.kf.P * (factor + np.tril(factor, -1).T)
        self.kf.x = self.kf.x * self._other((n, 1))

    def update(self, update):
        self.z = self.z.copy()
        self.z[update] *= self._other(6)
        try:
            failure = super().update(update)
        except np.linalg.LinAlgError as error:  # a rule that takes factors of P says in this way that it is none
            return str(error)
        factor = np.tril(self._other(self.kf.P.shape))
        self.kf.P = self.kf.P * (factor + np.tril(factor, -1).T)
        self.kf.x = self.kf.x * self._other(self.kf.x.shape)
        return failure

    def _correct(self, innovation, R, rows):
        """Note what the rounding of the factors of S does to state and covariance.

        They are those of S + E, |E_ij| < c eps sqrt(S_ii S_jj). With G' the columns of H P, or of R for the measured
        states whose R is the smaller, P = G S^-1 G' or that less the prior or R: G S^-1 E S^-1 G' is its error, and
        that of x is G S^-1 E S^-1 y. What is not measured is as wrong as rounding of the prior; all of that may decide
        whether P is positive definite.
        """
        kept = np.isfinite(np.diag(R))
        left = np.sqrt(np.maximum(np.diag(self.kf.P), 0.0))  # other bits may have left a variance below nothing
        left[rows[kept]] = 0.0
        used, G, R_used = rows[kept], self.kf.P[:, rows[kept]].copy(), R[np.ix_(kept, kept)]
        summed = self.kf.x * (self._other(self.kf.x.shape) - 1.0)  # x + K y is rounded in units of the prior x
        self.error = summed, self._symmetric(left)
        if kept.any() and innovation_factor(S := G[used] + R_used) is not None:
            finer = np.diag(R_used) < np.diag(G[used])
            G[used[finer]] = R_used[finer]
            sigma, Z = np.sqrt(np.diag(S)), np.linalg.solve(S, G.T)
            E = self._symmetric(sigma)
            moved = (Z.T @ E @ np.linalg.solve(S, innovation[kept]))[:, None]
            self.error = summed + moved, self.error[1] + Z.T @ E @ Z
        return super()._correct(innovation, R, rows)

    def _is_sound(self, spread):
        self.kf.x, self.kf.P = self.kf.x + self.error[0], self.kf.P + self.error[1]
        return super()._is_sound(spread)

    def _symmetric(self, sigma):
        """The last bits of a covariance of states of such sigma."""
        change = np.tril(self._other((len(sigma), len(sigma))) - 1.0)
        return (change + np.tril(change, -1).T) * sigma[:, None] * sigma

    def _other(self, shape):
        return 1.0 + LAST_BITS * np.finfo(float).eps / 2 * self.rng.integers(-1, 2, shape)


def diagonal(run):
    return np.einsum("nii->ni", run.covariance)


def strict_limits(scale):
    """(n, 12) of position, velocity and the variances, in sigma; what is stored of a large state is itself rounded."""
    return np.hstack([np.repeat(LIMITS[:2], 3) / scale, np.full(scale.shape, LIMITS[2])])


def apart(run, reference, scale):
    """(n, 12) the differences of state and covariance in sigma, as far as both go; the largest of each row of P."""
    n = min(len(run.index), len(reference.index))
    both = [np.hstack([each.position_m, each.velocity_mps])[:n] for each in (run, reference)]
    P = np.abs(run.covariance[:n] - reference.covariance[:n]) / (scale[:n, :, None] * scale[:n, None, :])
    return np.hstack([np.abs(both[0] - both[1]) / scale[:n], P.max(axis=2)])


def shared_by_axes(spread):
    """The largest of east, north and up: what cancels is whole units in the last place, and may be none by luck."""
    return np.repeat(spread.reshape(-1, 4, 3).max(axis=2), 3, axis=1)


def padded(difference, length):
    """Beyond its end a run differs by more than anything."""
    return np.vstack([difference, np.full((length - len(difference), 12), np.inf)])
