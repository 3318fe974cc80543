"""The catalogue of plugins (described by their docstrings) and presets (described by their files)."""

import dataclasses
import inspect
import itertools
import json
import typing
from collections import Counter
from typing import Any, NamedTuple

from jerkbench import plugins
from jerkbench.errors import PluginError, notify, unknown
from jerkbench.parameters import origins_of, provenance_of, ranges_of
from jerkbench.presets import preset_files

PRESET_GROUPS = ("noise", "experiment")
"""Groups that contain only presets."""


class CatalogueEntry(NamedTuple):
    """A plugin or preset in the catalogue.

    Attributes:
        name: Name of the plugin or preset on the command line.
        summary: Description of the plugin or preset in one line.
        preset: True for a preset, which is a file, and False for a plugin, which is a class.
        package: Name of the package that defines the plugin.
        provenance: Provenance of a method ("published", "simplified" or "own"), or an empty string if not declared.
    """

    name: str
    summary: str
    preset: bool = False
    package: str = "jerkbench"
    provenance: str = ""

    @property
    def line(self) -> str:
        """The summary, followed by the provenance and the package of a plugin, or by "(preset)"."""
        if self.preset:
            return f"{self.summary} (preset)"
        notes = ", ".join(filter(None, [self.provenance, self.package if self.package != "jerkbench" else ""]))
        return f"{self.summary} [{notes}]" if notes else self.summary


def requested_kinds(kind: str | None) -> tuple[str, ...]:
    """Return a tuple with only ``kind``, or with all kinds if ``kind`` is None.

    Raises:
        PluginError: The kind is unknown.
    """
    kinds = (*plugins.KINDS, *PRESET_GROUPS)
    if kind is not None and kind not in kinds:
        raise PluginError(unknown("kind", kind, kinds))
    return (kind,) if kind else kinds


def entries(kind: str) -> list[CatalogueEntry]:
    """Return the plugins and presets of a kind, sorted by name. Print a notice if a plugin cannot be loaded."""
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
        PluginError: The name is unknown. The error message lists the known plugins and presets.
    """
    presets = preset_files(kind)
    if kind in PRESET_GROUPS:
        raise PluginError(unknown(kind, name, presets))
    if kind in plugins.KINDS and name not in plugins.names(kind):
        raise PluginError(plugins.no_such(kind, name, presets))
    return plugins.get(kind, name)


# The output of `jerkbench list` and `jerkbench show`.


def list_text(kind: str | None = None) -> str:
    """Return text that lists the plugins and presets with a description in one line, for all kinds or for one kind.

    Raises:
        PluginError: The kind is unknown.
    """
    blocks = []
    for title in requested_kinds(kind):
        listed = entries(title)
        width = max((len(entry.name) for entry in listed), default=0)
        counted = Counter(entry.provenance for entry in listed if entry.provenance)
        counts = f" ({', '.join(f'{count} {name}' for name, count in counted.most_common())})" if counted else ""
        blocks.append("\n".join([f"{title}{counts}", *(f"  {entry.name:<{width}}  {entry.line}" for entry in listed)]))
    return "\n\n".join(blocks)


def show_text(kind: str, name: str) -> str:
    """Return the documentation of one plugin, or the content of one preset.

    Raises:
        PluginError: The name is unknown.
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
    """Return the docstring of a plugin and the docstrings of its base classes that are dataclasses."""
    family = [c for c in cls.__mro__ if dataclasses.is_dataclass(c)]
    return [inspect.cleandoc(c.__doc__ or "It has no docstring.") for c in family]


def _defaults(cls: type) -> str:
    """Return a text with the default value, the origin and the tuning range of each parameter."""
    parameters, ranges = _parameters(cls), ranges_of(cls)
    if not parameters:
        return "It has no parameters."
    width = max(len(parameter["name"]) for parameter in parameters)
    values = (repr(parameter["default"]) if "default" in parameter else "(required)" for parameter in parameters)
    lines = [f"    {parameter['name']:<{width}} = {value}" for parameter, value in zip(parameters, values, strict=True)]
    known = [parameter for parameter in parameters if "origin" in parameter or "range" in parameter]
    more = ["", "Origin of the defaults, and range for `jerkbench tune`:"] if known else []
    for parameter in known:
        more.append(f"    {parameter['name']}: {parameter.get('origin', 'unknown')}")
        if bounds := ranges.get(parameter["name"]):
            more.append(f"        range {bounds} ({bounds.source})")
    return "\n".join(["Defaults:", *lines, *more])


def home(cls: type) -> str:
    """Return the module and the name of a class."""
    return f"{cls.__module__}.{cls.__qualname__}"


# The catalogue as plain data for JSON.


def listed_json(kind: str | None = None) -> dict[str, list[dict[str, Any]]]:
    """Return the catalogue entries as dictionaries, by kind, for all kinds or for one kind.

    Raises:
        PluginError: The kind is unknown.
    """
    return {name: [entry._asdict() for entry in entries(name)] for name in requested_kinds(kind)}


def shown_json(kind: str, name: str) -> dict[str, Any]:
    """Return the documentation and the parameters of a plugin, or the values of a preset without resolved references.

    Raises:
        PluginError: The name is unknown.
    """
    presets = preset_files(kind)
    head = {"kind": kind, "name": name, "preset": name in presets}
    if name in presets:
        from omegaconf import OmegaConf

        values = json.dumps(OmegaConf.to_container(OmegaConf.load(presets[name])))
        return {**head, "values": json.loads(values, parse_constant=str)}  # text replaces infinity, which JSON lacks
    cls = plugin_class(kind, name)
    known = {"provenance": dataclasses.asdict(known)} if (known := provenance_of(cls)) else {}
    return {**head, **known, "docstrings": docstrings(cls), "parameters": _parameters(cls), "defined_in": home(cls)}


def _parameters(cls: type) -> list[dict[str, Any]]:
    """Return the name, type, default, origin and range of each parameter of a plugin, without undefined entries."""
    origins, types, missing = origins_of(cls), typing.get_type_hints(cls), dataclasses.MISSING
    ranges = {name: dataclasses.asdict(bounds) for name, bounds in ranges_of(cls).items()}
    parameters = []
    for f in dataclasses.fields(cls):
        hint, default = types[f.name], f.default if f.default_factory is missing else f.default_factory()
        kind = hint.__name__ if isinstance(hint, type) and not typing.get_args(hint) else str(hint)
        values = {"default": default, "origin": origins.get(f.name, missing), "range": ranges.get(f.name, missing)}
        known = {name: value for name, value in values.items() if value is not missing}
        parameters.append({"name": f.name, "type": kind, **known})
    return parameters
