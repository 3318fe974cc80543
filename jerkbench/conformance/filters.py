"""The checks of kinematic filters, of estimators and of engines."""

import numpy as np

from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.arrays import FloatArray
from jerkbench.conformance.requirements import (
    Plugin,
    pure_result,
    require_covariance,
    require_finite,
    require_methods,
    require_shape,
    require_that,
)
from jerkbench.conformance.samples import small_recording, small_timeline, true_attitude
from jerkbench.contracts import Adaptation, Batched, Estimator, Filter
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.estimate import Attitude, Estimate
from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.sums import scored, sums_from, sums_of
from jerkbench.filters.kinematic import Jerk
from jerkbench.plugins import create
from jerkbench.recording import Recording
from jerkbench.sums import RecordedRun
from jerkbench.timeline import build_timeline

# The check of an estimator's compiled way: it agrees with its `estimate`.

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
    require_that(
        np.array_equal(got.index, wanted.index), f"{subject} reaches other rows of the reference than estimate()."
    )
    for name in ("position_m", "velocity_mps"):
        apart = np.abs(getattr(got, name) - getattr(wanted, name)).max()
        require_that(
            apart <= AGREEMENT_M, f"{name} of {subject} is {apart:.3g} off estimate(); {AGREEMENT_M:g} is allowed."
        )
    sigma = np.sqrt(np.einsum("nii->ni", wanted.covariance))
    apart = np.abs((got.covariance - wanted.covariance) / (sigma[:, :, None] * sigma[:, None, :])).max()
    require_that(apart <= AGREEMENT, f"covariance of {subject} is {apart:.3g} of itself off estimate().")


def _check_sums(
    subject: str, plugin: Batched, recording: Recording, attitude: Attitude, adaptation: Adaptation, wanted: Estimate
) -> None:
    timeline = build_timeline(recording, attitude)
    scene = scored(recording, timeline, BURN_IN_S)
    if scene is None:
        return
    subject = f"{subject}.run_settings()"
    run = RecordedRun(recording, attitude, timeline, scene.scoring)
    expected = sums_of(wanted, recording, counted_rows(wanted, recording, BURN_IN_S))
    settings = [plugin, plugin], [adaptation, adaptation]
    results = plugin.run_settings([run, run], *settings, updates=False, attitude=False, threads=1)
    require_that(len(results) == 2, f"{subject} gives {len(results)} results for 2 runs.")
    for got in (sums_from(result, scene, recording) for result in results if result is not None):
        for name in ("position_m2", "velocity_m2ps2", "nees", "nis_per_row"):
            near = np.allclose(getattr(got, name), getattr(expected, name), rtol=AGREEMENT, atol=AGREEMENT_M**2)
            require_that(near, f"{name} of {subject} is not that of estimate().")


INTERVALS_S = ((0.01, 0.01), (0.01 / 3.0, 0.01), (0.004, 0.004), (0.02, 0.02))
"""Pairs of dt and dt0: whole samples and a split one."""

INSTANT_S = 1e-9


def check_filter(plugin: Plugin) -> None:
    """Check a plugin of the kind filter: a kinematic filter, or an estimator.

    Raises:
        AssertionError: it is neither; a model with wrong shapes, a Q that is no covariance, position that does not
            follow velocity, or a run over a small recording that fails.
    """
    subject = type(plugin).__name__
    require_methods("filter", plugin)
    if isinstance(plugin, Filter):
        n = require_initial_variances(subject, plugin)
        require_covariance(f"{subject}.initial_variances()", np.diag(plugin.initial_variances()))
        for dt, dt0 in INTERVALS_S:
            _check_model(f"{subject}.axis_model({dt:g}, {dt0:g})", plugin, n, dt, dt0)
        _check_instant(plugin, n)
        check_estimate(subject, FilterpyEngine().run(small_timeline()[1], plugin, NoAdaptation()))
    else:
        _check_estimator(plugin)


def require_initial_variances(subject: str, plugin: Filter) -> int:
    """Check that they are a vector; returns the number of states on an axis."""
    variances = pure_result(f"{subject}.initial_variances()", plugin.initial_variances)
    require_shape(f"{subject}.initial_variances()", variances, (np.size(variances),))
    return 2 + len(variances)


def axis_model_of(
    subject: str, plugin: Filter, n: int, dt: float, dt0: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A, b and Q, checked for their shapes, and for being the same the second time."""
    model = pure_result(subject, plugin.axis_model, dt, dt0)
    three = isinstance(model, tuple) and len(model) == 3
    require_that(three, f"{subject} gives a {type(model).__name__}; it must be the three matrices A, b, Q.")
    for name, part, shape in zip("AbQ", model, [(n, n), (n,), (n, n)], strict=True):
        require_shape(f"{name} of {subject}", part, shape)
    A, b, Q = model
    return A, b, Q


def _check_model(subject: str, plugin: Filter, n: int, dt: float, dt0: float) -> None:
    A, b, Q = axis_model_of(subject, plugin, n, dt, dt0)
    for name, part in [("A", A), ("b", b), ("Q", Q)]:
        require_finite(f"{name} of {subject}", part)
    require_covariance(f"Q of {subject}", Q)
    require_that(
        np.allclose(A[0, :2], [1.0, dt], rtol=1e-2, atol=0.0),
        f"A of {subject} begins with {A[0, 0]:.6g}, {A[0, 1]:.6g}; position (the first state) must follow velocity (the"
        f" second): 1, {dt:g}.",
    )


def _check_instant(plugin: Filter, n: int) -> None:
    """A step of a nanosecond must change next to nothing, because measurements split samples anywhere."""
    A, b, Q = plugin.axis_model(INSTANT_S, 0.01)
    _, b0, Q0 = plugin.axis_model(0.01, 0.01)
    unchanged = (
        np.allclose(A, np.eye(n), rtol=0.0, atol=1e-4)
        and (np.abs(b) <= 1e-4 * np.abs(b0)).all()
        and (np.diag(Q) <= 1e-4 * np.diag(Q0)).all()
    )
    require_that(
        unchanged,
        f"{type(plugin).__name__}.axis_model(): a step of a nanosecond still moves or blurs the state; A must go to I,"
        " b and Q to 0 with dt, also where dt0 stays.",
    )


def _check_estimator(plugin: Estimator) -> None:
    subject = type(plugin).__name__
    accepted = plugin.adaptations
    require_that(isinstance(accepted, tuple), f"{subject}.adaptations is {accepted!r}; it must be a tuple of names.")
    require_that(accepted, f"{subject}.adaptations is empty; it must name at least one adaptation, none for instance.")
    recording = small_recording()
    attitude = true_attitude(recording)
    adaptation = create("adaptation", {"name": accepted[0]})
    estimate = pure_result(f"{subject}.estimate()", plugin.estimate, recording, attitude, adaptation)
    check_estimate(subject, estimate)
    renamed = "has run_many(); it is run_settings(runs, estimators, adaptations, ...) now."
    require_that(not hasattr(plugin, "run_many"), f"{subject} {renamed}")
    if isinstance(plugin, Batched):
        check_batched(subject, plugin, recording, attitude, adaptation, estimate)


def check_estimate(subject: str, estimate: Estimate) -> None:
    """Check the shapes of an estimate, that it got to the end, and that its covariances are such."""
    require_that(not estimate.failure, f"{subject} fails on a small recording: {estimate.failure}.")
    k = len(estimate.index)
    require_that(k > 0, f"{subject} estimates nothing on a small recording.")
    require_that((np.diff(estimate.index) > 0).all(), f"{subject}: the rows of the reference in index do not increase.")
    for name in ("position_m", "velocity_mps", "euler_rad"):
        values: FloatArray = getattr(estimate, name)
        require_shape(f"{subject}: {name}", values, (k, 3))
        if name == "euler_rad" or not estimate.attitude_only:
            require_finite(f"{subject}: {name}", values)
    require_shape(f"{subject}: covariance", estimate.covariance, (k, 6, 6))
    if estimate.attitude_only:
        return
    for P in estimate.covariance[:: max(k // 50, 1)]:
        require_covariance(f"{subject}: covariance", P)


# The check of an engine: agreement with the reference engine.

ENGINE_AGREEMENT_M = 1e-6


def check_engine(plugin: Plugin) -> None:
    """Check an engine: a run of the jerk filter with mtf agrees with the reference engine.

    Raises:
        AssertionError: it does not.
    """
    subject = type(plugin).__name__
    require_methods("engine", plugin)
    _, timeline = small_timeline()
    estimate = pure_result(f"{subject}.run()", plugin.run, timeline, Jerk(), Mtf())
    check_estimate(subject, estimate)
    wanted = FilterpyEngine().run(timeline, Jerk(), Mtf())
    require_that(
        np.array_equal(estimate.index, wanted.index), f"{subject} reaches other rows than the reference engine."
    )
    difference = max(
        np.abs(estimate.position_m - wanted.position_m).max(), np.abs(estimate.velocity_mps - wanted.velocity_mps).max()
    )
    require_that(
        difference <= ENGINE_AGREEMENT_M,
        f"{subject} is {difference:.3g} m (or m/s) off the reference engine; {ENGINE_AGREEMENT_M:g} is allowed.",
    )
