"""Random timelines: whatever comes, both engines agree, or refuse alike.

JERKBENCH_RANDOM_TIMELINES is how many there are; the default is a share that takes seconds, always the same. 700 of
them, new ones each time, are the whole.

Two runs agree if they differ by less than the limits of `engine_agreement`, or by less than some times what rounding
itself explains: the reference runs again, and after every prediction x and P, and at every update z, change in their
last bits, and x and P after an update in as many more as the condition of S takes from them. That must not be more
than a twentieth of a sigma: where it is, a threshold has flipped or a run has failed by rounding, and nothing after it
is compared.
"""

import os
from collections import Counter

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_compiled_engine import ADAPTATIONS, FILTERS, Damped

from engine_agreement import LIMITS
from jerkbench import plugins
from jerkbench.engines import filterpy_engine
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.kalman import innovation_factor
from jerkbench.timeline.measurements import Measurements
from jerkbench.timeline.timeline import Timeline

SHARE = 3
COUNT = int(os.environ.get("JERKBENCH_RANDOM_TIMELINES", SHARE))
LAST_BITS, CHANGED, FACTOR, LARGEST = 4, 6, 20.0, 0.05
"""Bits [ulp], changed runs, how much more than these the engine may differ, and the most that they may [sigma]."""

LENGTHS_S = st.sampled_from([0.01, 0.01, 0.01, 0.1, 1.0, 100.0, 0.0, 1e-9])
ROWS = st.sampled_from(["both", "both", "position", "velocity", "none", "some"])
STEPS = st.lists(st.tuples(LENGTHS_S, st.booleans(), ROWS, st.sampled_from([1e-3, 1e-2, 1.0, 30.0])), max_size=25)
MODELS = [*(plugins.create("filter", {"name": name}) for name in FILTERS), Damped()]
SEEN = Counter()


@given(steps=STEPS, seed=st.integers(0, 2**32 - 1))
@settings(
    max_examples=COUNT,
    derandomize=COUNT <= SHARE,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    print_blob=True,
)
def test_both_engines_agree_or_refuse_alike(steps, seed):
    timeline = timeline_of(steps, seed)
    for model in MODELS:
        for name in ADAPTATIONS:
            adaptation = plugins.create("adaptation", {"name": name})
            SEEN[compare(timeline, model, adaptation)] += 1


@pytest.fixture(scope="module", autouse=True)
def _counted():
    """Nearly all runs are compared to their end, or the comparison would be empty."""
    yield
    print(dict(SEEN))  # noqa: T201 - pytest -s shows it
    assert SEEN["cut"] < 0.05 * sum(SEEN.values())


def timeline_of(steps, seed):
    """Steps of all lengths; measurements with outliers, full covariances, missing rows and NaN."""
    rng = np.random.default_rng(seed)
    n = len(steps) + 1
    dt_s = np.array([0.0, *(dt for dt, *_ in steps)])
    measured = [(k + 1, rows, sigma) for k, (_, there, rows, sigma) in enumerate(steps) if there]
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
    changed = [ChangedRun(timeline, model, adaptation, joseph=True).with_seed(seed) for seed in range(CHANGED)]
    spread = np.maximum.accumulate(
        np.max([padded(apart(run, reference, scale), len(scale)) for run in changed], axis=0), axis=0
    )
    told = int(np.argmax((spread > LARGEST).any(axis=1))) if (spread > LARGEST).any() else len(scale)
    end = min(told, len(difference))
    allowed = strict_limits(scale) + FACTOR * spread
    assert (difference[:end] <= allowed[:end]).all(), f"{(difference / allowed[: len(difference)])[:end].max()} times"
    same_end = all(run.failure == reference.failure for run in changed)
    if told == len(scale) and same_end:
        assert alike, f"{compiled.failure!r} is not {reference.failure!r}, and rounding does not explain it"
        return "rounded"
    return "cut"


class ChangedRun(filterpy_engine._Run):
    """The reference with other last bits at every step."""

    def with_seed(self, seed):
        """Return what comes out."""
        self.rng = np.random.default_rng(seed)
        return self.to_the_end()

    def _predict(self, dt, u):
        super()._predict(dt, u)
        n = len(self.kf.x)
        factor = np.tril(self._other((n, n)))
        self.kf.P = self.kf.P * (factor + np.tril(factor, -1).T)
        self.kf.x = self.kf.x * self._other((n, 1))

    def _update(self, update):
        self.z, self.condition = self.z.copy(), 1.0
        self.z[update] *= self._other(6)
        failure = super()._update(update)
        n = len(self.kf.x)
        larger = 1.0 + (self._other((n, 1)) - 1.0) * self.condition
        self.kf.x = self.kf.x + (larger - 1.0) * np.sqrt(np.abs(np.diag(self.kf.P)))[:, None]
        self.kf.P = self.kf.P * larger * larger.T
        return failure

    def _correct(self, innovation, R, rows):
        """Note how much of rounding reaches K R, the covariance of what is measured.

        The factors of S are those of S + E, |E_ij| < eps sqrt(S_ii S_jj), and K R = P S^-1 R then errs by K E S^-1 R:
        where R couples a fine row with a coarse one by more than the condition of S alone.
        """
        kept = np.isfinite(np.diag(R))
        used = np.ix_(kept, kept)
        P, R_used = self.kf.P[np.ix_(rows, rows)][used], R[used]
        if kept.any() and innovation_factor(S := P + R_used) is not None:
            sigma, variances = np.sqrt(np.diag(S)), np.diag(R_used)
            left = np.diag(R_used @ np.linalg.solve(S, R_used)) / variances
            coupled = np.sqrt(np.abs(np.diag(P) / variances).max() * np.abs(left).max())
            self.condition = np.linalg.cond(S / (sigma[:, None] * sigma)) * max(1.0, coupled)
        return super()._correct(innovation, R, rows)

    def _is_sound(self, prior, measured):
        """What is not measured is as wrong as rounding of the prior; that may decide whether P is positive definite."""
        sigma, n = np.sqrt(np.diag(prior)), len(prior)
        sigma[measured] = 0.0
        wrong = np.tril((self._other((n, n)) - 1.0) * sigma[:, None] * sigma)
        self.kf.P = self.kf.P + wrong + np.tril(wrong, -1).T
        return super()._is_sound(prior, measured)

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


def padded(difference, length):
    """Beyond its end a run differs by more than anything."""
    return np.vstack([difference, np.full((length - len(difference), 12), np.inf)])
