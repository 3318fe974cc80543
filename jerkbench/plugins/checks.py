"""Checks of plugins: checks of the class, which are the same for all kinds, and checks of the methods of each kind.

A thorough check (`jerkbench check`, `jerkbench.testing`) calls the methods of a plugin with all samples of
`jerkbench.plugins.samples`. The check before a run (`complaint`) uses the same functions with shorter samples. The
check before a run takes some hundredths of a second, and finds only faults with which a run would give plausible but
wrong results.
"""

import copy
import dataclasses
import inspect
import pickle
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np

from jerkbench.arrays import FloatArray, identical
from jerkbench.contracts import (
    Adaptation,
    AdaptingGain,
    AdaptingPrior,
    Estimator,
    Fading,
    Filter,
    Summarising,
    changes_nothing,
    empty_memory,
    is_attitude_only,
)
from jerkbench.errors import require_known
from jerkbench.estimate import Attitude, Estimate
from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.evaluated_run import sums_of
from jerkbench.geometry import dcm_from_euler
from jerkbench.parameters import provenance_of, range_problems
from jerkbench.plugins import create, is_builtin, missing_member, samples
from jerkbench.recording import Recording
from jerkbench.timeline import Timeline

Plugin = Any
"""A plugin of any kind."""
T = TypeVar("T")


class Unfit(AssertionError):  # noqa: N818 - pytest prints the message of an assertion in the clearest form
    """Raised if a plugin does not satisfy its contract. Other assertion errors come from the code of the plugin."""


def require_that(ok: object, message: str) -> None:
    """Raise `Unfit` if ``ok`` is false. Unlike `assert`, this function also works with ``python -O``."""
    if not ok:
        raise Unfit(message)


def pure_result(kind: type[T], subject: str, call: Callable[..., Any], *arguments: Any) -> T:  # noqa: ANN401 - as above
    """Call a function twice, check the type of its result, repeatability and side effects, and return the result."""
    before, random = copy.deepcopy(arguments), pickle.dumps(np.random.get_state())  # noqa: NPY002 - only compared
    first, second = call(*arguments), call(*arguments)
    require_that(identical(before, arguments), f"{subject} changes its input in place; it must work on a copy.")
    require_that(identical(first, second), f"{subject} gives another result the second time with the same input.")
    same = random == pickle.dumps(np.random.get_state())  # noqa: NPY002 - only compared
    require_that(same, f"{subject} draws from NumPy's global random numbers; use jerkbench.random_streams.stream.")
    right, wrong = kind.__name__, type(first).__name__
    require_that(isinstance(first, kind), f"{subject} returns the type {wrong}; it must be {right}.")
    return first  # type: ignore[no-any-return]  # checked in the line above


def require_array(subject: str, array: Any, shape: tuple[int, ...], *, finite: bool = True) -> None:  # noqa: ANN401
    """Raise `Unfit` if ``array`` is not a float64 array of this shape, or is not finite although ``finite`` is set."""
    require_that(isinstance(array, np.ndarray), f"{subject} is a {type(array).__name__}; it must be a NumPy array.")
    require_that(array.dtype == np.float64, f"{subject} has the type {array.dtype}; it must be float64.")
    require_that(array.shape == shape, f"{subject} has shape {array.shape}; it must be {shape}.")
    require_that(not finite or np.isfinite(array).all(), f"{subject} holds NaN or infinity.")


def require_covariance(subject: str, matrix: FloatArray) -> None:
    """Raise `Unfit` if ``matrix`` is not finite, symmetric and positive semidefinite."""
    require_array(subject, matrix, (len(matrix), len(matrix)))
    variances, tolerance = np.diag(matrix), 1e-8  # tolerance for a matrix that is scaled to a unit diagonal
    require_that((variances >= 0).all(), f"{subject} has a negative variance, {variances.min(initial=0.0):.3g}.")
    sigma = np.sqrt(np.where(variances > 0, variances, 1.0))
    scaled = matrix / np.outer(sigma, sigma)
    require_that(np.abs(scaled - scaled.T).max(initial=0.0) <= tolerance, f"{subject} is not symmetric.")
    lowest = np.linalg.eigvalsh(scaled).min(initial=0.0)
    semidefinite = lowest >= -tolerance * len(matrix)
    require_that(semidefinite, f"{subject} is not positive semidefinite (eigenvalue {lowest:.3g}).")


def require_members(kind: str, plugin: Plugin) -> str:
    """Return the name of the class of ``plugin``. Raise `Unfit` if the class lacks a member that its kind requires."""
    message = missing_member(kind, plugin)
    require_that(not message, message)
    return type(plugin).__name__


def _builtin(kind: str, name: str) -> Plugin:
    return create(kind, {"name": name})


def _reference_run(timeline: Timeline, model: Filter, adaptation: Adaptation | None = None) -> Estimate:
    run = _builtin("engine", "filterpy").run
    return run(timeline, model, adaptation or _builtin("adaptation", "none"))  # type: ignore[no-any-return]  # a contract


# The checks of the class are the same for all kinds of plugins.


def class_problems(kind: str, plugin: Plugin) -> Iterator[str]:
    """Yield a message for each problem of a plugin class.

    The class must be a frozen, documented, hashable and picklable dataclass with valid ranges and a valid provenance.
    """
    cls = type(plugin)
    if not (dataclasses.is_dataclass(cls) and cls.__dataclass_params__.frozen):  # type: ignore[attr-defined]  # private to dataclasses
        yield f"{cls.__name__} is not a frozen dataclass; write @dataclass(frozen=True) above the class."
        return
    summary = inspect.cleandoc(cls.__doc__ or "").split("\n", 1)[0]
    if not summary.endswith(".") or summary.startswith(f"{cls.__name__}("):  # `dataclass` adds this docstring
        yield f"{cls.__name__} has no docstring whose first line is one sentence; `jerkbench list` prints it."
    documented = "\n".join(inspect.cleandoc(c.__doc__ or "") for c in cls.__mro__ if dataclasses.is_dataclass(c))
    for f in dataclasses.fields(cls):
        if f"{f.name}:" not in documented:
            yield f"{cls.__name__} does not document its parameter {f.name} under Attributes."
    yield from range_problems(cls)
    known = provenance_of(cls)
    if known and known.mistake():
        yield f"The provenance of {cls.__name__} is not valid: {known.mistake()}."
    elif kind in ("filter", "adaptation") and not known and (is_builtin(cls) or "provenance" in vars(cls)):
        message = f'{cls.__name__} has no provenance; write provenance = Provenance("published", "doi:..."),'
        yield f'{message} or "simplified" or "own" with a note.'
    yield from filter(None, [_hash_problem(plugin), _pickle_problem(plugin)])


def _hash_problem(plugin: Plugin) -> str:
    try:
        hash(plugin)
    except TypeError as error:
        return f"{type(plugin).__name__} is not hashable ({error}); a field that is a list must be a tuple."
    return ""


def _pickle_problem(plugin: Plugin) -> str:
    subject = type(plugin).__name__
    try:
        same = pickle.loads(pickle.dumps(plugin)) == plugin  # noqa: S301 - pickled in the same line
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        return f"{subject} cannot be pickled ({error}), so no worker process can run it."
    return "" if same else f"{subject} is different after pickling; a worker process would run something else."


# Data sets and disturbances.


def check_dataset(plugin: Plugin, *, thorough: bool = True) -> None:
    """Check the members of a data set, and if ``thorough`` is set, also its repeatability and its ``seeded``."""
    subject = require_members("dataset", plugin)
    if not thorough:
        return
    first = pure_result(Recording, f"{subject}.load()", plugin.load, 0)
    located = is_attitude_only(plugin) or first.position is not None
    require_that(located, f"{subject}.load() gives no positions; if this is intended, declare attitude_only = True.")
    pure_result(str, f"{subject}.fingerprint()", plugin.fingerprint)
    if identical(first, plugin.load(1)) == plugin.seeded:
        result = "the same recording" if plugin.seeded else "different recordings"
        raise Unfit(f"{subject}.load() returns {result} for seeds 0 and 1, but {subject}.seeded is {plugin.seeded}.")


def check_disturbance(plugin: Plugin, *, thorough: bool = True) -> None:
    """Check that a disturbance is repeatable, has no side effects, and has a correct ``seeded`` and `replicates`."""
    subject, n = require_members("disturbance", plugin), plugin.replicates()
    valid = not thorough or (isinstance(n, int) and n >= 1)
    require_that(valid, f"{subject}.replicates() is {n!r}; it must be an integer, at least 1.")
    recording = samples.small_recording(600.0 if thorough else 60.0)  # the duration allows several bursts or outages
    for seed in (0, 3) if thorough else (0,):
        first = pure_result(Recording, f"{subject}.apply()", plugin.apply, recording, seed)
        same = not thorough or plugin.seeded or identical(first, plugin.apply(recording, seed + n))
        differing = f"gives different results for seeds {seed} and {seed + n}"
        require_that(same, f"{subject}.apply() {differing}, but it is not seeded and has {n} replicates.")


# Attitude filters.

DURATION_S = {True: 24.0, False: 8.0}
"""Duration of the recording for a thorough check (True) and for a short check (False) [s]."""


def check_attitude(plugin: Plugin, *, thorough: bool = True) -> None:
    """Check the estimate of an attitude filter: stamps, shapes, types, and consistent matrices and Euler angles."""
    subject, recording = require_members("attitude", plugin), samples.small_recording(DURATION_S[thorough])
    attitude = pure_result(Attitude, f"{subject}.estimate()", plugin.estimate, recording)
    t_s = recording.inertial.t_s
    require_that(np.array_equal(attitude.t_s, t_s), f"{subject}: t_s must be the stamps of the IMU.")
    for name, shape in {"dcm": (3, 3), "euler_rad": (3,), "accel_enu_mps2": (3,)}.items():
        require_array(f"{subject}: {name}", getattr(attitude, name), (len(t_s), *shape), finite=thorough)
    shape, dtype = np.shape(attitude.triggered), np.asarray(attitude.triggered).dtype
    fits = shape == t_s.shape and (dtype == np.bool_ or not thorough)
    require_that(fits, f"{subject}: triggered has shape {shape} and type {dtype}; it must be {t_s.shape}, bool.")
    if not thorough:
        return
    dcm = attitude.dcm
    rotations = np.allclose(dcm @ dcm.transpose(0, 2, 1), np.eye(3), rtol=0.0, atol=1e-6) and np.linalg.det(dcm) > 0
    require_that(np.all(rotations), f"{subject}: dcm contains matrices that are not rotations.")
    matches = np.allclose(dcm, dcm_from_euler(attitude.euler_rad), rtol=0.0, atol=1e-6)
    require_that(matches, f"{subject}: dcm is not Rz(yaw) Ry(pitch) Rx(roll) of euler_rad (body FLU to ENU).")


# Kinematic filters.

INTERVALS_S = ((0.01, 0.01), (0.01 / 3.0, 0.01), (0.004, 0.004), (0.02, 0.02))
"""Pairs of the step length dt and the sampling interval dt0 [s]: complete samples, and a divided sample."""


def check_filter(plugin: Plugin, *, thorough: bool = True) -> None:
    """Check the model of a kinematic filter, or the estimates of an estimator and of its compiled code."""
    subject = require_members("filter", plugin)
    if not isinstance(plugin, Filter):
        _check_estimator(subject, plugin, thorough=thorough)
        return
    variances = pure_result(np.ndarray, f"{subject}.initial_variances()", plugin.initial_variances)
    require_array(f"{subject}.initial_variances()", variances, (variances.size,), finite=thorough)
    for dt, dt0 in INTERVALS_S if thorough else INTERVALS_S[:2]:
        _check_model(f"{subject}.axis_model({dt:g}, {dt0:g})", plugin, 2 + variances.size, (dt, dt0), thorough=thorough)
    if thorough:
        require_covariance(f"{subject}.initial_variances()", np.diag(variances))
        _check_instant(f"{subject}.axis_model()", plugin)
        _check_estimate(subject, _reference_run(samples.small_timeline()[1], plugin))


def _check_model(subject: str, plugin: Filter, n: int, interval_s: tuple[float, float], *, thorough: bool) -> None:
    model = pure_result(tuple, subject, plugin.axis_model, *interval_s)
    require_that(len(model) == 3, f"{subject} returns {len(model)} matrices; it must be the three A, b, Q.")
    for name, part, shape in zip("AbQ", model, [(n, n), (n,), (n, n)], strict=True):
        require_array(f"{name} of {subject}", part, shape, finite=thorough)
    if thorough:
        A, _, Q = model
        require_covariance(f"Q of {subject}", Q)
        moves = np.allclose(A[0, :2], [1.0, interval_s[0]], rtol=1e-2, atol=0.0)
        start = f"A of {subject} begins with {A[0, 0]:.6g}, {A[0, 1]:.6g}"
        require_that(moves, f"{start}; position must follow velocity, the second state: 1, {interval_s[0]:g}.")


def _check_instant(subject: str, plugin: Filter) -> None:
    """Check that a step of 1 ns hardly changes the state, because measurements may divide samples into short steps."""
    A, b, Q = plugin.axis_model(1e-9, 0.01)
    _, b0, Q0 = plugin.axis_model(0.01, 0.01)
    small = (np.abs(b) <= 1e-4 * np.abs(b0)).all() and (np.diag(Q) <= 1e-4 * np.diag(Q0)).all()
    limits = "with dt, A must approach I, and b and Q must approach 0, also if dt0 is constant"
    still = small and np.allclose(A, np.eye(len(b)), rtol=0.0, atol=1e-4)
    require_that(still, f"{subject}: a step of a nanosecond changes the state or its covariance; {limits}.")


def _check_estimate(subject: str, estimate: Estimate) -> None:
    require_that(not estimate.failure, f"{subject} fails on a small recording: {estimate.failure}.")
    k = len(estimate.index)
    require_that(k > 0, f"{subject} estimates nothing on a small recording.")
    require_that((np.diff(estimate.index) > 0).all(), f"{subject}: the rows of the reference in index do not increase.")
    for name in ("position_m", "velocity_mps", "euler_rad"):
        finite = name == "euler_rad" or not estimate.attitude_only
        require_array(f"{subject}: {name}", getattr(estimate, name), (k, 3), finite=finite)
    require_array(f"{subject}: covariance", estimate.covariance, (k, 6, 6), finite=False)
    for P in () if estimate.attitude_only else estimate.covariance[:: max(k // 50, 1)]:
        require_covariance(f"{subject}: covariance", P)


# Estimators.

AGREEMENT_M, AGREEMENT = 1e-6, 1e-6
"""Tolerance for positions [m] and velocities [m/s], and relative tolerance for sums and for covariances. A difference
of P_ij is relative to sqrt(P_ii P_jj)."""

BURN_IN_S = 0.5


def _check_estimator(subject: str, plugin: Estimator, *, thorough: bool) -> None:
    accepted = plugin.adaptations
    valid = not thorough or (isinstance(accepted, tuple) and accepted)
    require_that(valid, f"{subject}.adaptations is {accepted!r}; it must be a tuple of names, for example ('none',).")
    recording = samples.small_recording(DURATION_S[thorough])
    inputs = recording, samples.true_attitude(recording), _builtin("adaptation", accepted[0])
    estimate = pure_result(Estimate, f"{subject}.estimate()", plugin.estimate, *inputs)
    if thorough:
        _check_estimate(subject, estimate)


def check_agreement(subject: str, got: Estimate, wanted: Estimate, reference: str) -> None:
    """Check that two estimates agree within `AGREEMENT_M` and `AGREEMENT`."""
    require_that(np.array_equal(got.index, wanted.index), f"{subject} reaches other rows than {reference}.")
    for name in ("position_m", "velocity_mps"):
        off = np.abs(getattr(got, name) - getattr(wanted, name)).max()
        require_that(off <= AGREEMENT_M, f"{name} of {subject} is {off:.3g} off {reference}; allowed: {AGREEMENT_M:g}.")
    sigma = np.sqrt(np.einsum("nii->ni", wanted.covariance))
    off = (np.abs(got.covariance - wanted.covariance) / (sigma[:, :, None] * sigma[:, None, :])).max()
    require_that(off <= AGREEMENT, f"covariance of {subject} is {off:.3g} (relative) off {reference}.")


# Engines.


def check_engine(plugin: Plugin, *, thorough: bool = True) -> None:
    """Check that a run of the filter `jerk` with the adaptation `mtf` agrees with the reference engine."""
    subject = require_members("engine", plugin)
    timeline = samples.small_timeline(DURATION_S[thorough])[1]
    inputs = timeline, _builtin("filter", "jerk"), _builtin("adaptation", "mtf")
    estimate = pure_result(Estimate, f"{subject}.run()", plugin.run, *inputs)
    if thorough:
        _check_estimate(subject, estimate)
        check_agreement(subject, estimate, _reference_run(*inputs), "the reference engine")


# Adaptations.


def check_adaptation(plugin: Plugin, *, thorough: bool = True) -> None:
    """Check the inputs, the memory and the results of an adaptation, also for outliers and extreme covariances."""
    subject = require_members("adaptation", plugin)
    updates = list(samples.tried_updates(thorough=thorough))
    first, second = (_run_of(subject, plugin, updates, thorough=thorough) for _ in range(2))
    another = "gives another result in a second run with the same updates"
    require_that(identical(first, second), f"{subject} {another}; its state must be in memory.")


def _run_of(
    subject: str, plugin: Plugin, updates: Sequence[samples.TriedUpdate], *, thorough: bool
) -> list[tuple[Any, ...]]:
    """Call the methods of an adaptation in the order in which an engine calls them, and return the results."""
    memory, results = empty_memory(plugin, samples.TRIED_STATES), list[tuple[Any, ...]]()
    for x, prior, F, Q, innovation, reported, rows in updates:
        measured, factor, P, gain = {"R": reported, "rows": rows}, 1.0, prior, np.zeros(0)
        if isinstance(plugin, Fading):
            inputs = {"innovation": innovation, "HPHt": P[np.ix_(rows, rows)], **measured}
            factor = float(_untouched(f"{subject}.fade()", plugin.fade, inputs, memory))
            require_that(0 < factor < np.inf, f"{subject}.fade() is {factor}; it must be positive and finite.")
            P = P * factor
        if isinstance(plugin, AdaptingPrior):
            inputs = {"x": x, "P": P, "F": F, "Q": Q, "innovation": innovation, **measured}
            P = _untouched(f"{subject}.adapt_prior()", plugin.adapt_prior, inputs, memory)
            require_array(f"{subject}.adapt_prior()", P, prior.shape, finite=thorough)
            if thorough:
                require_covariance(f"{subject}.adapt_prior()", P)
        inputs = {"innovation": innovation, "HPHt": P[np.ix_(rows, rows)], **measured}
        R = _untouched(f"{subject}.adapt()", plugin.adapt, inputs, memory)
        require_array(f"{subject}.adapt()", R, reported.shape, finite=False)
        require_that(not np.isnan(np.diag(R)).any(), f"{subject}.adapt() has NaN as a variance; infinity drops a row.")
        retained = np.diag(R) != np.inf
        few = R[np.ix_(retained, retained)]
        if thorough:
            require_covariance(f"{subject}.adapt()", few)
        if isinstance(plugin, AdaptingGain) and retained.any():
            inputs = {"x": x, "P": P, "innovation": innovation[retained], "R": few, "rows": rows[retained]}
            gain = _untouched(f"{subject}.adapt_gain()", plugin.adapt_gain, inputs, memory)
            require_array(f"{subject}.adapt_gain()", gain, (samples.TRIED_STATES, int(retained.sum())))
        unchanged = np.array_equal(P, prior) and np.array_equal(R, reported) and not gain.size
        honest = unchanged or not changes_nothing(plugin)
        require_that(honest, f"{subject} declares changes_nothing, but changes R, P or the gain.")
        require_array(f"the memory of {subject}", memory, memory.shape, finite=thorough)
        results.append((factor, P.copy(), R.copy(), gain.copy()))
    return results


def _untouched(subject: str, method: Callable[..., Any], inputs: dict[str, Any], memory: FloatArray) -> Any:  # noqa: ANN401 - as above
    before = copy.deepcopy(inputs)
    result = method(*inputs.values(), memory)
    for name, array in inputs.items():
        require_that(identical(before[name], array), f"{subject} changes {name} in place; it must work on a copy.")
    return result


# Metrics.


def check_metric(plugin: Plugin, *, thorough: bool = True) -> None:
    """Check the values of a metric, and its `summarise`, for a small run of which all, few or no rows are scored."""
    subject = require_members("metric", plugin)
    recording, timeline = samples.small_timeline(DURATION_S[thorough])
    estimate = _reference_run(timeline, _builtin("filter", "baseline"))
    evaluate, every, names = plugin.evaluate, np.ones(len(estimate.index), dtype=bool), list[str]()
    for counted in (every, estimate.index > estimate.index[-10], ~every) if thorough else (every,):
        values = pure_result(dict, f"{subject}.evaluate()", evaluate, estimate, recording, counted)
        names = names or list(values)
        require_that(names, f"{subject}.evaluate() returns no value.")
        for name, value in values.items():
            require_that(isinstance(value, float), f"{subject}.evaluate(): {name} is {value!r}; it must be a float.")
        others = f"names {list(values)} if fewer rows are scored, and {names} if all are"
        require_that(list(values) == names, f"{subject}.evaluate() {others}; a value that does not apply must be NaN.")
    if thorough and isinstance(plugin, Summarising):
        scored = counted_rows(estimate, recording, BURN_IN_S)
        wanted, got = evaluate(estimate, recording, scored), plugin.summarise(sums_of(estimate, recording, scored))
        equal = np.allclose(list(got.values()), list(wanted.values()), AGREEMENT, equal_nan=True)
        require_that(list(got) == names and equal, f"{subject}.summarise() returns {got}; evaluate() returns {wanted}.")


# All kinds.

_CHECKS = check_dataset, check_disturbance, check_attitude, check_filter, check_adaptation, check_engine, check_metric
CHECKS: Mapping[str, Callable[..., None]] = {check.__name__.removeprefix("check_"): check for check in _CHECKS}


def check_plugin(kind: str, plugin: Plugin) -> None:
    """Check that ``plugin`` is a frozen, hashable, documented dataclass that satisfies the contract of its ``kind``.

    Raises:
        PluginError: The kind is unknown.
        AssertionError: The check failed. The error message lists all problems of the class, and the first
            problem of its methods.
    """
    require_known("kind of plugin", kind, CHECKS)
    if found := [*class_problems(kind, plugin), *filter(None, [problem(kind, plugin)])]:
        raise Unfit("\n".join(found))


def problem(kind: str, plugin: Plugin, *, thorough: bool = True) -> str:
    """Return the first problem of the methods of ``plugin``, or an empty string. Other exceptions are not caught."""
    try:
        CHECKS[kind](plugin, thorough=thorough)
    except Unfit as error:
        return str(error)
    except dataclasses.FrozenInstanceError as error:
        name = str(error).rpartition(" ")[2].strip("'")
        where = "the state of an adaptation belongs in memory, everything else in local variables"
        return f"{type(plugin).__name__} sets self.{name} while it runs, but a plugin never changes; {where}."
    return ""


def complaint(kind: str, plugin: Hashable) -> str:
    """Return the first problem that the short check before a run finds, or an empty string if it finds no problem."""
    return _hash_problem(plugin) or _complaint(kind, plugin)


@lru_cache(maxsize=1024)
def _complaint(kind: str, plugin: Hashable) -> str:
    try:
        return problem(kind, plugin, thorough=False)
    except Exception:  # noqa: BLE001 - if the run with the user's data raises it again, the run reports it
        return ""
