"""The registries of plugins. A plugin is a frozen dataclass that is registered by a decorator or an entry point.

The fields of a plugin define its parameters, its Hydra schema and its documentation. Built-in plugins are registered
with the decorator `register`. Plugins of other packages are registered with an entry point in the group
``jerkbench.<kind>``. The name of the entry point is the name of the plugin. The module `jerkbench.contracts` defines
the members that each kind of plugin must have.
"""

import dataclasses
import difflib
import importlib
import pkgutil
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache, partial
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any, TypeVar

from jerkbench.contracts import CONTRACTS
from jerkbench.errors import PluginError, article, require_known, unknown
from jerkbench.parameters import PLUGIN_TITLES
from jerkbench.renamed import new_name

PACKAGES = {
    "dataset": "jerkbench.datasets",
    "disturbance": "jerkbench.disturbances",
    "attitude": "jerkbench.attitude",
    "filter": "jerkbench.filters",
    "adaptation": "jerkbench.adaptation",
    "engine": "jerkbench.engines",
    "metric": "jerkbench.evaluation.metrics",
}
"""The kinds of plugins in the order of the data flow, with the packages that contain the built-in plugins."""

KINDS = tuple(PACKAGES)

REQUIRED = "???"
"""Text by which OmegaConf marks the value of a field without a default."""

_registry: dict[str, dict[str, type]] = {kind: {} for kind in KINDS}

_left_out: dict[str, dict[str, str]] = {kind: {} for kind in KINDS}

Class = TypeVar("Class", bound=type)


def register(kind: str, name: str) -> Callable[[Class], Class]:
    """Register the decorated frozen dataclass as a plugin of ``kind`` with the name ``name``.

    Raises:
        PluginError: The kind is unknown, the class is not a frozen dataclass or has invalid members, or another class
            has the same name.
    """

    def add(cls: Class) -> Class:
        _add(kind, name, cls)
        return cls

    return add


def get(kind: str, name: str) -> type:
    """Return the class of a plugin.

    Raises:
        PluginError: The name is unknown. The error message lists the known names and the most similar name.
    """
    known, today = _of_kind(kind), new_name(kind, name)
    if today not in known:
        raise PluginError(no_such(kind, name))
    return known[today]


def left_out(kind: str) -> Mapping[str, str]:
    """Return an error message for each entry point of ``kind`` that could not be loaded, by the entry point's name."""
    _of_kind(kind)
    return _left_out[kind]


def no_such(kind: str, name: str, presets: Iterable[str] = ()) -> str:
    """Return the error message for an unknown plugin or preset ``name`` of ``kind``."""
    return left_out(kind).get(name) or unknown(kind, name, [*names(kind), *presets])


def is_builtin(cls: type) -> bool:
    """Return whether a plugin class belongs to this package."""
    return cls.__module__.partition(".")[0] == "jerkbench"


def modules_of_user() -> list[str]:
    """Return the modules that a new process has to import to have the same plugins as this process.

    Modules of built-in plugins and of entry points are not included, because every process finds them. The running
    script is not included, because other processes cannot import it.
    """
    classes = {cls for known in _registry.values() for cls in known.values() if not is_builtin(cls)}
    found = {entry.module for kind in KINDS for entry in entry_points(group=f"jerkbench.{kind}")}
    modules = {cls.__module__ for cls in classes if not of_script(cls)} - found
    return sorted(module for module in modules if _is_importable(module.partition(".")[0]))


def _is_importable(package: str) -> bool:
    try:
        return find_spec(package) is not None
    except ValueError:  # raised for a module without a specification, such as a notebook
        return False


def of_script(cls: type) -> bool:
    """Return whether a class is defined in the running script or notebook, so that no other process can import it."""
    return cls.__module__ == "__main__"


def any_of_script() -> bool:
    """Return whether a registered plugin is defined in the running script or notebook."""
    return any(of_script(cls) for known in _registry.values() for cls in known.values())


def names(kind: str) -> list[str]:
    """Return the names of all plugins of ``kind``, sorted."""
    return sorted(_of_kind(kind))


def create(kind: str, config: Mapping[str, Any]) -> Any:  # noqa: ANN401 - the kind decides the contract
    """Create a plugin from a configuration ``{"name": ..., field: value, ...}``.

    OmegaConf converts the values in the same way as Hydra, and resolves references to other values of the
    configuration. Numbers and strings that already have the type of their field are not converted, because the
    conversion is slow.

    Raises:
        PluginError: The name or a field is unknown, or a value has the wrong type. The error message names the plugin
            and the field.
    """
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    name = str(config.get("name"))
    cls = get(kind, name)
    defaults = _defaults(cls)
    for key in config:
        if key not in (*defaults, "name"):
            raise PluginError(unknown(f"parameter of {kind} {name}", str(key), defaults))
    values = {key: REQUIRED for key, default in defaults.items() if default == repr(REQUIRED)}
    try:
        values |= {k: v for k, v in config.items() if k != "name" and repr(_as_lists(v)) != defaults[k]}
        others = values if "${" in repr(values) else {k: v for k, v in values.items() if not _fits(v, _hints(cls)[k])}
        if others:
            merged = OmegaConf.merge(_structured(kind, name, cls), values)
            plain = typing.cast("dict[str, Any]", OmegaConf.to_container(merged, resolve=True, throw_on_missing=True))
            values |= {key: plain[key] for key in others}
    except OmegaConfBaseException as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise PluginError(f"{kind} {name}, parameter '{error.full_key}': {reason}.") from error
    return cls(**_fitted(f"{kind} {name}", cls, values))


def _fits(value: object, hint: object) -> bool:
    """Return whether a value fits a field of this type without a conversion other than from int to float."""
    if type(value) is str:
        return hint is str and value != REQUIRED
    return hint in (bool, int, float) and (type(value) is hint or (hint is float and type(value) is int))


@cache
def _defaults(cls: type) -> dict[str, str]:
    """Return the `repr` of the default value of each field."""
    return {f.name: repr(_default(f)) for f in dataclasses.fields(cls)}


def _default(f: "dataclasses.Field[Any]") -> Any:  # noqa: ANN401 - a field's value
    if f.default_factory is not dataclasses.MISSING:
        return f.default_factory()
    return REQUIRED if f.default is dataclasses.MISSING else _as_lists(f.default)


@cache
def _structured(kind: str, name: str, cls: type) -> Any:  # noqa: ANN401 - a configuration
    from omegaconf import OmegaConf

    del cls  # the class is part of the cache key, because another class can have the same name
    return OmegaConf.structured(schema(kind, name))


def schema(kind: str, name: str) -> type:
    """Return the Hydra schema of a plugin: the field ``name`` and the fields of the plugin, with their defaults.

    The schema is a separate dataclass, because OmegaConf makes the configuration of a frozen dataclass read-only.
    """
    cls = get(kind, name)
    defaults = {f.name: dataclasses.field(default_factory=partial(_default, f)) for f in dataclasses.fields(cls)}
    fields = [(key, _as_list(_hints(cls)[key]), default) for key, default in defaults.items()]
    return dataclasses.make_dataclass(cls.__name__, [("name", str, name), *fields])


@cache
def _hints(cls: type) -> dict[str, Any]:
    return typing.get_type_hints(cls)


def _add(kind: str, name: str, cls: type) -> None:
    require_known("kind of plugin", kind, KINDS)
    if not (dataclasses.is_dataclass(cls) and cls.__dataclass_params__.frozen):  # type: ignore[attr-defined]
        wrong = f"{cls.__name__} is not a frozen dataclass"
        raise PluginError(f"{kind} {name}: {wrong}; write @dataclass(frozen=True) above the class.")
    if found := list(misfits(kind, cls)):
        raise PluginError(f"{kind} {name}: {' '.join(found)}")
    owner = _registry[kind].get(name)
    if owner is not None and (owner.__module__, owner.__qualname__) != (cls.__module__, cls.__qualname__):
        raise PluginError(f"{kind} {name} already exists: {owner.__module__}.{owner.__qualname__}; use another name.")
    _registry[kind][name] = cls
    PLUGIN_TITLES[cls] = f"{kind} {name}: "


def _of_kind(kind: str) -> dict[str, type]:
    require_known("kind of plugin", kind, KINDS)
    _import_builtin(kind)
    _import_entry_points(kind)
    return _registry[kind]


@cache
def _import_builtin(kind: str) -> None:
    """Import every module in the package of a kind, so that the decorators register the plugins."""
    package = importlib.import_module(PACKAGES[kind])
    for module in pkgutil.iter_modules(package.__path__, prefix=f"{package.__name__}."):
        importlib.import_module(module.name)


@cache
def _import_entry_points(kind: str) -> None:
    for entry in entry_points(group=f"jerkbench.{kind}"):
        try:
            _add(kind, entry.name, entry.load())
        except Exception as error:  # noqa: BLE001 - a module may raise any exception, and other plugins must still work
            _left_out[kind][entry.name] = _failed(kind, entry, error)


def _failed(kind: str, entry: EntryPoint, error: Exception) -> str:
    owner = f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value
    reason = " ".join(str(error).split())
    return f"{kind} '{entry.name}' of {owner} cannot be loaded and is left out: {type(error).__name__}: {reason}"


def _fitted(plugin: str, cls: type, values: dict[str, Any]) -> dict[str, Any]:
    fitted = {}
    for key, hint in ((f.name, _hints(cls)[f.name]) for f in dataclasses.fields(cls)):
        if key in values:
            try:
                fitted[key] = _fit(values[key], hint)
            except (TypeError, ValueError) as error:
                raise PluginError(f"{plugin}, parameter '{key}': {error}.") from error
    return fitted


def _as_list(hint: Any) -> Any:  # noqa: ANN401 - a type hint
    """Convert the type hint tuple[T, ...] to list[T].

    Nested tuples become list[Any], because Hydra has no nested tuples.
    """
    items = [item for item in typing.get_args(hint) if item is not Ellipsis]
    if typing.get_origin(hint) is not tuple:
        return hint
    return list[Any] if typing.get_origin(items[0]) is tuple else list[items[0]]  # type: ignore[valid-type]


def _as_lists(value: Any) -> Any:  # noqa: ANN401 - a field's value
    return [_as_lists(item) for item in value] if isinstance(value, tuple) else value


def _fit(value: Any, hint: Any) -> Any:  # noqa: ANN401 - a field's value and its type hint
    """Convert a list to a tuple if the field is a tuple, and an integer to float if the field is a float."""
    if typing.get_origin(hint) is not tuple:
        return float(value) if hint is float else value
    if not isinstance(value, list):
        raise TypeError(f"{value!r} is not a list")
    return tuple(_fit(item, typing.get_args(hint)[0]) for item in value)


# The optional members of each kind of plugin, and messages about invalid classes.

OPTIONAL_METHODS: Mapping[str, tuple[str, ...]] = {
    "disturbance": ("fingerprint",),
    "attitude": ("require", "remarks"),
    "filter": ("axis_models", "require", "remarks", "fingerprint", "estimate_compiled", "run_settings", "of_seed"),
    "adaptation": ("memory_size", "memory_size_of", "at_updates", "fade", "adapt_prior", "adapt_gain"),
    "engine": ("run_settings",),
    "metric": ("summarise",),
}
OPTIONAL_ATTRIBUTES: Mapping[str, tuple[str, ...]] = {
    "dataset": ("default_attitude", "attitude_only", "without_imu"),
    "filter": ("uses_imu", "attitude_only", "table_label", "provenance", "for_each_seed"),
    "adaptation": ("wants_true_covariance", "lanes", "varying", "changes_nothing", "provenance"),
    "metric": ("columns", "reads", "default"),
}
"""The optional members of each kind. `jerkbench.contracts` describes them."""

OF_ALL = ("citations", "depends_on")
"""Optional attributes that plugins of every kind may have."""

NOT_OURS = ("builtins", "typing", "jerkbench.contracts")
"""Modules of base classes whose members are not checked."""

PARAMETERS = (bool, int, float, str, tuple)
"""Types that the value of a parameter may have."""

MISSPELT = 0.8
"""Similarity of two names above which one of them is considered a misspelling of the other."""


def missing_member(kind: str, plugin: object) -> str:
    """Return a message about the first required member that a plugin lacks, or an empty string if none is missing."""
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
        return f"{cls} has no attribute adaptations; it must list the names of the accepted adaptations."
    return ""


def misfits(kind: str, cls: type) -> Iterator[str]:
    """Yield a message for each member of a class that is misspelt or has no type."""
    varying = getattr(cls, "varying", ())
    if not (isinstance(varying, tuple) and all(_hints(cls).get(name) is int for name in varying)):
        yield f"{cls.__name__}.varying must be a tuple of names of parameters that are integers."
    optional = {*OPTIONAL_METHODS.get(kind, ()), *OPTIONAL_ATTRIBUTES.get(kind, ()), *OF_ALL}
    contracts = [CONTRACTS[kind], CONTRACTS["estimator"]] if kind == "filter" else [CONTRACTS[kind]]
    required = {name for of in contracts for name in (*vars(of), *vars(of).get("__annotations__", ()))}
    known = optional | required | {f.name for f in dataclasses.fields(cls)}
    for base in (base for base in cls.__mro__ if base.__module__ not in NOT_OURS):
        typed = vars(base).get("__annotations__", {})
        for name in _public(name for name in vars(base) if name not in known):
            value, member = vars(base)[name], f"{cls.__name__}.{name}"
            if meant := difflib.get_close_matches(name, optional, 1, MISSPELT):
                yield f"{member} is not used. Did you mean {meant[0]}? Rename it to that, or to a less similar name."
            elif name.islower() and isinstance(value, PARAMETERS) and name not in typed:
                annotation = type(value).__name__
                constant = f"{name}: ClassVar[{annotation}] if it is a constant"
                typed_name = f"{name}: {annotation} = {value!r}"
                yield f"{member} has no type, so it is not a parameter; write {typed_name}, or {constant}."


def _public(names: Iterable[str]) -> list[str]:
    return [name for name in names if not name.startswith("_")]
