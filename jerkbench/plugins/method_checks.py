"""The checks of filters, of engines and of adaptations."""

import copy
from typing import Any

import numpy as np

from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.arrays import FloatArray
from jerkbench.contracts import (
    Adaptation,
    AdaptingGain,
    AdaptingPrior,
    Batched,
    Estimator,
    Fading,
    Filter,
)
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.estimate import Attitude, Estimate
from jerkbench.evaluation.counted_rows import counted_rows, largest_norm, position_error_m
from jerkbench.evaluation.evaluated_run import prepare_reference, run_status, sums_from, sums_of, why_strayed
from jerkbench.filters.kinematic import Jerk
from jerkbench.plugins import create
from jerkbench.plugins.optional import changes_nothing, empty_memory
from jerkbench.plugins.requirements import (
    ROWS,
    TRIED_SIGMAS,
    TRIED_STATES,
    Plugin,
    Prior,
    Update,
    every_kind,
    identical,
    ordinary,
    pure_result,
    require_covariance,
    require_finite,
    require_methods,
    require_shape,
    require_that,
    small_recording,
    small_timeline,
    true_attitude,
)
from jerkbench.random_streams import stream
from jerkbench.recording import Recording
from jerkbench.sums import RecordedRun
from jerkbench.timeline import build_timeline

# The check of an estimator's compiled way: it agrees with its `estimate`.

AGREEMENT_M = 1e-6
"""Of position and velocity."""

AGREEMENT = 1e-6
"""Of the covariance against sqrt(P_ii P_jj), and of sums."""

BURN_IN_S = 0.5


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
    limit_m = 0.5 * largest_norm(position_error_m(wanted, recording))
    scene = prepare_reference(recording, timeline, BURN_IN_S, limit_m)
    if scene is None:
        return
    subject = f"{subject}.run_settings()"
    run = RecordedRun(recording, attitude, timeline, scene.scoring)
    expected = sums_of(wanted, recording, counted_rows(wanted, recording, BURN_IN_S))
    settings = [plugin, plugin], [adaptation, adaptation]
    results = plugin.run_settings([run, run], *settings, updates=False, attitude=False, threads=1)
    require_that(len(results) == 2, f"{subject} gives {len(results)} results for 2 runs.")
    for result in filter(None, results):
        got, reason = sums_from(result, scene, recording), why_strayed(result, scene, recording)
        for name in ("position_m2", "velocity_m2ps2", "nees", "nis_per_row"):
            near = np.allclose(getattr(got, name), getattr(expected, name), rtol=AGREEMENT, atol=AGREEMENT_M**2)
            require_that(near, f"{name} of {subject} is not that of estimate().")
        said = reason == run_status(wanted, recording, limit_m)[1]
        require_that(said, f"{subject} says of a run that strays: '{reason}'.")


INTERVALS_S = ((0.01, 0.01), (0.01 / 3.0, 0.01), (0.004, 0.004), (0.02, 0.02))
"""Pairs of dt and dt0: whole samples and a split one."""

INSTANT_S = 1e-9


def check_filter(plugin: Plugin) -> None:
    """Check a plugin of the kind filter: a kinematic filter, or an estimator.

    Raises:
        AssertionError: it is neither; a model with wrong shapes, a Q that is no covariance, position that does not
            follow velocity, or a run over a small recording that fails.
    """
    subject = require_methods("filter", plugin)
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
    if isinstance(plugin, Batched):  # None says that it is not possible
        if (got := plugin.estimate_compiled(recording, attitude, adaptation)) is not None:
            _check_estimate(f"{subject}.estimate_compiled()", got, estimate)
        _check_sums(subject, plugin, recording, attitude, adaptation, estimate)


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
    subject = require_methods("engine", plugin)
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


# The check of an adaptation.


def check_adaptation(plugin: Plugin) -> None:
    """Check an adaptation over updates of all kinds: rows that come and go, outliers, a tiny and a huge R.

    Raises:
        AssertionError: it changes its inputs, keeps anything outside its memory, returns something that is no
            covariance, or leaves NaN in the memory.
    """
    subject = require_methods("adaptation", plugin)
    size = _memory_size(subject, plugin)
    updates = list(every_kind())
    _require_same(subject, _run(plugin, updates, size), _run(plugin, updates, size))


def _memory_size(subject: str, plugin: Plugin) -> int:
    name, size = "memory_size()", 0
    if hasattr(plugin, "memory_size_of"):
        name, size = f"memory_size_of({TRIED_STATES})", plugin.memory_size_of(TRIED_STATES)
    elif hasattr(plugin, "memory_size"):
        size = plugin.memory_size()
    require_that(isinstance(size, int), f"{subject}.{name} is {size!r}; it must be an integer.")
    require_that(size >= 0, f"{subject}.{name} is {size}; it must not be negative.")
    return size


def probe_adaptation(plugin: Plugin) -> None:
    """Check the same over a few ordinary updates: inputs, memory, shapes and NaN, no other number.

    Raises:
        AssertionError: it changes its inputs, keeps anything outside its memory, or returns a wrong shape or NaN.
    """
    random = stream(0, "conformance", "probe")
    updates = [ordinary(random, rows, sigma) for sigma in TRIED_SIGMAS for rows in (*ROWS[:3], ROWS[0])]
    first, second = (_run(plugin, updates, len(empty_memory(plugin, TRIED_STATES)), thorough=False) for _ in range(2))
    _require_same(type(plugin).__name__, first, second)


def _require_same(subject: str, first: list[Any], second: list[Any]) -> None:
    require_that(
        identical(first, second),
        f"{subject} gives another result in a second run with the same updates; its state must stand in memory.",
    )


def _run(plugin: Plugin, updates: list[tuple[Update, Prior]], size: int, *, thorough: bool = True) -> list[Any]:
    """All that it says in a run, checked."""
    memory, results = np.zeros(size), []
    for update, prior in updates:
        factor = _faded(plugin, update, memory)
        P = _adapted_prior(plugin, prior._replace(P=prior.P * factor), update, memory, thorough=thorough)
        seen = update._replace(HPHt=P[np.ix_(update.rows, update.rows)])
        R = _adapted(plugin, seen, memory, thorough=thorough)
        gain = _adapted_gain(plugin, prior._replace(P=P), update._replace(R=R), memory)
        if changes_nothing(plugin):
            same = factor == 1.0 and np.array_equal(P, prior.P) and np.array_equal(R, seen.R) and not gain.size
            require_that(same, f"{type(plugin).__name__} says changes_nothing, and changes R, P or the gain.")
        results.append((factor, P.copy(), R.copy(), gain.copy()))
        if thorough:
            require_finite(f"the memory of {type(plugin).__name__}", memory)
    return results


def _faded(plugin: Plugin, update: Update, memory: FloatArray) -> float:
    if not isinstance(plugin, Fading):
        return 1.0
    subject = f"{type(plugin).__name__}.fade()"
    factor = float(_untouched(subject, plugin.fade, update._asdict(), memory))
    require_that(np.isfinite(factor), f"{subject} is {factor}; the factor on the prior covariance must be finite.")
    require_that(factor > 0, f"{subject} is {factor}; the factor on the prior covariance must be positive.")
    return factor


def _adapted_prior(plugin: Plugin, prior: Prior, update: Update, memory: FloatArray, *, thorough: bool) -> FloatArray:
    if not isinstance(plugin, AdaptingPrior):
        return prior.P
    subject = f"{type(plugin).__name__}.adapt_prior()"
    P: FloatArray = _untouched(subject, plugin.adapt_prior, {**prior._asdict(), **_measured(update)}, memory)
    require_shape(subject, P, (TRIED_STATES, TRIED_STATES))
    if thorough:
        require_covariance(subject, P)
    return P


def _adapted_gain(plugin: Plugin, prior: Prior, update: Update, memory: FloatArray) -> FloatArray:
    kept = np.isfinite(np.diag(update.R))
    if not (isinstance(plugin, AdaptingGain) and kept.any()):
        return np.zeros(0)
    subject = f"{type(plugin).__name__}.adapt_gain()"
    few = Update(update.innovation[kept], update.HPHt, update.R[np.ix_(kept, kept)], update.rows[kept])
    K: FloatArray = _untouched(subject, plugin.adapt_gain, {"x": prior.x, "P": prior.P, **_measured(few)}, memory)
    require_shape(subject, K, (TRIED_STATES, int(kept.sum())))
    require_finite(subject, K)
    return K


def _measured(update: Update) -> dict[str, Any]:
    return {"innovation": update.innovation, "R": update.R, "rows": update.rows}


def _adapted(plugin: Plugin, update: Update, memory: FloatArray, *, thorough: bool) -> FloatArray:
    subject = f"{type(plugin).__name__}.adapt()"
    m = len(update.rows)
    adapted: FloatArray = _untouched(subject, plugin.adapt, update._asdict(), memory)
    require_shape(subject, adapted, (m, m))
    require_that(not np.isnan(np.diag(adapted)).any(), f"{subject} has NaN as a variance; infinity drops a row.")
    if not thorough:
        return adapted
    kept = np.diag(adapted) != np.inf
    require_covariance(subject, adapted[np.ix_(kept, kept)])
    return adapted


def _untouched(subject: str, method: Any, inputs: dict[str, Any], memory: FloatArray) -> Any:  # noqa: ANN401 - as above
    before = copy.deepcopy(inputs)
    result = method(*inputs.values(), memory)
    for name, array in inputs.items():
        require_that(identical(before[name], array), f"{subject} changes {name} in place; it must work on a copy.")
    return result
