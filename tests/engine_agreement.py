"""The agreement of two engines over a whole run, and its limit, where rounding alone decides.

The limits are 1e-9 m, 1e-9 m/s, and 1e-12 of sqrt(P_ii P_jj): absolute figures would say nothing of a covariance whose
entries lie between 1e-6 and 1e+3. Two things can take a correct engine beyond them:

- A run may amplify rounding: `scalar_q` multiplies P by up to a thousand and the next update takes it all away, and
  the fixed point of `cerkf_r` is steep where a row is about to lose its weight. Then the limit is what the reference
  engine itself does when its measurements and R change in their last bits. It must stay below CAP.
- A threshold may flip. Then the first update that the two decide differently is looked for, and the reference must
  decide it in both ways when its last bits change: its variable lies within rounding of the threshold. What comes
  after that update is not compared.
"""

import sys
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.evaluated_run import prepare_reference, sums_from, sums_of
from jerkbench.timeline import RecordedRun, build_timeline

LIMITS = np.array([1e-9, 1e-9, 1e-12])
"""Of position [m], velocity [m/s] and the scaled covariance [-]."""

CAP = np.array([1e-7, 1e-7, 1e-6])
"""The same for a run that amplifies rounding."""

FACTOR = 5.0
"""How much more than the changed reference the other engine may differ: it rounds in every operation, not once."""

LAST_BITS = 4
"""Measurements and R change by up to this many units in the last place."""


class Agreement(NamedTuple):
    """How far two runs agree.

    Attributes:
        flip: index of the first update that is decided differently, or None.
        amplified: whether rounding was amplified beyond LIMITS.
    """

    flip: int | None
    amplified: bool


def agree(timeline, model, adaptation, compiled=None):
    """Assert that ``compiled`` (run here, unless it is given) is the run of the reference engine."""
    reference = FilterpyEngine().run(timeline, model, adaptation)
    compiled = CompiledEngine().run(timeline, model, adaptation) if compiled is None else compiled

    @cache
    def changed(seed):
        return FilterpyEngine().run(with_other_last_bits(timeline, seed), model, adaptation)

    return agree_runs(timeline, compiled, reference, changed)


def agree_runs(timeline, compiled, reference, changed):
    """The same for two runs; ``changed`` gives the reference after a change of its last bits, for each seed."""
    flip = first_flip(compiled, reference)
    if flip is not None:
        show_that_rounding_decides(flip, compiled, reference, (changed(seed) for seed in range(12)))
    else:
        assert compiled.failure == reference.failure
        np.testing.assert_array_equal(compiled.index, reference.index)
    end = states_before(timeline, reference, flip)
    amplified = compare_states(compiled, reference, end, (cut(timeline, changed(seed), reference) for seed in range(3)))
    compare_updates(compiled.updates, reference.updates, flip)
    return Agreement(flip, amplified)


def with_a_negative_variance(timeline, row):
    """Make the R of a measurement one that no filter comes through."""
    R = np.array(timeline.measurements.R)
    R[row] *= -0.1
    return replace(timeline, measurements=replace(timeline.measurements, R=R, R_true=R))


def assert_same_until_it_stops(got, wanted):
    """Assert that two runs stop at the same step, and that their states up to there agree."""
    assert wanted.failure
    assert got.failure == wanted.failure
    assert len(wanted.index) > 200
    assert len(got.updates.nis) == len(wanted.updates.nis)
    np.testing.assert_array_equal(got.index, wanted.index)
    np.testing.assert_allclose(got.position_m, wanted.position_m, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(got.covariance, wanted.covariance, rtol=0.0, atol=1e-12)


def with_other_last_bits(timeline, seed):
    """Change each measurement and each variance by a few units in the last place, R still symmetric."""
    rng = np.random.default_rng(seed)
    given = timeline.measurements

    def other(array):
        return 1.0 + LAST_BITS * np.finfo(float).eps / 2 * rng.integers(-1, 2, array.shape)

    factor = np.tril(other(given.R))
    factor += np.tril(factor, -1).transpose(0, 2, 1)
    measurements = replace(given, z=given.z * other(given.z), R=given.R * factor, R_true=given.R_true * factor)
    return replace(timeline, measurements=measurements)


def first_flip(run, reference):
    """Return the index of the first update whose R or fade was decided differently, or None."""
    n = min(len(run.updates.t_s), len(reference.updates.t_s))
    differs = np.flatnonzero([not same_decision(run, reference, k) for k in range(n)])
    return int(differs[0]) if differs.size else None


def same_decision(run, reference, k):
    """Whether update ``k`` used the same R, and the same prior as far as the NIS shows it."""
    decided = [np.append(estimate.updates.R_diagonal[k], estimate.updates.nis_used[k]) for estimate in (run, reference)]
    return np.allclose(*decided, rtol=1e-6, atol=1e-9, equal_nan=True)


def show_that_rounding_decides(flip, compiled, reference, changed):
    """Find a change of the last bits with which the reference decides as ``compiled`` does."""
    t_s = reference.updates.t_s[flip]
    found = any(same_decision(run, compiled, flip) for run in changed)
    assert found, f"update {flip} at {t_s:.3f} s is decided differently, and rounding does not explain it"
    sys.stdout.write(
        f"update {flip} at {t_s:.3f} s lies within rounding of a threshold; nothing after it is compared\n"
    )


def compare_states(compiled, reference, end, changed):
    """Compare the first ``end`` states; return whether the limits had to be those of amplified rounding."""
    difference = apart(compiled, reference, end)
    if (difference < LIMITS[:, None]).all():
        return False
    limits = np.maximum(LIMITS[:, None], FACTOR * amplified_rounding(reference, end, changed))
    assert (limits.max(axis=1) < CAP).all(), f"rounding grows to {limits.max(axis=1)}: nothing can be compared"
    assert (difference < limits).all(), f"{(difference / limits).max(axis=1)} times what amplified rounding explains"
    return True


def cut(timeline, run, reference):
    """Return ``run`` and how many of its states come before a flip of its own."""
    return run, states_before(timeline, reference, first_flip(run, reference))


def states_before(timeline, reference, flip):
    """Return how many states are there before update ``flip``."""
    if flip is None:
        return len(reference.index)
    # A state at the time of the update is one after it.
    t_s = timeline.t_s[timeline.reference >= 0][: len(reference.index)]
    return int(np.searchsorted(t_s, reference.updates.t_s[flip] - 1e-7))


def apart(run, reference, end):
    """Return (3, end) the largest difference of position, velocity and scaled covariance at each stamp."""
    sigma = np.sqrt(np.einsum("nii->ni", reference.covariance))
    scaled = (run.covariance[:end] - reference.covariance[:end]) / (sigma[:, :, None] * sigma[:, None, :])[:end]
    position, velocity = (getattr(run, n)[:end] - getattr(reference, n)[:end] for n in ("position_m", "velocity_mps"))
    return np.array([np.abs(difference).reshape(end, -1).max(axis=1) for difference in (position, velocity, scaled)])


def amplified_rounding(reference, end, changed):
    """Return (3, end) how far the changed runs have been from the reference up to each stamp."""
    largest = np.zeros((3, end))
    for run, its_end in changed:
        before = min(end, its_end)
        largest[:, :before] = np.maximum(largest[:, :before], apart(run, reference, before))
    return np.maximum.accumulate(largest, axis=1)


def compare_updates(got, wanted, flip):
    """Compare what the updates before the flip saw."""
    for name in ("t_s", "rows", "nis", "nis_used", "innovation", "R_diagonal"):
        pair = getattr(got, name)[:flip], getattr(wanted, name)[:flip]
        np.testing.assert_allclose(*pair, rtol=1e-7, atol=1e-9, err_msg=name)


def assert_same_sums(got, wanted):
    """To a relative 1e-8; covariances between axes beside the largest variance, as they may be next to 0."""
    for name in wanted._fields:
        scale = np.abs(wanted.sampled_m2).max(initial=0.0) if name == "sampled_m2" else 0.0
        values = getattr(got, name), getattr(wanted, name)
        np.testing.assert_allclose(*values, rtol=1e-8, atol=1e-12 * scale, err_msg=name)


def assert_batch_agrees(models, recording, attitude, adaptation, burn_in_s=2.0):
    """Compare the sums and the updates of a batch with those of the trajectories of `estimate`."""
    timeline = build_timeline(recording, attitude)
    scene = prepare_reference(recording, timeline, burn_in_s)
    runs = [RecordedRun(recording, attitude, timeline, scene.scoring)] * len(models)
    rules = [adaptation] * len(models)
    results = models[0].run_settings(runs, models, rules, updates=True, attitude=True, threads=2)
    for model, result in zip(models, results, strict=True):
        estimate = model.estimate(recording, attitude, adaptation)
        wanted = sums_of(estimate, recording, counted_rows(estimate, recording, burn_in_s))
        assert_same_sums(sums_from(result, scene, recording), wanted)
        np.testing.assert_allclose(result.updates.nis_used, estimate.updates.nis_used, rtol=1e-7)
