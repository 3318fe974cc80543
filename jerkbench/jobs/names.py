"""A job from names and mappings, as Python code gives them; Hydra does the same for the command line."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, is_dataclass
from functools import partial
from typing import Any

from jerkbench import plugins
from jerkbench.contracts import Estimator, PerSeed, is_attitude_only, lacks_imu, preferred_attitude, uses_imu
from jerkbench.errors import PluginError, require_known
from jerkbench.jobs.job import Job, Noise, Protocol, build
from jerkbench.presets import default_names, merged_values, preset, preset_names
from jerkbench.renamed import new_name
from jerkbench.report.labels import labels_of

Part = Any
"""A plugin or a preset by its name, {"name": ..., parameter: value, ...}, or a plugin itself."""

Groups = Mapping[str, Part | None]


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


def job_of_parts(
    single: Groups,
    disturbances: Sequence[Part],
    noise: Part | None,
    protocol: Protocol,
    metrics: Sequence[str] = (),
    r_scale: Mapping[str, float] | None = None,
) -> Job:
    """Make the job that the parts describe, with the labels that it has on the command line.

    Args:
        single: a part for each group that holds one plugin; None: the default, for ``attitude`` that of the data set.
        disturbances: in order; empty: `none`.
        noise: a preset, or the fields to set, or both; None: the filter's own.
        protocol: its seeds, and how runs are judged.
        metrics: names of those to compute; empty: those that are cheap.
        r_scale: factors on the reported R, "position" and "velocity"; None: as reported.

    Raises:
        PluginError: something is unknown or does not fit together.
    """
    parts = {kind: _or_default(kind, part) for kind, part in single.items() if kind != "attitude"}
    choice = {kind: choose(kind, part) for kind, part in parts.items()}
    preferred = preferred_attitude(plugins.get("dataset", choice["dataset"].plain["name"]))
    choice["attitude"] = choose("attitude", single["attitude"] or preferred or default_names()["attitude"])
    several = [choose("disturbance", part) for part in disturbances or [default_names()["disturbance"]]]
    process = noise_of(noise)
    spec: dict[str, Any] = {kind: part.plain for kind, part in choice.items()}
    spec["disturbance"] = [plain for part in several for plain in part.plain.values()]
    spec["noise"], spec["r_scale"] = process.plain, dict(r_scale or {})
    spec["metrics"] = list(metrics)
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
    name = new_name(kind, name)
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
        return ChosenPlugin(name, words(kind, parameters), merged_values(below, parameters))
    parameters = {new_name(kind, key): value for key, value in parameters.items()}
    for key, value in parameters.items():  # each is the parameters of one of the preset's disturbances
        require_known(f"disturbance in the preset {name}", key, below)
        if not isinstance(value, dict):
            raise PluginError(f"disturbance {name}, '{key}' is {value!r}; give its parameters: {{parameter: value}}.")
    overrides = [word for key, values in parameters.items() for word in words(f"{kind}.{key}", values)]
    return ChosenPlugin(name, overrides, merged_values(below, parameters))


def plugin_of(kind: str, part: Part | None) -> Any:  # noqa: ANN401 - the kind decides the contract
    """Return the plugin itself that ``part`` stands for; None: the default. One that is given need not be registered.

    Raises:
        PluginError: something is unknown or does not fit together.
    """
    return part if is_plugin(part) else plugins.create(kind, choose(kind, _or_default(kind, part)).plain)


def is_plugin(part: object) -> bool:
    """Whether ``part`` is a plugin itself, no name of one."""
    return is_dataclass(part) and not isinstance(part, type)


def noise_of(part: Part | None) -> ChosenPlugin:
    """Return the process noise that replaces the filter's own; the group has presets only.

    Raises:
        PluginError: there is no such preset or parameter.
    """
    own = default_names()["noise"]
    name, parameters = _split("noise", part if isinstance(part, str) else {"name": own, **(part or {})})
    known = [f.name for f in fields(Noise)]
    for key in parameters:
        require_known("parameter of noise", key, known)
    name = new_name("noise", name)
    require_known("noise", name, preset_names("noise"))
    return _preset("noise", name, parameters)


def _or_default(kind: str, part: Part | None) -> Part:
    return default_names()[kind] if part is None else part


def _split(kind: str, part: Part) -> tuple[str, dict[str, Any]]:
    """The name, and the parameters given with it; of a plugin itself, those that are not its defaults."""
    if isinstance(part, str):
        return part, {}
    if is_plugin(part):  # stored results know it by its name
        name = next((name for name in plugins.names(kind) if plugins.get(kind, name) is type(part)), "")
        if not name:
            own = type(part).__name__
            raise PluginError(
                f"{own} has no name to store results by; write @jerkbench.register('{kind}', NAME) above it."
            )
        usual = {f.name: f.default_factory() if callable(f.default_factory) else f.default for f in fields(part)}
        return name, {key: value for key, value in asdict(part).items() if value != usual[key]}
    if "name" not in part:
        raise PluginError(f"{kind} is {dict(part)}, which has no name; give {{'name': ..., parameter: value}}.")
    parameters = {key: dict(value) if isinstance(value, Mapping) else value for key, value in part.items()}
    return str(parameters.pop("name")), parameters


def words(owner: str, parameters: Mapping[str, Any]) -> list[str]:
    """Return parameters as overrides of the command line."""
    dumps = partial(json.dumps, separators=(",", ":"), default=str)
    return [f"{owner}.{key}={value if isinstance(value, str) else dumps(value)}" for key, value in parameters.items()]


# The refusal of a combination: a filter that does not take the data set, or the adaptation.


def refusal(job: Job) -> str:
    """Return why the filter does not take the data set or the adaptation, or an empty string."""
    dataset, model = job.scenario.dataset, job.method.filter
    if is_attitude_only(dataset) and not is_attitude_only(model):
        return _lacking(job, "position to navigate by", _filters(is_attitude_only))
    if lacks_imu(dataset) and uses_imu(model):
        return _lacking(job, "IMU", _filters(lambda cls: not uses_imu(cls)))
    if isinstance(model, PerSeed) and not model.for_each_seed and len(job.draws) > 1:
        return (
            f"the filter {job.labels.filter} has one file for {len(job.draws)} runs; write {{seed}} in the place"
            " of the seed in its name, or give seeds=1"
        )
    name = job.spec["adaptation"]["name"]
    if not isinstance(model, Estimator) or name in model.adaptations:
        return ""
    accepted = ", ".join(model.adaptations)
    return f"the filter {job.spec['filter']['name']} takes no adaptation '{name}', only: {accepted}"


def require_sensible(job: Job) -> None:
    """Refuse a combination that makes no sense.

    Raises:
        PluginError: the filter does not take the data set or the adaptation.
    """
    if reason := refusal(job):
        raise PluginError(f"This combination makes no sense: {reason}.")


def _lacking(job: Job, stream: str, filters: Sequence[str]) -> str:
    dataset, model = (job.spec[kind]["name"] for kind in ("dataset", "filter"))
    return (
        f"the data set {dataset} has no {stream}, so the filter {model} cannot run over it, only: {', '.join(filters)}"
    )


def _filters(fits: Callable[[type], bool]) -> list[str]:
    """The filters whose class fits."""
    return [name for name in plugins.names("filter") if fits(plugins.get("filter", name))]
