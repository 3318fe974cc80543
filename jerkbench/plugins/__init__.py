"""The registries: a frozen dataclass with a decorator, or an entry point, is a plugin.

A plugin's fields are its parameters, its Hydra schema and its documentation at once. In this package it is
registered by `register`; in anybody else's by an entry point in the group ``jerkbench.<kind>``, whose name is the
plugin's name. What each kind has to offer is written in `jerkbench.contracts`.
"""

import dataclasses
import importlib
import json
import pkgutil
import typing
from collections.abc import Callable, Iterable, Mapping
from functools import cache, lru_cache, partial
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any, TypeVar

from jerkbench.errors import PluginError, require_known, unknown
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
"""Each kind of plugin, in the order of the data's way, and the package where the tree's own ones live."""

KINDS = tuple(PACKAGES)

_registry: dict[str, dict[str, type]] = {kind: {} for kind in KINDS}

_left_out: dict[str, dict[str, str]] = {kind: {} for kind in KINDS}

Class = TypeVar("Class", bound=type)


def register(kind: str, name: str) -> Callable[[Class], Class]:
    """Register the decorated frozen dataclass as the plugin ``name`` of ``kind``.

    Raises:
        PluginError: no such kind, not a frozen dataclass, or the name is taken by another class.
    """

    def add(cls: Class) -> Class:
        _add(kind, name, cls)
        return cls

    return add


def get(kind: str, name: str) -> type:
    """Return the class of a plugin.

    Raises:
        PluginError: there is none; says what there is and the nearest match.
    """
    known, today = _of_kind(kind), new_name(kind, name)
    if today not in known:
        raise PluginError(no_such(kind, name))
    return known[today]


def left_out(kind: str) -> Mapping[str, str]:
    """Return the entry points of ``kind`` that could not be loaded: for each name a sentence that says why."""
    _of_kind(kind)
    return _left_out[kind]


def no_such(kind: str, name: str, presets: Iterable[str] = ()) -> str:
    """Say why there is no plugin ``name`` of ``kind``, which may be a preset as well."""
    return left_out(kind).get(name) or unknown(kind, name, [*names(kind), *presets])


def is_own(cls: type) -> bool:
    """Whether the plugin is one of this package's."""
    return cls.__module__.partition(".")[0] == "jerkbench"


def modules_of_user() -> list[str]:
    """Return the modules that a new process has to import to know the same plugins.

    It finds those of this package and of entry points by itself. It cannot import the script that is running.
    """
    classes = {cls for known in _registry.values() for cls in known.values() if not is_own(cls)}
    found = {entry.module for kind in KINDS for entry in entry_points(group=f"jerkbench.{kind}")}
    modules = {cls.__module__ for cls in classes if not of_script(cls)} - found
    return sorted(module for module in modules if _is_importable(module.partition(".")[0]))


def _is_importable(package: str) -> bool:
    try:
        return find_spec(package) is not None
    except ValueError:  # made by hand, as a notebook does: it has no origin
        return False


def of_script(cls: type) -> bool:
    """Whether a class is defined in the script or notebook that is running, where no other process finds it."""
    return cls.__module__ == "__main__"


def any_of_script() -> bool:
    """Whether a plugin is registered that no other process finds."""
    return any(of_script(cls) for known in _registry.values() for cls in known.values())


def names(kind: str) -> list[str]:
    """Names of all plugins of ``kind``, sorted."""
    return sorted(_of_kind(kind))


def create(kind: str, config: Mapping[str, Any]) -> Any:  # noqa: ANN401 - the kind decides the contract
    """Make a plugin from ``{"name": ..., field: value, ...}``.

    Raises:
        PluginError: unknown name or field, or a value of the wrong type; names the plugin and the field.
    """
    from omegaconf import MISSING
    from omegaconf.errors import OmegaConfBaseException

    name = str(config.get("name"))
    cls = get(kind, name)
    known = _defaults(cls)
    for key in config:
        if key not in (*known, "name"):
            raise PluginError(unknown(f"parameter of {kind} {name}", str(key), list(known)))
    try:
        given = {key: value for key, value in config.items() if key != "name" and repr(_as_lists(value)) != known[key]}
        lacking = {key: MISSING for key, default in known.items() if not default and key not in given}
        values = converted(kind, name, {**given, **lacking}, resolve=True)
    except OmegaConfBaseException as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise PluginError(f"{kind} {name}, parameter '{error.full_key}': {reason}.") from error
    return cls(**_fitted(f"{kind} {name}", cls, values))


def converted(kind: str, name: str, values: Mapping[str, Any], *, resolve: bool = False) -> dict[str, Any]:
    """Return ``values`` of fields of a plugin as its schema has them; what refers to another is as it stands there.

    Args:
        kind: of the plugin.
        name: of the plugin.
        values: by field.
        resolve: put what is referred to in the place of references.

    Raises:
        OmegaConfBaseException: there is no such field, a value has the wrong type, or (``resolve``) is not given.
    """
    cls = get(kind, name)
    if "${" in repr(values):
        return _merged(kind, name, cls, values, resolve)
    known = {key: json.dumps(value) for key, value in values.items() if type(value) in (bool, int, float, str)}
    others = {key: value for key, value in values.items() if key not in known}
    types = {key: hint for key, hint in _hints(cls).items() if key in _defaults(cls) and hint in (bool, int, float)}
    fields = {
        key: values[key] if types.get(key) is type(values[key]) else _field(kind, name, cls, key, text, resolve)
        for key, text in known.items()
    }
    return fields | (_merged(kind, name, cls, others, resolve) if others else {})


@lru_cache(maxsize=4096)
def _field(kind: str, name: str, cls: type, key: str, text: str, resolve: bool) -> Any:  # noqa: ANN401 - a field's value
    """A field from its value as JSON, read once: of a grid each is asked for again and again."""
    return _merged(kind, name, cls, {key: json.loads(text)}, resolve)[key]


def _merged(kind: str, name: str, cls: type, values: Mapping[str, Any], resolve: bool) -> dict[str, Any]:
    from omegaconf import OmegaConf

    merged = OmegaConf.merge(_structured(kind, name, cls, frozenset(values)), dict(values))  # which copies the first
    plain = typing.cast("dict[str, Any]", OmegaConf.to_container(merged, resolve=resolve, throw_on_missing=resolve))
    return {key: plain[key] for key in values}


@cache
def _defaults(cls: type) -> dict[str, str]:
    """The text of each field's default, as a configuration has it; empty where there is none."""
    return {
        f.name: "" if (value := _default(f)) is dataclasses.MISSING else repr(value) for f in dataclasses.fields(cls)
    }


def _default(f: "dataclasses.Field[Any]") -> Any:  # noqa: ANN401 - a field's value
    return _as_lists(f.default) if f.default_factory is dataclasses.MISSING else f.default_factory()


@cache
def _structured(kind: str, name: str, cls: type, only: frozenset[str]) -> Any:  # noqa: ANN401 - a configuration
    """Some fields of a plugin as OmegaConf has them: to make, or copy, all takes longer than to make the plugin."""
    from omegaconf import OmegaConf

    del cls  # the name may stand for another one by now
    return OmegaConf.structured(schema(kind, name, only))


def schema(kind: str, name: str, only: frozenset[str] | None = None) -> type:
    """Return the Hydra schema of a plugin: its fields (or some) and defaults, with the field ``name`` before them.

    A copy, because OmegaConf makes the configuration of a frozen dataclass read-only.
    """
    cls = get(kind, name)
    hints = {key: _as_list(hint) for key, hint in _hints(cls).items()}
    fields: list[tuple[str, Any, Any]] = [("name", str, name)]
    for f in (f for f in dataclasses.fields(cls) if only is None or f.name in only):
        if f.default_factory is not dataclasses.MISSING or isinstance(f.default, tuple):
            fields.append((f.name, hints[f.name], dataclasses.field(default_factory=partial(_default, f))))
        else:
            fields.append((f.name, hints[f.name], "???" if f.default is dataclasses.MISSING else f.default))
    return dataclasses.make_dataclass(cls.__name__, fields)


@cache
def _hints(cls: type) -> dict[str, Any]:
    return typing.get_type_hints(cls)


def _add(kind: str, name: str, cls: type) -> None:
    require_known("kind of plugin", kind, KINDS)
    if not (dataclasses.is_dataclass(cls) and cls.__dataclass_params__.frozen):  # type: ignore[attr-defined]
        raise PluginError(
            f"{kind} {name}: {cls.__name__} is not a frozen dataclass; write @dataclass(frozen=True) above it."
        )
    from jerkbench.plugins.members import misfits  # imports the contracts, which `--help` does not need

    if found := list(misfits(kind, cls)):
        raise PluginError(f"{kind} {name}: {' '.join(found)}")
    owner = _registry[kind].get(name)
    if owner is not None and (owner.__module__, owner.__qualname__) != (cls.__module__, cls.__qualname__):
        raise PluginError(
            f"{kind} {name} is already {owner.__module__}.{owner.__qualname__}; choose another name than that."
        )
    _registry[kind][name] = cls
    PLUGIN_TITLES[cls] = f"{kind} {name}: "


def _of_kind(kind: str) -> dict[str, type]:
    require_known("kind of plugin", kind, KINDS)
    _import_own(kind)
    _import_entry_points(kind)
    return _registry[kind]


@cache
def _import_own(kind: str) -> None:
    """Import every module of the kind's package, so that its decorators run."""
    package = importlib.import_module(PACKAGES[kind])
    for module in pkgutil.iter_modules(package.__path__, prefix=f"{package.__name__}."):
        importlib.import_module(module.name)


@cache
def _import_entry_points(kind: str) -> None:
    for entry in entry_points(group=f"jerkbench.{kind}"):
        try:
            _add(kind, entry.name, entry.load())
        except Exception as error:  # noqa: BLE001 - whatever a third party's module raises, the others must still work
            _left_out[kind][entry.name] = _failed(kind, entry, error)


def _failed(kind: str, entry: EntryPoint, error: Exception) -> str:
    owner = f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value
    reason = " ".join(str(error).split())
    return f"{kind} '{entry.name}' of {owner} is left out: {type(error).__name__}: {reason}"


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
    """Turn tuple[T, ...] into list[T]. Hydra knows no nested tuples: inside, `_fit` does the checking."""
    items = [item for item in typing.get_args(hint) if item is not Ellipsis]
    if typing.get_origin(hint) is not tuple:
        return hint
    return list[Any] if typing.get_origin(items[0]) is tuple else list[items[0]]  # type: ignore[valid-type]


def _as_lists(value: Any) -> Any:  # noqa: ANN401 - a field's value
    return [_as_lists(item) for item in value] if isinstance(value, tuple) else value


def _fit(value: Any, hint: Any) -> Any:  # noqa: ANN401 - a field's value and its type hint
    """Turn lists back into the tuples that the field declares."""
    if typing.get_origin(hint) is not tuple:
        return float(value) if hint is float else value
    if not isinstance(value, list):
        raise TypeError(f"{value!r} is not a list")
    return tuple(_fit(item, typing.get_args(hint)[0]) for item in value)
