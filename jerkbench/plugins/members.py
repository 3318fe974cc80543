"""Members of plugins: names of the required and optional ones of each kind, and messages about wrong classes."""

import difflib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING, fields
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

CONTRACTS: Mapping[str, type] = {
    "dataset": Dataset,
    "disturbance": Disturbance,
    "attitude": AttitudeFilter,
    "filter": Filter,
    "estimator": Estimator,
    "adaptation": Adaptation,
    "engine": Engine,
    "metric": Metric,
}
"""The protocol of each kind. A plugin of the kind filter satisfies one of two."""

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
"""Names with a higher similarity than this are the same name, misspelt."""


def missing_member(kind: str, plugin: object) -> str:
    """Return a message about the first member that ``plugin`` lacks, or an empty string."""
    cls, sort = type(plugin).__name__, kind
    if kind == "filter":
        if not (hasattr(plugin, "axis_model") or hasattr(plugin, "estimate")):
            return f"{cls} has neither axis_model() nor estimate(); it needs one of them."
        kind, sort = ("filter", "kinematic filter") if hasattr(plugin, "axis_model") else ("estimator", "estimator")
    for name in _public(name for name, value in vars(CONTRACTS[kind]).items() if callable(value)):
        if not callable(getattr(plugin, name, None)):
            return f"{cls} has no method {name}(); {article(sort)} {sort} needs it (see jerkbench.contracts)."
    if kind in ("dataset", "disturbance") and not isinstance(seeded := getattr(plugin, "seeded", None), bool):
        return f"{cls}.seeded is {seeded!r}; it must be True or False."
    if kind == "estimator" and not hasattr(plugin, "adaptations"):
        return f"{cls} has no adaptations; it must name those that it accepts."
    return ""


def misfits(kind: str, cls: type) -> Iterator[str]:
    """Yield messages about members of a class that are misspelt, have no type, or have a wrong type or value."""
    own, hints, parameters = cls.__name__, get_type_hints(cls), {f.name: f.default for f in fields(cls)}
    yield from _unknown_members(kind, cls)
    for name in OPTIONAL_METHODS[kind]:
        if name in parameters or (hasattr(cls, name) and not callable(getattr(cls, name))):
            yield f"{own}.{name} must be a method (see jerkbench.contracts), or have another name."
    if kind == "metric" and (reads := getattr(cls, "reads", READABLE[0])) not in READABLE:
        yield f"reads: {unknown('part of an estimate', str(reads), READABLE)}"
    columns = getattr(cls, "columns", {}) if kind == "metric" else {}
    if not (isinstance(columns, Mapping) and all(isinstance(of, Column) for of in columns.values())):
        yield f"{own}.columns must be a mapping of column names to jerkbench.parameters.Column."
    varying = getattr(cls, "varying", ())
    if not (isinstance(varying, tuple) and all(hints.get(name) is int for name in varying)):
        yield f"{own}.varying must be a tuple of names of parameters that are integers."
    for name, default in parameters.items():
        suitable = DEFAULT_TYPES.get(hints[name])
        if suitable and default is not MISSING and type(default) not in suitable:
            yield f"{own}.{name} has the type {hints[name].__name__} and the default {default!r}; correct one of them."


def _unknown_members(kind: str, cls: type) -> Iterator[str]:
    optional = {*OPTIONAL_METHODS[kind], *OPTIONAL_ATTRIBUTES[kind], *OF_ALL}
    contracts = [CONTRACTS[kind], CONTRACTS["estimator"]] if kind == "filter" else [CONTRACTS[kind]]
    required = {name for of in contracts for name in (*vars(of), *vars(of).get("__annotations__", ()))}
    known = optional | required | {f.name for f in fields(cls)}
    for base in (base for base in cls.__mro__ if base.__module__ not in NOT_OURS):
        typed = vars(base).get("__annotations__", {})
        for name in _public(name for name in vars(base) if name not in known):
            value, member = vars(base)[name], f"{cls.__name__}.{name}"
            if meant := difflib.get_close_matches(name, optional, 1, MISSPELT):
                yield f"{member} is not used. Did you mean {meant[0]}? Rename it to that, or to a less similar name."
            elif name.islower() and isinstance(value, PARAMETERS) and name not in typed:
                annotation = type(value).__name__
                yield (
                    f"{member} has no type, so it is not a parameter; write {name}: {annotation} = {value!r}, or"
                    f" {name}: ClassVar[{annotation}] if it is a constant."
                )


def _public(names: Iterable[str]) -> list[str]:
    return [name for name in names if not name.startswith("_")]
