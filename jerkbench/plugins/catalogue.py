"""The entries of the catalogue: plugins from their docstrings, presets from their files."""

import dataclasses
import inspect
import itertools
import json
import typing
from collections import Counter
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

    @property
    def line(self) -> str:
        """Return the summary with the provenance and the package, or the word preset."""
        if self.preset:
            return f"{self.summary} (preset)"
        notes = ", ".join(filter(None, [self.provenance, self.package if self.package != "jerkbench" else ""]))
        return f"{self.summary} [{notes}]" if notes else self.summary


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
    """Return the plugins and presets of a kind, sorted by name, with a notice for each plugin that cannot be loaded."""
    found = {}
    for name in plugins.names(kind) if kind in plugins.KINDS else ():
        cls = plugins.get(kind, name)
        summary, package = (inspect.getdoc(cls) or "").split("\n", 1)[0], cls.__module__.partition(".")[0]
        known = provenance_of(cls)
        found[name] = CatalogueEntry(name, summary, package=package, provenance=known.kind if known else "")
    for message in plugins.left_out(kind).values() if kind in plugins.KINDS else ():
        notify(message)
    for name, path in preset_files(kind).items():
        lines = itertools.takewhile(lambda line: line.startswith("#"), path.read_text(encoding="utf-8").splitlines())
        comment = " ".join(line.lstrip("# ") for line in lines if "@package" not in line)
        found[name] = CatalogueEntry(name, comment.split(". ")[0].rstrip(".") + ".", preset=True)
    return [found[name] for name in sorted(found)]


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


# The output of `jerkbench list` and `jerkbench show`


def list_text(kind: str | None = None) -> str:
    """Return every name with one line about it, of all kinds or of one.

    Raises:
        PluginError: there is no such kind.
    """
    blocks = []
    for title in kinds_asked(kind):
        listed = entries(title)
        width = max((len(entry.name) for entry in listed), default=0)
        counted = Counter(entry.provenance for entry in listed if entry.provenance)
        counts = f" ({', '.join(f'{count} {name}' for name, count in counted.most_common())})" if counted else ""
        blocks.append("\n".join([f"{title}{counts}", *(f"  {entry.name:<{width}}  {entry.line}" for entry in listed)]))
    return "\n\n".join(blocks)


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


# The same as plain values for JSON


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
        hint = types[f.name]
        default = f.default if f.default_factory is dataclasses.MISSING else f.default_factory()
        named = isinstance(hint, type) and not typing.get_args(hint)
        parameter: dict[str, Any] = {"name": f.name, "type": hint.__name__ if named else str(hint)}
        if default is not dataclasses.MISSING:
            parameter["default"] = default
        if f.name in origins:
            parameter["origin"] = origins[f.name]
        if f.name in ranges:
            parameter["range"] = dataclasses.asdict(ranges[f.name])
        parameters.append(parameter)
    return parameters
