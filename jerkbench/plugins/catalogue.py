"""The entries of the catalogue: plugins from their docstrings, presets from their files."""

import dataclasses
import inspect
import itertools
import json
import typing
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from jerkbench import plugins
from jerkbench.errors import PluginError, unknown
from jerkbench.notices import notify
from jerkbench.parameters import origins_of, provenance_of, ranges_of
from jerkbench.presets import preset_files

PRESET_GROUPS = ("noise", "experiment")
"""Groups that hold presets only."""


class CatalogueEntry(NamedTuple):
    """One name of the catalogue.

    Attributes:
        name: as one types it.
        summary: one line about it.
        preset: whether it is a file of values, and no class.
        package: the distribution's package that it comes from.
        provenance: of a method: "published", "simplified" or "own".
    """

    name: str
    summary: str
    preset: bool = False
    package: str = "jerkbench"
    provenance: str = ""


def kinds_asked(kind: str | None) -> tuple[str, ...]:
    """Return ``kind`` alone, or every kind.

    Raises:
        PluginError: no such kind.
    """
    kinds = (*plugins.KINDS, *PRESET_GROUPS)
    if kind is not None and kind not in kinds:
        raise PluginError(unknown("kind", kind, kinds))
    return (kind,) if kind else kinds


def kind_of(name: str) -> str:
    """Return the kind of which there is a ``name``.

    Raises:
        PluginError: there is none, or there are several.
    """
    names = {
        kind: {*(plugins.names(kind) if kind in plugins.KINDS else ()), *preset_files(kind)}
        for kind in kinds_asked(None)
    }
    having = [kind for kind, of in names.items() if name in of]
    if name in names:
        raise PluginError(f"{name} is a kind: jerkbench list {name}, or jerkbench show {name} NAME.")
    if not having:
        raise PluginError(unknown("plugin or preset", name, set().union(*names.values())))
    if len(having) > 1:
        words = " or ".join(f"jerkbench show {kind} {name}" for kind in having)
        raise PluginError(f"{name} names {len(having)} things; give the kind: {words}.")
    return having[0]


def entries(kind: str) -> list[CatalogueEntry]:
    """Return what there is of a kind, sorted by name; a plugin that cannot be loaded is left out, with a notice."""
    by_name = {entry.name: entry for entry in _plugins(kind)} if kind in plugins.KINDS else {}
    for sentence in plugins.left_out(kind).values() if kind in plugins.KINDS else ():
        notify(sentence)
    by_name |= {
        name: CatalogueEntry(name, _first_comment(path), preset=True) for name, path in preset_files(kind).items()
    }
    return [by_name[name] for name in sorted(by_name)]


def plugin_class(kind: str, name: str) -> type:
    """Return the class of a plugin.

    Raises:
        PluginError: there is none of that name; says what there is, presets too.
    """
    presets = preset_files(kind)
    if kind in PRESET_GROUPS:
        raise PluginError(unknown(kind, name, presets))
    if kind in plugins.KINDS and name not in plugins.names(kind):
        raise PluginError(plugins.no_such(kind, name, presets))
    return plugins.get(kind, name)


def _plugins(kind: str) -> Iterator[CatalogueEntry]:
    for name in plugins.names(kind):
        cls = plugins.get(kind, name)
        summary, package = (inspect.getdoc(cls) or "").split("\n", 1)[0], cls.__module__.partition(".")[0]
        known = provenance_of(cls)
        yield CatalogueEntry(name, summary, package=package, provenance=known.kind if known else "")


def _first_comment(path: Path) -> str:
    """The first sentence of the comment at the top of a preset."""
    comment = itertools.takewhile(lambda line: line.startswith("#"), path.read_text(encoding="utf-8").splitlines())
    text = " ".join(line.lstrip("# ") for line in comment if "@package" not in line)
    return text.split(". ")[0].rstrip(".") + "."


# The answers of `jerkbench list` and `jerkbench show` as a person reads them.


def list_text(kind: str | None = None) -> str:
    """Every name with one line about it, of every kind or of ``kind``.

    Raises:
        PluginError: no such kind.
    """
    return "\n\n".join(_list_kind(name) for name in kinds_asked(kind))


def show_text(kind: str, name: str) -> str:
    """All there is to know of one plugin or preset.

    Raises:
        PluginError: there is none of that name.
    """
    presets = preset_files(kind)
    if name in presets:
        return f"{kind} {name}: a preset\n\n{presets[name].read_text(encoding='utf-8').rstrip()}"
    cls = plugin_class(kind, name)
    first = dataclasses.fields(cls)[:1] if kind == "disturbance" else ()
    usage = [f"On the command line: disturbance={name} disturbance.{name}.{f.name}=..." for f in first]
    known = [f"Method: {known}"] if (known := provenance_of(cls)) else []
    return "\n\n".join([f"{kind} {name}", *docstrings(cls), *known, _defaults(cls), *usage, f"Defined in {home(cls)}."])


def docstrings(cls: type) -> list[str]:
    """Return the docstrings of a plugin and of those that it varies; the equations stand with the first."""
    family = [c for c in cls.__mro__ if dataclasses.is_dataclass(c)]
    return [inspect.cleandoc(c.__doc__ or "It has no docstring.") for c in family]


def _list_kind(kind: str) -> str:
    listed = entries(kind)
    width = max((len(entry.name) for entry in listed), default=0)
    counted = Counter(entry.provenance for entry in listed if entry.provenance)
    heading = f"{kind} ({', '.join(f'{count} {name}' for name, count in counted.most_common())})" if counted else kind
    return "\n".join([heading, *(f"  {entry.name:<{width}}  {_line(entry)}" for entry in listed)])


def _line(entry: CatalogueEntry) -> str:
    if entry.preset:
        return f"{entry.summary} (preset)"
    said = ", ".join(filter(None, [entry.provenance, entry.package if entry.package != "jerkbench" else ""]))
    return f"{entry.summary} [{said}]" if said else entry.summary


def _defaults(cls: type) -> str:
    """Each default; where it comes from, and within which bounds `jerkbench tune` looks for a better one."""
    parameters, ranges = _parameters(cls), ranges_of(cls)
    if not parameters:
        return "It has no parameters."
    width = max(len(own["name"]) for own in parameters)
    values = (repr(own["default"]) if "default" in own else "(has to be given)" for own in parameters)
    lines = [f"    {own['name']:<{width}} = {value}" for own, value in zip(parameters, values, strict=True)]
    known = [own for own in parameters if "origin" in own or "range" in own]
    more = ["", "Origin of the defaults, and range for `jerkbench tune`:"] if known else []
    for own in known:
        more.append(f"    {own['name']}: {own.get('origin', 'not said')}")
        if bounds := ranges.get(own["name"]):
            more.append(f"        range {bounds} ({bounds.source})")
    return "\n".join(["Defaults:", *lines, *more])


def home(cls: type) -> str:
    """Return where a class is defined."""
    return f"{cls.__module__}.{cls.__qualname__}"


# The answers of `jerkbench list` and `jerkbench show` as a program reads them: plain values, ready
# for JSON.


def listed_json(kind: str | None = None) -> dict[str, list[dict[str, Any]]]:
    """Return for each kind, or for ``kind``, every name with its summary, its package, and whether it is a preset.

    Raises:
        PluginError: no such kind.
    """
    return {name: [entry._asdict() for entry in entries(name)] for name in kinds_asked(kind)}


def shown_json(kind: str, name: str) -> dict[str, Any]:
    """Return all there is to know of one plugin or preset; of a preset its values as they stand in its file.

    Raises:
        PluginError: there is none of that name.
    """
    presets = preset_files(kind)
    head = {"kind": kind, "name": name, "preset": name in presets}
    if name in presets:
        from omegaconf import OmegaConf

        values = json.dumps(OmegaConf.to_container(OmegaConf.load(presets[name])))
        return {**head, "values": json.loads(values, parse_constant=str)}  # JSON has no infinity: it is text
    cls = plugin_class(kind, name)
    known = {"provenance": dataclasses.asdict(known)} if (known := provenance_of(cls)) else {}
    return {**head, **known, "docstrings": docstrings(cls), "parameters": _parameters(cls), "defined_in": home(cls)}


def _parameters(cls: type) -> list[dict[str, Any]]:
    """Return each field with its type, its default (none: it has to be given), its origin and its range."""
    origins, ranges, types = origins_of(cls), ranges_of(cls), typing.get_type_hints(cls)
    parameters = []
    for f in dataclasses.fields(cls):
        hint, default = types[f.name], f.default
        if f.default_factory is not dataclasses.MISSING:
            default = f.default_factory()
        parameter: dict[str, Any] = {
            "name": f.name,
            "type": hint.__name__ if isinstance(hint, type) and not typing.get_args(hint) else str(hint),
            **({} if default is dataclasses.MISSING else {"default": default}),
            **({"origin": origins[f.name]} if f.name in origins else {}),
            **({"range": dataclasses.asdict(ranges[f.name])} if f.name in ranges else {}),
        }
        parameters.append(parameter)
    return parameters
