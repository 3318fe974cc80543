"""The optional parts of a plugin: what holds for one that lacks them, and the refusal of one whose part is misspelt."""

import difflib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import MISSING, fields
from functools import cache
from typing import Literal, TypeGuard, TypeVar, cast, get_args, get_type_hints

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import (
    Adaptation,
    AdaptingGain,
    AdaptingPrior,
    AttitudeFilter,
    AttitudeOnly,
    Batched,
    ChangingNothing,
    Cited,
    Classified,
    Clocked,
    Dataset,
    Declaring,
    Depending,
    Disturbance,
    Engine,
    Estimator,
    Fading,
    Filter,
    InLanes,
    Labelled,
    ManyLengths,
    Metric,
    OnRequest,
    PerSeed,
    PreferringAttitude,
    Preparing,
    Reading,
    ReadingFile,
    Remarking,
    Remembering,
    RememberingStates,
    Requiring,
    SideBySide,
    Summarising,
    TrueCovariance,
    UsingImu,
    Varying,
    WithoutImu,
)
from jerkbench.errors import unknown
from jerkbench.parameters import Column
from jerkbench.timeline import Timeline

A = TypeVar("A")
_P = TypeVar("_P")

OF_ALL = (Cited, Depending)
OF_FILTERS = (Classified, ManyLengths, Batched, UsingImu, AttitudeOnly, Requiring, PerSeed, Labelled, ReadingFile)
OF_MEMORY = (Classified, Remembering, RememberingStates, Clocked, TrueCovariance, InLanes, Varying, ChangingNothing)

OPTIONAL: Mapping[str, tuple[type, ...]] = {
    "dataset": (PreferringAttitude, AttitudeOnly, WithoutImu, *OF_ALL),
    "disturbance": (ReadingFile, *OF_ALL),
    "attitude": (Requiring, Remarking, *OF_ALL),
    "filter": (*OF_FILTERS, Remarking, *OF_ALL),
    "adaptation": (*OF_MEMORY, Fading, AdaptingPrior, AdaptingGain, *OF_ALL),
    "engine": (SideBySide, Preparing, *OF_ALL),
    "metric": (Declaring, Summarising, Reading, OnRequest, *OF_ALL),
}
"""The optional parts of each kind; a new one is a Protocol beside its contract, and a word here."""

REQUIRED: Mapping[str, tuple[type, ...]] = {
    "dataset": (Dataset,),
    "disturbance": (Disturbance,),
    "attitude": (AttitudeFilter,),
    "filter": (Filter, Estimator),
    "adaptation": (Adaptation,),
    "engine": (Engine,),
    "metric": (Metric,),
}
"""The contract of each kind; a filter has one of two."""


NOT_OURS = ("builtins", "typing", "jerkbench.contracts")
"""Modules of bases that no author has written."""

READABLE = get_args(Reading.__annotations__["reads"].__args__[0])
"""Parts of an estimate that a metric may read alone."""

PARAMETERS = (bool, int, float, str, tuple)
"""Types of the values that parameters have."""

DEFAULT_TYPES = {bool: (bool,), int: (int,), float: (float, int), str: (str,)}
"""Types that the default of a parameter may have, by the parameter's."""

MISSPELT = 0.8
"""Names that are more alike than this are one name, misspelt."""


def has_methods(plugin: object, protocol: type[_P]) -> TypeGuard[_P]:
    """Whether the class of a plugin has the methods of a ``protocol`` that asks for methods alone."""
    kind, contract = cast("tuple[type, type]", (type(plugin), protocol))
    return _has_methods(kind, contract)


@cache
def _has_methods(kind: type, protocol: type) -> bool:
    """As `isinstance` says, which takes ten microseconds each time: of a sweep each run asks."""
    return issubclass(kind, protocol)


def preferred_attitude(dataset: object) -> str | None:
    """The attitude filter that a data set, or its class, names."""
    return dataset.default_attitude if isinstance(dataset, PreferringAttitude) else None


def is_attitude_only(plugin: object) -> bool:
    """Whether a data set has nothing to navigate by, or a filter navigates by nothing."""
    return isinstance(plugin, AttitudeOnly) and plugin.attitude_only is True


def lacks_imu(dataset: object) -> bool:
    """Whether the recordings of a data set have no IMU."""
    return isinstance(dataset, WithoutImu) and dataset.without_imu


def uses_imu(model: object) -> bool:
    """Whether a filter, or its class, uses the IMU; a class whose parameters decide does."""
    return not isinstance(model, UsingImu) or model.uses_imu is not False


def clocked(adaptation: A, timeline: Timeline) -> A:
    """Return ``adaptation`` for the run over ``timeline``: one that is `Clocked` hears when its updates are."""
    if not has_methods(adaptation, Clocked):
        return adaptation
    return cast("A", adaptation.at_updates(timeline.update_times_s))


MEASURED_STATES = 6
"""States of position and velocity, which every filter has."""


def empty_memory(adaptation: object, states: int = MEASURED_STATES) -> FloatArray:
    """Return the memory of ``adaptation`` at the start of a run over a filter of ``states`` states.

    It is zero, and of no length where the adaptation does not remember anything.
    """
    return np.zeros(memory_size(adaptation, states))


def memory_size(adaptation: object, states: int) -> int:
    """Return how many numbers ``adaptation`` remembers over a filter of ``states`` states."""
    if has_methods(adaptation, RememberingStates):
        return adaptation.memory_size_of(states)
    return adaptation.memory_size() if has_methods(adaptation, Remembering) else 0


def wants_truth(adaptation: object) -> bool:
    """Whether an adaptation gets the true covariance as R."""
    return bool(getattr(adaptation, "wants_true_covariance", False))  # `isinstance` takes ten microseconds


def asked_in_lanes(adaptation: object) -> bool:
    """Whether many runs ask an adaptation at once; one that fades each asks by itself."""
    return bool(getattr(adaptation, "lanes", False)) and not has_methods(adaptation, Fading)


def changes_nothing(adaptation: object) -> bool:
    """Whether the class of an adaptation states itself that it leaves R as it is."""
    return bool(vars(type(adaptation)).get("changes_nothing", False))


def on_request(metric: object) -> bool:
    """Whether a metric, or its class, is only computed where it is asked for."""
    return isinstance(metric, OnRequest) and not metric.default


def part_read(metric: object) -> Literal["attitude", "updates", "everything"]:
    """The part of an estimate that a metric looks at."""
    kind: type = type(metric)
    return _part_read(kind)


@cache
def _part_read(metric: type) -> Literal["attitude", "updates", "everything"]:
    return metric.reads if isinstance(metric, Reading) else "everything"


def misfit(kind: str, cls: type) -> str:
    """Return what is wrong with the optional parts of a plugin, in a sentence; empty: nothing.

    Of a name that is all but one of an optional part it is taken that this was meant. Parameters may have such names.
    """
    parameters, optional = {field.name for field in fields(cls)}, _members(OPTIONAL[kind])
    known = optional | _members(REQUIRED[kind]) | parameters
    for name in (name for base in _authored(cls) for name in _public(vars(base))):
        if name not in known and (meant := difflib.get_close_matches(name, optional, 1, MISSPELT)):
            return (
                f"nothing asks for {cls.__name__}.{name}, but for {meant[0]}; give it that name, or one that is less"
                " like it."
            )
    for name in sorted(_methods(OPTIONAL[kind])):
        if name in parameters or (hasattr(cls, name) and not callable(getattr(cls, name))):
            return f"{cls.__name__}.{name} must be a method (see jerkbench.contracts), or have another name."
    if isinstance(cls, Reading) and cls.reads not in READABLE:
        return f"reads: {unknown('part of an estimate', str(cls.reads), READABLE)}"
    return _wrong_columns(kind, cls) or _wrong_varying(cls) or _untyped(cls, known) or _wrong_default(cls)


def _wrong_columns(kind: str, cls: type) -> str:
    columns = getattr(cls, "columns", {}) if kind == "metric" else {}
    if isinstance(columns, Mapping) and all(isinstance(of, Column) for of in columns.values()):
        return ""
    return f"{cls.__name__}.columns must be a mapping of column names to jerkbench.parameters.Column."


def _wrong_varying(cls: type) -> str:
    names = getattr(cls, "varying", ())
    if isinstance(names, tuple) and (not names or all(get_type_hints(cls).get(name) is int for name in names)):
        return ""
    return f"{cls.__name__}.varying must be a tuple of names of parameters that are whole numbers."


def _untyped(cls: type, known: Collection[str]) -> str:
    """Return a sentence about a class attribute that looks like a parameter and, without a type, is none."""
    for base in _authored(cls):
        typed = vars(base).get("__annotations__", {})
        for name in _public(vars(base)):
            value = vars(base)[name]
            if name not in known and name not in typed and name.islower() and isinstance(value, PARAMETERS):
                return (
                    f"{cls.__name__}.{name} has no type, so it is no parameter; write {name}: {type(value).__name__} ="
                    f" {value!r}, or {name}: ClassVar[{type(value).__name__}] if nobody is to change it."
                )
    return ""


def _wrong_default(cls: type) -> str:
    """Return a sentence about a parameter whose default is not of its type."""
    hints = get_type_hints(cls)
    for field in fields(cls):
        suitable = DEFAULT_TYPES.get(hints[field.name])
        if suitable and field.default is not MISSING and type(field.default) not in suitable:
            return (
                f"{cls.__name__}.{field.name} has the type {hints[field.name].__name__} and the default"
                f" {field.default!r}; correct one of them."
            )
    return ""


def _authored(cls: type) -> list[type]:
    """The class and those of its bases that authors have written."""
    return [base for base in cls.__mro__ if base.__module__ not in NOT_OURS]


@cache
def _members(protocols: tuple[type, ...]) -> frozenset[str]:
    """The names that the protocols ask for."""
    return frozenset(name for p in protocols for name in _public([*vars(p), *vars(p).get("__annotations__", ())]))


@cache
def _methods(protocols: tuple[type, ...]) -> frozenset[str]:
    return frozenset(name for p in protocols for name in _public(vars(p)) if callable(vars(p)[name]))


def _public(names: Iterable[str]) -> list[str]:
    return [name for name in names if not name.startswith("_")]


def axis_models(model: Filter, lengths_s: FloatArray, dt0_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A (k, n, n), b (k, n), Q (k, n, n) of ``lengths_s`` (k,); a length that is not positive changes nothing.

    A filter with `ManyLengths` is asked once, any other for one length after the other.
    """
    n, k = 2 + len(model.initial_variances()), len(lengths_s)
    A, b, Q = np.tile(np.eye(n), (k, 1, 1)), np.zeros((k, n)), np.zeros((k, n, n))
    passing = np.flatnonzero(lengths_s > 0)
    if has_methods(model, ManyLengths) and len(passing):
        A[passing], b[passing], Q[passing] = model.axis_models(lengths_s[passing], dt0_s)
        return A, b, Q
    for row in passing.tolist():
        A[row], b[row], Q[row] = model.axis_model(float(lengths_s[row]), dt0_s)
    return A, b, Q
