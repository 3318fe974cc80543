"""Creation of jobs from names and mappings in Python code.

For the command line, Hydra creates the jobs instead of this module.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, is_dataclass
from functools import partial
from typing import Any

from jerkbench import plugins
from jerkbench.contracts import is_attitude_only, preferred_attitude, uses_imu
from jerkbench.errors import PluginError, require_known
from jerkbench.jobs.job import Job, Noise, Protocol, build
from jerkbench.presets import default_names, merged_values, preset, preset_files
from jerkbench.renamed import new_name
from jerkbench.report.labels import labels_of

Part = Any
"""The name of a plugin or preset, a mapping {"name": ..., parameter: value, ...}, or a plugin."""


@dataclass(frozen=True)
class SelectedPlugin:
    """A plugin or preset that was selected for a combination.

    Attributes:
        name: The name of the plugin or preset.
        overrides: The given parameters in the syntax of the command line, for example "filter.accel_mps2=0.2".
        plain: The name and all parameters of the plugin as a dictionary of plain data. For a preset of disturbances,
            ``plain`` maps the name of each disturbance to its plain data.
    """

    name: str
    overrides: list[str]
    plain: dict[str, Any]


def job_of_parts(
    single: Mapping[str, Part | None],
    disturbances: Sequence[Part],
    noise: Part | None,
    protocol: Protocol,
    metrics: Sequence[str] = (),
    r_scale: Mapping[str, float] | None = None,
) -> Job:
    """Create a job from plugins or their names. The labels of the job are the same as for a run from the command line.

    Args:
        single: The plugin of each kind of which a job has one. A plugin that is None is replaced by the default plugin.
            For the attitude filter, None selects the filter that the data set prefers.
        disturbances: The disturbances in the order of application. An empty list selects the disturbance `none`.
        noise: The name of a noise preset, or a mapping with fields of `Noise` and optionally a preset ("name"). If
            ``noise`` is None, the filter has its default process noise.
        protocol: The seeds and the parameters of the scoring.
        metrics: Names of the metrics. An empty list selects the default metrics.
        r_scale: Factors on the reported R, by the name of the measurement: "position" or "velocity". If ``r_scale`` is
            None, R is not scaled.

    Raises:
        PluginError: A plugin or parameter is unknown, or the plugins are not compatible.
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
    overrides += [override for part in (*choice.values(), *several, process) for override in part.overrides]
    return build(spec, protocol, labels_of(spec, choices, overrides))


def choose(kind: str, part: Part) -> SelectedPlugin:
    """Find a plugin or preset by name, and set the parameters that ``part`` contains.

    Raises:
        PluginError: ``part`` contains no name, or the name is unknown.
    """
    name, parameters = _split(kind, part)
    name = new_name(kind, name)
    if name in preset_files(kind):
        return _preset(kind, name, parameters)
    if name not in plugins.names(kind):
        raise PluginError(plugins.no_such(kind, name, preset_files(kind)))
    plain = {**parameters, "name": name}
    if kind == "disturbance":
        return SelectedPlugin(name, as_overrides(f"{kind}.{name}", parameters), {name: plain})
    return SelectedPlugin(name, as_overrides(kind, parameters), plain)


def _preset(kind: str, name: str, parameters: dict[str, Any]) -> SelectedPlugin:
    below = preset(kind, name)
    if kind != "disturbance":
        return SelectedPlugin(name, as_overrides(kind, parameters), merged_values(below, parameters))
    parameters = {new_name(kind, key): value for key, value in parameters.items()}
    for key, value in parameters.items():  # each key is the name of a disturbance in the preset
        require_known(f"disturbance in the preset {name}", key, below)
        if not isinstance(value, dict):
            raise PluginError(f"disturbance {name}: '{key}' is {value!r}; give its parameters as {{parameter: value}}.")
    overrides = [override for key, values in parameters.items() for override in as_overrides(f"{kind}.{key}", values)]
    return SelectedPlugin(name, overrides, merged_values(below, parameters))


def plugin_of(kind: str, part: Part | None) -> Any:  # noqa: ANN401 - the kind decides the contract
    """Return the plugin that ``part`` describes, or the default plugin if ``part`` is None.

    If ``part`` is a plugin object, it is returned, even if its class is not registered.

    Raises:
        PluginError: The plugin or a parameter is unknown.
    """
    return part if is_plugin(part) else plugins.create(kind, choose(kind, _or_default(kind, part)).plain)


def is_plugin(part: object) -> bool:
    """Return True if ``part`` is a plugin object, and False if it is a name or a mapping."""
    return is_dataclass(part) and not isinstance(part, type)


def noise_of(part: Part | None) -> SelectedPlugin:
    """Return the process noise parameters that replace the defaults of the filter.

    Raises:
        PluginError: The noise preset or a parameter of the noise is unknown.
    """
    default = default_names()["noise"]
    name, parameters = _split("noise", part if isinstance(part, str) else {"name": default, **(part or {})})
    known = [f.name for f in fields(Noise)]
    for key in parameters:
        require_known("parameter of noise", key, known)
    name = new_name("noise", name)
    require_known("noise", name, preset_files("noise"))
    return _preset("noise", name, parameters)


def _or_default(kind: str, part: Part | None) -> Part:
    return default_names()[kind] if part is None else part


def _split(kind: str, part: Part) -> tuple[str, dict[str, Any]]:
    """Return the name and the parameters of a plugin name, a mapping or a plugin object.

    For a plugin object, only parameters that differ from the default are returned.
    """
    if isinstance(part, str):
        return part, {}
    if is_plugin(part):  # the plugin needs a registered name, because results store the name
        name = next((name for name in plugins.names(kind) if plugins.get(kind, name) is type(part)), "")
        if not name:
            class_name = type(part).__name__
            raise PluginError(f"{class_name} is not registered; write @jerkbench.register('{kind}', NAME) above it.")
        defaults = {f.name: f.default_factory() if callable(f.default_factory) else f.default for f in fields(part)}
        return name, {key: value for key, value in asdict(part).items() if value != defaults[key]}
    if "name" not in part:
        raise PluginError(f"{kind} is {dict(part)}, without the key 'name'; give {{'name': ..., parameter: value}}.")
    parameters = {key: dict(value) if isinstance(value, Mapping) else value for key, value in part.items()}
    return str(parameters.pop("name")), parameters


def as_overrides(owner: str, parameters: Mapping[str, Any]) -> list[str]:
    """Convert parameters to the syntax of the command line, such as "filter.accel_mps2=0.2"."""
    dumps = partial(json.dumps, separators=(",", ":"), default=str)
    return [f"{owner}.{key}={value if isinstance(value, str) else dumps(value)}" for key, value in parameters.items()]


# A combination cannot run if its filter does not support the data set or the adaptation.


def refusal(job: Job, adaptations: str = "") -> str:
    """Return the reason why a combination cannot run, or an empty string if it can run.

    Args:
        job: The combination.
        adaptations: Text with the unsupported adaptations for the message. By default, the message names the adaptation
            of the job.
    """
    dataset, model = job.scenario.dataset, job.method.filter
    if is_attitude_only(dataset) and not is_attitude_only(model):
        return _lacking(job, "positions", is_attitude_only)
    if getattr(dataset, "without_imu", False) and uses_imu(model):
        return _lacking(job, "IMU", lambda cls: not uses_imu(cls))
    if getattr(model, "for_each_seed", True) is False and len(job.draws) > 1:
        files = f"the filter {job.labels.filter} has one file for {len(job.draws)} runs"
        return f"{files}; write {{seed}} instead of the seed in its name, or give seeds=1"
    name, supported = job.method.plain["adaptation"]["name"], getattr(model, "adaptations", None)
    if supported is None or name in supported:
        return ""
    refused = f"the filter {job.spec['filter']['name']} does not support adaptation={adaptations or name}"
    return f"{refused}; supported: {', '.join(supported)}"


def require_sensible(job: Job) -> None:
    """Check that the filter supports the data set and the adaptation.

    Raises:
        PluginError: The filter does not support the data set or the adaptation.
    """
    if reason := refusal(job):
        raise PluginError(f"Invalid combination: {reason}.")


def _lacking(job: Job, stream: str, fits: Callable[[type], bool]) -> str:
    dataset, model = (job.spec[kind]["name"] for kind in ("dataset", "filter"))
    others = ", ".join(name for name in plugins.names("filter") if fits(plugins.get("filter", name)))
    return f"the data set {dataset} has no {stream}, so the filter {model} cannot be used; possible filters: {others}"
