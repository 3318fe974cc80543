"""The answers of `jerkbench list` and `jerkbench show` as a program reads them: plain values, ready for JSON."""

import dataclasses
import typing
from typing import Any

from jerkbench.catalogue.entries import entries, kinds_asked, plugin_class, preset_files
from jerkbench.catalogue.text import docstrings, home
from jerkbench.parameters import origins_of, ranges_of


def listed(kind: str | None = None) -> dict[str, list[dict[str, Any]]]:
    """Return for each kind, or for ``kind``, every name with its summary, its package, and whether it is a preset.

    Raises:
        PluginError: no such kind.
    """
    return {name: [entry._asdict() for entry in entries(name)] for name in kinds_asked(kind)}


def shown(kind: str, name: str) -> dict[str, Any]:
    """Return all there is to know of one plugin or preset; of a preset its values as they stand in its file.

    Raises:
        PluginError: there is none of that name.
    """
    presets = preset_files(kind)
    head = {"kind": kind, "name": name, "preset": name in presets}
    if name in presets:
        from omegaconf import OmegaConf

        return {**head, "values": OmegaConf.to_container(OmegaConf.load(presets[name]))}
    cls = plugin_class(kind, name)
    return {**head, "docstrings": docstrings(cls), "parameters": _parameters(cls), "defined_in": home(cls)}


def _parameters(cls: type) -> list[dict[str, Any]]:
    """Return each field with its type, its default (none: it has to be given), its origin and its range."""
    origins, ranges, types = origins_of(cls), ranges_of(cls), typing.get_type_hints(cls)
    parameters = []
    for f in dataclasses.fields(cls):
        parameter: dict[str, Any] = {"name": f.name, "type": _type_text(types[f.name]), **_default(f)}
        if f.name in origins:
            parameter["origin"] = origins[f.name]
        if f.name in ranges:
            parameter["range"] = dataclasses.asdict(ranges[f.name])
        parameters.append(parameter)
    return parameters


def _default(f: "dataclasses.Field[Any]") -> dict[str, Any]:
    if f.default_factory is not dataclasses.MISSING:
        return {"default": f.default_factory()}
    return {} if f.default is dataclasses.MISSING else {"default": f.default}


def _type_text(hint: Any) -> str:  # noqa: ANN401 - a type, or what typing makes of one
    return hint.__name__ if isinstance(hint, type) and not typing.get_args(hint) else str(hint)
