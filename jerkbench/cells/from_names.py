"""A cell from names and mappings, as Python code gives them; Hydra does the same for the command line."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from jerkbench import plugins
from jerkbench.cells.cell import Cell, Protocol, build
from jerkbench.cells.labels import labels_of
from jerkbench.cells.noise import Noise
from jerkbench.errors import PluginError, unknown
from jerkbench.optional import preferred_attitude
from jerkbench.presets import merged, preset, preset_names

Part = str | Mapping[str, Any]
"""A plugin or a preset by its name, or {"name": ..., parameter: value, ...}."""

DEFAULT_ATTITUDE = "field"
"""The attitude filter for a data set that names none."""


@dataclass(frozen=True)
class ChosenPlugin:
    """A part of a combination.

    Attributes:
        name: what was chosen: a plugin or a preset.
        overrides: what was given with it, as the command line has it: "filter.accel_mps2=0.2".
        plain: the plugin's name and its parameters; of disturbances, such a mapping under each name.
    """

    name: str
    overrides: list[str]
    plain: dict[str, Any]


def cell_of_parts(
    single: Mapping[str, Part | None], disturbances: Sequence[Part], noise: Part | None, protocol: Protocol
) -> Cell:
    """Make the cell that the parts describe, with the labels that it has on the command line.

    Args:
        single: a part for each group that holds one plugin; ``attitude`` may be None: what the data set prefers.
        disturbances: in order; empty: `none`.
        noise: a preset, or the fields to set, or both; None: the filter's own.
        protocol: how it is run and scored.

    Raises:
        PluginError: something is unknown or does not fit together.
    """
    parts = {**single, "attitude": single["attitude"] or _preferred_attitude(single["dataset"] or "")}
    choice = {kind: choose(kind, part or "") for kind, part in parts.items()}
    several = [choose("disturbance", part) for part in disturbances or ["none"]]
    process = _noise(noise or {})
    spec: dict[str, Any] = {kind: part.plain for kind, part in choice.items()}
    spec["disturbance"] = [plain for part in several for plain in part.plain.values()]
    spec["noise"] = process.plain
    choices = {kind: part.name for kind, part in {**choice, "noise": process}.items()}
    overrides = [f"disturbance=[{','.join(part.name for part in several)}]"]
    overrides += [word for part in (*choice.values(), *several, process) for word in part.overrides]
    return build(spec, protocol, labels_of(spec, choices, overrides))


def choose(kind: str, part: Part) -> ChosenPlugin:
    """Find a plugin or a preset, and put the given parameters over its own.

    Raises:
        PluginError: it has no name, or there is none of that name.
    """
    name, parameters = _split(kind, part)
    if name in preset_names(kind):
        return _preset(kind, name, parameters)
    if name not in plugins.names(kind):
        raise PluginError(plugins.no_such(kind, name, preset_names(kind)))
    plain = {**parameters, "name": name}
    if kind == "disturbance":
        return ChosenPlugin(name, words(f"{kind}.{name}", parameters), {name: plain})
    return ChosenPlugin(name, words(kind, parameters), plain)


def _preset(kind: str, name: str, parameters: dict[str, Any]) -> ChosenPlugin:
    below = preset(kind, name)
    if kind != "disturbance":
        return ChosenPlugin(name, words(kind, parameters), merged(below, parameters))
    for key, value in parameters.items():  # each is the parameters of one of the preset's disturbances
        if key not in below:
            raise PluginError(unknown(f"disturbance in the preset {name}", key, below))
        if not isinstance(value, dict):
            raise PluginError(f"disturbance {name}, '{key}' is {value!r}; give its parameters: {{parameter: value}}.")
    overrides = [word for key, values in parameters.items() for word in words(f"{kind}.{key}", values)]
    return ChosenPlugin(name, overrides, merged(below, parameters))


def _noise(part: Part) -> ChosenPlugin:
    """The group ``noise`` has presets only; without a name, the fields are set over none of them."""
    name, parameters = _split("noise", part if isinstance(part, str) else {"name": "own", **part})
    known = [f.name for f in fields(Noise)]
    for key in parameters:
        if key not in known:
            raise PluginError(unknown("parameter of noise", key, known))
    if name not in preset_names("noise"):
        raise PluginError(unknown("noise", name, preset_names("noise")))
    return _preset("noise", name, parameters)


def _preferred_attitude(dataset: Part) -> str:
    """The attitude filter that the data set names in ``default_attitude``."""
    cls = plugins.get("dataset", choose("dataset", dataset).plain["name"])
    return preferred_attitude(cls) or DEFAULT_ATTITUDE


def _split(kind: str, part: Part) -> tuple[str, dict[str, Any]]:
    """The name, and the parameters given with it."""
    if isinstance(part, str):
        return part, {}
    if "name" not in part:
        raise PluginError(f"{kind} is {dict(part)}, which has no name; give {{'name': ..., parameter: value}}.")
    parameters = {key: dict(value) if isinstance(value, Mapping) else value for key, value in part.items()}
    return str(parameters.pop("name")), parameters


def words(owner: str, parameters: Mapping[str, Any]) -> list[str]:
    """Return parameters as overrides of the command line."""
    return [f"{owner}.{key}={_word(value)}" for key, value in parameters.items()]


def _word(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value, separators=(",", ":"), default=str)
