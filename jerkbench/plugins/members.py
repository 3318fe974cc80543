"""Members of plugins: names of the required and optional ones of each kind, and messages about wrong classes."""

import difflib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import MISSING, fields
from functools import cache
from typing import get_type_hints

from jerkbench.contracts import (
    Adaptation,
    AttitudeFilter,
    Dataset,
    Disturbance,
    Engine,
    Estimator,
    Filter,
    Metric,
)
from jerkbench.errors import article, unknown
from jerkbench.parameters import Column

REQUIRED: Mapping[str, tuple[type, ...]] = {
    "dataset": (Dataset,),
    "disturbance": (Disturbance,),
    "attitude": (AttitudeFilter,),
    "filter": (Filter, Estimator),
    "adaptation": (Adaptation,),
    "engine": (Engine,),
    "metric": (Metric,),
}
"""The protocol of each kind. A filter has one of two."""

OPTIONAL_METHODS: Mapping[str, tuple[str, ...]] = {
    "dataset": (),
    "disturbance": ("fingerprint",),
    "attitude": ("require", "remarks"),
    "filter": ("axis_models", "require", "remarks", "fingerprint", "estimate_compiled", "run_settings", "of_seed"),
    "adaptation": ("memory_size", "memory_size_of", "at_updates", "fade", "adapt_prior", "adapt_gain"),
    "engine": ("run_settings", "prepare"),
    "metric": ("summarise",),
}
OPTIONAL_ATTRIBUTES: Mapping[str, tuple[str, ...]] = {
    "dataset": ("default_attitude", "attitude_only", "without_imu"),
    "disturbance": (),
    "attitude": (),
    "filter": ("uses_imu", "attitude_only", "table_label", "provenance", "for_each_seed"),
    "adaptation": ("wants_true_covariance", "lanes", "varying", "changes_nothing", "provenance"),
    "engine": (),
    "metric": ("columns", "reads", "default"),
}
"""The optional members of each kind. `jerkbench.contracts` describes them."""

OF_ALL = ("citations", "depends_on")
"""Optional attributes of every kind."""

NOT_OURS = ("builtins", "typing", "jerkbench.contracts")
"""Modules of bases that no author has written."""

READABLE = ("attitude", "updates")
"""Parts of an estimate that a metric may declare to read."""

PARAMETERS = (bool, int, float, str, tuple)
"""Types of the values that parameters have."""

DEFAULT_TYPES = {bool: (bool,), int: (int,), float: (float, int), str: (str,)}
"""Types that the default of a parameter may have, by the parameter's."""

MISSPELT = 0.8
"""Names that are more alike than this are one name, misspelt."""


def missing_member(kind: str, plugin: object) -> str:
    """Return which member a plugin lacks that its kind needs, in a sentence; empty if it has all of them."""
    cls, sort, contract = type(plugin).__name__, kind, REQUIRED[kind][0]
    if kind == "filter":
        if not (hasattr(plugin, "axis_model") or hasattr(plugin, "estimate")):
            return f"{cls} has neither axis_model() nor estimate(); it needs one of them."
        kinematic = hasattr(plugin, "axis_model")
        sort, contract = ("kinematic filter", Filter) if kinematic else ("estimator", Estimator)
    for name in _public(name for name, value in vars(contract).items() if callable(value)):
        if not callable(getattr(plugin, name, None)):
            return f"{cls} has no method {name}(); {article(sort)} {sort} needs it (see jerkbench.contracts)."
    if kind in ("dataset", "disturbance") and not isinstance(seeded := getattr(plugin, "seeded", None), bool):
        return f"{cls}.seeded is {seeded!r}; it must be True or False."
    if sort == "estimator" and not hasattr(plugin, "adaptations"):
        return f"{cls} has no adaptations; it must name those that it accepts."
    return ""


def misfit(kind: str, cls: type) -> str:
    """Return what is wrong with the optional parts of a plugin, in a sentence; empty: nothing.

    Of a name that is all but one of an optional part it is taken that this was meant. Parameters may have such names.
    """
    parameters = {field.name for field in fields(cls)}
    optional = {*OPTIONAL_METHODS[kind], *OPTIONAL_ATTRIBUTES[kind], *OF_ALL}
    known = optional | _members(REQUIRED[kind]) | parameters
    for name in (name for base in _authored(cls) for name in _public(vars(base))):
        if name not in known and (meant := difflib.get_close_matches(name, optional, 1, MISSPELT)):
            return (
                f"nothing asks for {cls.__name__}.{name}, but for {meant[0]}; give it that name, or one that is less"
                " like it."
            )
    for name in OPTIONAL_METHODS[kind]:
        if name in parameters or (hasattr(cls, name) and not callable(getattr(cls, name))):
            return f"{cls.__name__}.{name} must be a method (see jerkbench.contracts), or have another name."
    reads = getattr(cls, "reads", None) if kind == "metric" else None
    if reads is not None and reads not in READABLE:
        return f"reads: {unknown('part of an estimate', str(reads), READABLE)}"
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


def _public(names: Iterable[str]) -> list[str]:
    return [name for name in names if not name.startswith("_")]
