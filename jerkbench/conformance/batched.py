"""The check of an estimator's compiled way: it agrees with its `estimate`."""

from collections.abc import Sequence

import numpy as np

from jerkbench.conformance.require import require
from jerkbench.contracts import Adaptation, Batched
from jerkbench.estimate import Attitude, Estimate
from jerkbench.evaluation.batch_scoring import scored
from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.sums import Scored, sums_from, sums_of
from jerkbench.recording import Recording
from jerkbench.streamed_run import RecordedRun, Streamed
from jerkbench.sums import Sums
from jerkbench.timeline.timeline import build_timeline

AGREEMENT_M = 1e-6
"""Of position and velocity."""

AGREEMENT = 1e-6
"""Of the covariance against sqrt(P_ii P_jj), and of sums."""

BURN_IN_S = 0.5


def check_batched(
    subject: str, plugin: Batched, recording: Recording, attitude: Attitude, adaptation: Adaptation, wanted: Estimate
) -> None:
    """Check that the compiled way gives ``wanted``, with and without a trajectory.

    Raises:
        AssertionError: it does not; None, which says that it is not possible, is allowed.
    """
    got = plugin.estimate_compiled(recording, attitude, adaptation)
    if got is not None:
        _check_estimate(f"{subject}.estimate_compiled()", got, wanted)
    _check_sums(subject, plugin, recording, attitude, adaptation, wanted)


def _check_estimate(subject: str, got: Estimate, wanted: Estimate) -> None:
    require(np.array_equal(got.index, wanted.index), f"{subject} reaches other rows of the reference than estimate().")
    for name in ("position_m", "velocity_mps"):
        apart = np.abs(getattr(got, name) - getattr(wanted, name)).max()
        require(apart <= AGREEMENT_M, f"{name} of {subject} is {apart:.3g} off estimate(); {AGREEMENT_M:g} is allowed.")
    sigma = np.sqrt(np.einsum("nii->ni", wanted.covariance))
    apart = np.abs((got.covariance - wanted.covariance) / (sigma[:, :, None] * sigma[:, None, :])).max()
    require(apart <= AGREEMENT, f"covariance of {subject} is {apart:.3g} of itself off estimate().")


def _check_sums(
    subject: str, plugin: Batched, recording: Recording, attitude: Attitude, adaptation: Adaptation, wanted: Estimate
) -> None:
    timeline = build_timeline(recording, attitude)
    scene = scored(recording, timeline, BURN_IN_S)
    if scene is None:
        return
    run = RecordedRun(recording, attitude, timeline, scene.scoring)
    expected = sums_of(wanted, recording, counted_rows(wanted, recording, BURN_IN_S))
    settings = [plugin, plugin], [adaptation, adaptation]
    results = plugin.run_settings([run, run], *settings, updates=False, attitude=False, threads=1)
    _compare(f"{subject}.run_settings()", results, scene, recording, expected)


def _compare(
    subject: str, results: Sequence[Streamed | None], scene: Scored, recording: Recording, expected: Sums
) -> None:
    require(len(results) == 2, f"{subject} gives {len(results)} results for 2 runs.")
    for result in results:
        got = None if result is None else sums_from(result, scene, recording)
        for name in ("position_m2", "velocity_m2ps2", "nees", "nis_per_row") if got is not None else ():
            near = np.allclose(getattr(got, name), getattr(expected, name), rtol=AGREEMENT, atol=AGREEMENT_M**2)
            require(near, f"{name} of {subject} is not that of estimate().")
