"""Checks of plugins of each kind, with all samples, or with the few of a first look."""

import dataclasses
import inspect
import pickle
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import FrozenInstanceError
from functools import lru_cache

import numpy as np

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.arrays import BoolArray
from jerkbench.contracts import Filter
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.errors import require_known
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.gnss_only import GnssOnly
from jerkbench.filters.kinematic import Baseline
from jerkbench.geometry import dcm_from_euler
from jerkbench.parameters import is_switch, is_whole, provenance_of, ranges_of
from jerkbench.plugins import create, is_own
from jerkbench.plugins.method_checks import (
    axis_model_of,
    check_adaptation,
    check_engine,
    check_filter,
    probe_adaptation,
    require_initial_variances,
)
from jerkbench.plugins.optional import is_attitude_only
from jerkbench.plugins.requirements import (
    Plugin,
    Unfit,
    changes_itself,
    identical,
    pure_result,
    require_finite,
    require_is,
    require_methods,
    require_shape,
    require_that,
    small_recording,
    small_timeline,
    true_attitude,
)
from jerkbench.recording import Recording

# The checks of a data set and of a disturbance.

LONG_S = 600.0
"""Disturbances put several bursts or outages into a recording; they need room."""


def check_dataset(plugin: Plugin) -> None:
    """Check a data set.

    Raises:
        AssertionError: it loads something that is no recording, is not repeatable, or lies about ``seeded``.
    """
    subject = require_methods("dataset", plugin)
    first = pure_result(f"{subject}.load(0)", plugin.load, 0)
    require_is(Recording, f"{subject}.load()", first)
    require_that(
        is_attitude_only(plugin) or first.position is not None,
        f"{subject}.load() gives no positions; a filter has nothing to start from. If there are none, say so with a"
        " class attribute attitude_only = True.",
    )
    mark = pure_result(f"{subject}.fingerprint()", plugin.fingerprint)
    require_that(isinstance(mark, str), f"{subject}.fingerprint() is {mark!r}; it must be a string.")
    alike = identical(first, plugin.load(1))
    require_that(alike or plugin.seeded, f"{subject}.load() depends on the seed, but its seeded is False.")
    require_that(
        not alike or not plugin.seeded, f"{subject}.load() gives the same for seeds 0 and 1, but its seeded is True."
    )


def check_disturbance(plugin: Plugin) -> None:
    """Check a disturbance on a small recording, with and without its optional parts.

    Raises:
        AssertionError: it returns no recording, changes its input, is not repeatable, or lies about ``seeded`` or
            ``replicates``.
    """
    subject = require_methods("disturbance", plugin)
    n = plugin.replicates()
    require_that(isinstance(n, int), f"{subject}.replicates() is {n!r}; it must be a whole number.")
    require_that(n >= 1, f"{subject}.replicates() is {n}; it must be at least 1.")
    recording = small_recording(LONG_S)
    for seed in (0, 3):
        first = checked_disturbance(subject, plugin, recording, seed)
        if not plugin.seeded:
            require_that(
                identical(first, plugin.apply(recording, seed + n)),
                f"{subject}.apply() gives different results for seeds {seed} and {seed + n}, but it is not seeded and"
                f" has {n} replicates.",
            )


def checked_disturbance(subject: str, plugin: Plugin, recording: Recording, seed: int) -> Recording:
    """Return the disturbed recording, checked for being one, and for being the same the second time."""
    result = pure_result(f"{subject}.apply()", plugin.apply, recording, seed)
    require_is(Recording, f"{subject}.apply()", result)
    return result  # type: ignore[no-any-return]  # it was asked


# The checks of an attitude filter.

_SHAPES = {"dcm": (3, 3), "euler_rad": (3,), "accel_enu_mps2": (3,)}
"""Of the arrays of an attitude, at each stamp."""


def check_attitude(plugin: Plugin) -> None:
    """Check an attitude filter on a small recording.

    Raises:
        AssertionError: stamps, shapes or types are wrong, a matrix is no rotation or does not belong to its angles.
    """
    subject = require_methods("attitude", plugin)
    attitude = checked_attitude(subject, plugin, small_recording())
    for name in _SHAPES:
        require_finite(f"{subject}: {name}", getattr(attitude, name))
    triggered = np.asarray(attitude.triggered)
    require_that(triggered.dtype == np.bool_, f"{subject}: triggered is of {triggered.dtype}; it must be of bool.")
    _check_rotations(subject, attitude)


def checked_attitude(subject: str, plugin: Plugin, recording: Recording) -> Attitude:
    """Return the attitude, checked for stamps and shapes, and for being the same the second time."""
    attitude = pure_result(f"{subject}.estimate()", plugin.estimate, recording)
    require_is(Attitude, f"{subject}.estimate()", attitude)
    n = len(recording.inertial.t_s)
    require_that(np.array_equal(attitude.t_s, recording.inertial.t_s), f"{subject}: t_s must be the stamps of the IMU.")
    for name, shape in _SHAPES.items():
        require_shape(f"{subject}: {name}", getattr(attitude, name), (n, *shape))
    triggered = np.shape(attitude.triggered)
    require_that(triggered == (n,), f"{subject}: triggered has shape {triggered}; it must be ({n},).")
    return attitude  # type: ignore[no-any-return]  # it was asked


def _check_rotations(subject: str, attitude: Attitude) -> None:
    dcm = attitude.dcm
    product = dcm @ dcm.transpose(0, 2, 1)
    proper = np.allclose(product, np.eye(3), rtol=0.0, atol=1e-6) and (np.linalg.det(dcm) > 0).all()
    require_that(proper, f"{subject}: dcm holds matrices that are no rotations.")
    require_that(
        np.allclose(dcm, dcm_from_euler(attitude.euler_rad), rtol=0.0, atol=1e-6),
        f"{subject}: dcm is not Rz(yaw) Ry(pitch) Rx(roll) of euler_rad (roll, pitch, yaw; body FLU to ENU).",
    )


# The checks of a metric.


def check_metric(plugin: Plugin) -> None:
    """Check a metric on a small run: all rows counted, few, none.

    Raises:
        AssertionError: the values are no floats by name, or the names depend on the run.
    """
    subject = require_methods("metric", plugin)
    recording, timeline = small_timeline()
    estimate = FilterpyEngine().run(timeline, Baseline(), NoAdaptation())
    every = np.ones(len(estimate.index), dtype=bool)
    names = list(checked_values(subject, plugin, estimate, recording, every))
    require_that(names, f"{subject}.evaluate() gives no value.")
    for counted in (estimate.index > estimate.index[-10], ~every):
        fewer = list(checked_values(subject, plugin, estimate, recording, counted))
        require_that(
            fewer == names,
            f"{subject}.evaluate() names {fewer} where fewer rows count, and {names} where all do; a value that does"
            " not apply is NaN.",
        )


def checked_values(
    subject: str, plugin: Plugin, estimate: Estimate, recording: Recording, counted: BoolArray
) -> dict[str, float]:
    """Return what the metric gives, checked for names and numbers, and for being the same the second time."""
    values: dict[str, float] = pure_result(f"{subject}.evaluate()", plugin.evaluate, estimate, recording, counted)
    require_is(dict, f"{subject}.evaluate()", values)
    for name, value in values.items():
        require_that(isinstance(name, str), f"{subject}.evaluate() has the name {name!r}; it must be a string.")
        require_that(isinstance(value, float), f"{subject}.evaluate(): {name} is {value!r}; it must be a float.")
    return values


CHECKS: Mapping[str, Callable[[Plugin], None]] = {
    "dataset": check_dataset,
    "disturbance": check_disturbance,
    "attitude": check_attitude,
    "filter": check_filter,
    "adaptation": check_adaptation,
    "engine": check_engine,
    "metric": check_metric,
}
"""The check of each kind of plugin."""


def check_plugin(kind: str, plugin: Plugin) -> None:
    """Check that ``plugin`` is a frozen, hashable, documented dataclass, and all that its ``kind`` promises.

    Raises:
        PluginError: no such kind.
        AssertionError: something is not as it must be; a sentence says what.
    """
    require_known("kind of plugin", kind, CHECKS)
    for check in STAGES:
        check(plugin)
    require_methods(kind, plugin)
    if kind in CLASSIFIED:
        _check_provenance(type(plugin))
    CHECKS[kind](plugin)


CLASSIFIED = ("filter", "adaptation")
"""Kinds of plugins that are methods; each of this package says what it is."""


def _check_provenance(cls: type) -> None:
    known = provenance_of(cls)
    require_that(
        known is not None or not (is_own(cls) or "provenance" in vars(cls)),
        f'{cls.__name__} does not say what it is; write provenance = Provenance("published", "doi:..."), or with'
        ' "simplified" or "own" and a note.',
    )
    wrong = known.mistake() if known else ""
    require_that(not wrong, f"The provenance of {cls.__name__} makes no sense: {wrong}.")


def _check_class(plugin: Plugin) -> None:
    cls = type(plugin)
    subject = cls.__name__
    frozen = dataclasses.is_dataclass(cls) and cls.__dataclass_params__.frozen  # type: ignore[attr-defined]  # private to dataclasses
    require_that(frozen, f"{subject} is not a frozen dataclass; write @dataclass(frozen=True) above it.")
    doc = inspect.cleandoc(cls.__doc__ or "")
    summary = doc.split("\n", 1)[0]
    written = summary.endswith(".") and not summary.startswith(f"{subject}(")  # what dataclass puts there by itself
    require_that(written, f"{subject} has no docstring whose first line is one sentence; `jerkbench list` prints it.")
    family = "\n".join(inspect.cleandoc(c.__doc__ or "") for c in cls.__mro__ if dataclasses.is_dataclass(c))
    for f in dataclasses.fields(cls):
        require_that(f"{f.name}:" in family, f"{subject} does not document its parameter {f.name} under Attributes.")
    _check_ranges(cls)


def _check_ranges(cls: type) -> None:
    """Check that each range has sense, and its field's default inside."""
    defaults = {f.name: f.default for f in dataclasses.fields(cls)}
    for name, bounds in ranges_of(cls).items():
        subject = f"{cls.__name__}.{name}"
        require_that(not bounds.mistake(), f"The range of {subject} makes no sense: {bounds.mistake()}.")
        default = defaults[name]
        number = isinstance(default, int | float) and isinstance(default, bool) == is_switch(cls, name)
        require_that(
            number, f"{subject} has a range and the default {default!r}; a search needs a number to begin from."
        )
        inside = bounds.low <= default <= bounds.high  # type: ignore[operator]  # it is a number
        require_that(inside, f"The default of {subject} is {default}, outside of its range {bounds}.")
        whole = not is_whole(cls, name) or (bounds.low % 1 == 0 and bounds.high % 1 == 0)
        require_that(
            whole, f"{subject} holds whole numbers; the bounds of its range are {bounds.low} and {bounds.high}."
        )


def _check_value(plugin: Plugin) -> None:
    subject = type(plugin).__name__
    try:
        hash(plugin)
    except TypeError as error:
        raise AssertionError(f"{subject} is not hashable ({error}); a field that is a list must be a tuple.") from error
    try:
        unpickled = pickle.loads(pickle.dumps(plugin))  # noqa: S301 - made the line before
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise AssertionError(f"{subject} cannot be pickled ({error}), so no worker process can run it.") from error
    require_that(
        unpickled == plugin, f"{subject} is another after pickling; a worker process would run something else."
    )


STAGES: Sequence[Callable[[Plugin], None]] = (_check_class, _check_value)
"""The checks of a plugin of any kind, each for itself."""


# A short check of a plugin from elsewhere before it runs, for faults that give a plausible table of wrong numbers.
#
# It asks for less than `jerkbench.testing`, and takes hundredths of a second: a plugin that passes may still be
# wrong.

SHORT_S, DRIVE_S = 8.0, 60.0
"""Of recordings to try a plugin on: for what goes through every sample, and for disturbances, which need room."""


def complaint(kind: str, plugin: Hashable) -> str:
    """Return what is the matter with ``plugin``, in a sentence; empty where nothing is."""
    try:
        return _complaint(kind, plugin)
    except TypeError as error:
        return f"{type(plugin).__name__} is not hashable ({error}); a field that is a list must be a tuple."


@lru_cache(maxsize=1024)
def _complaint(kind: str, plugin: Hashable) -> str:
    """Say it once for each plugin with its parameters; what a plugin raises here it raises again in its run."""
    try:
        require_methods(kind, plugin)
        PROBES[kind](plugin)
    except Unfit as error:
        return str(error)
    except FrozenInstanceError as error:
        return changes_itself(plugin, error)
    except Exception:  # noqa: BLE001 - a run over the user's data says what the matter is, or goes well
        return ""
    return ""


def _probe_filter(plugin: Plugin) -> None:
    subject = type(plugin).__name__
    if not isinstance(plugin, Filter):
        recording, call = small_recording(SHORT_S), f"{subject}.estimate()"
        adaptation = create("adaptation", {"name": plugin.adaptations[0]})
        require_is(Estimate, call, pure_result(call, plugin.estimate, recording, true_attitude(recording), adaptation))
        return
    n = require_initial_variances(subject, plugin)
    for dt in (0.01, 0.01 / 3.0):
        axis_model_of(f"{subject}.axis_model({dt:g}, 0.01)", plugin, n, dt, 0.01)


def _probe_engine(plugin: Plugin) -> None:
    subject, (_, timeline) = f"{type(plugin).__name__}.run()", small_timeline(SHORT_S)
    require_is(Estimate, subject, pure_result(subject, plugin.run, timeline, Baseline(), NoAdaptation()))


def _probe_metric(plugin: Plugin) -> None:
    recording = small_recording(SHORT_S)
    estimate = GnssOnly().estimate(recording, true_attitude(recording), NoAdaptation())
    checked_values(type(plugin).__name__, plugin, estimate, recording, np.ones(len(estimate.index), dtype=bool))


PROBES: Mapping[str, Callable[[Plugin], object]] = {
    "dataset": lambda _: None,  # to load it twice may take minutes
    "disturbance": lambda it: checked_disturbance(type(it).__name__, it, small_recording(DRIVE_S), 0),
    "attitude": lambda it: checked_attitude(type(it).__name__, it, small_recording(SHORT_S)),
    "filter": _probe_filter,
    "adaptation": probe_adaptation,
    "engine": _probe_engine,
    "metric": _probe_metric,
}
