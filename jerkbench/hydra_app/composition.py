"""Composition of the configurations of the jobs of a sweep.

Hydra composes a base configuration only once. The choices and values of each job are then inserted into a copy of the
base configuration, because a composition by Hydra for each job would be much slower.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, cast

from hydra import compose, initialize_config_dir
from hydra.core.config_loader import ConfigLoader
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from jerkbench import plugins
from jerkbench.contracts import preferred_attitude
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.hydra_app.configuration import check_options, configured_job, register_schemas
from jerkbench.hydra_app.overrides import (
    arranged_overrides,
    hydra_message,
    is_address,
    names_in,
    no_option,
    parsed_override,
)
from jerkbench.jobs.job import Job, Noise
from jerkbench.jobs.names import choose, noise_of
from jerkbench.presets import config_folder, default_names, search_path_overrides, user_folders
from jerkbench.renamed import new_name
from jerkbench.report.labels import GROUPS

DEPTH = {**dict.fromkeys((*GROUPS, "noise", "r_scale"), 2), "disturbance": 3}
"""The groups whose choices and values are inserted into a base configuration, and the number of parts of the key of a
parameter, for example 3 for ``disturbance.gnss_outage.first_s``."""


@dataclass(frozen=True, eq=False)
class Composed:
    """The composed configuration of a job.

    Attributes:
        plain: The configuration without its ``hydra`` part, as plain data. Several jobs may share parts of ``plain``.
        choices: The name of the selected plugin or preset, by group.
        overrides: The overrides of the job, from which the labels of the job are created.
    """

    plain: dict[str, Any]
    choices: dict[str, Any]
    overrides: list[str]

    def job(self, dataset: Mapping[str, object] | None = None, **filter_parameters: object) -> Job:
        """Create the job from the configuration.

        Args:
            dataset: Additional parameters of the data set.
            filter_parameters: Additional parameters of the filter, which Hydra does not parse.

        Raises:
            PluginError: A plugin or parameter is unknown, or the parts are not compatible.
        """
        changes = {"dataset": dataset, "filter": filter_parameters}
        plain = self.plain | {kind: {**self.plain[kind], **values} for kind, values in changes.items() if values}
        return configured_job(plain, self.choices, self.overrides)


def composed(arguments: Sequence[str]) -> Composed:
    """Compose the configuration of one run from overrides.

    Raises:
        JerkbenchError: An override is unknown or has a wrong type, or an option is invalid.
    """
    register_schemas()
    overrides = arranged_overrides(arguments)
    try:
        with initialize_config_dir(str(config_folder()), version_base="1.3"):
            config = compose("config", [*search_path_overrides(), *overrides], return_hydra_config=True)
        plain, choices = _plain(config, resolve=True), dict(config.hydra.runtime.choices)
        check_options(config)
    except (HydraException, OmegaConfBaseException) as error:
        raise JerkbenchError(hydra_message(error)) from error
    return Composed(plain, choices, overrides)


def compose_jobs(loader: ConfigLoader, sweep: DictConfig, jobs: Sequence[Sequence[str]]) -> list[Composed]:
    """Compose all jobs of a sweep. Jobs with equal overrides are returned once.

    A parameter whose key contains the name of a plugin (``adaptation.mtf.window=4``,
    ``disturbance.gnss_outage.first_s=8``) is used for the jobs with this plugin. For jobs without this plugin, the
    parameter is removed from the overrides.

    Raises:
        HydraException: A job cannot be composed.
        PluginError: A parameter does not exist, or no job has the plugin to which the parameter belongs.
    """
    composer = _Composer(loader, sweep)
    composed_jobs = [composer.compose(job) for job in jobs]
    for group, name, parameter in sorted(composer.unused - composer.used):
        key = f"{group}.{name}.{parameter}"
        raise PluginError(f"{key} has no effect without {group}={name}; add {group}={name}, or remove the parameter.")
    return list({tuple(job.overrides): job for job in composed_jobs}.values())


class _Composer:
    """Inserts the choices and values of a job into a base configuration that Hydra has composed.

    Overrides that can be inserted are represented by a path and a value. The path is ``(group,)`` for a choice, and
    ``(group, parameter)`` or ``(group, name, parameter)`` for the value of a parameter. Hydra applies all other
    overrides.
    """

    def __init__(self, loader: ConfigLoader, sweep: DictConfig) -> None:
        self._loader, self._sweep = loader, sweep
        self._base, self._setting = cache(self._of_hydra), cache(self._read)
        self._unchanged, self._defaults = cache(self._is_unchanged), cache(_part_of)
        self._interpolates = cache(lambda base: "${" in repr(base.plain))
        sources = [s for s in sweep.hydra.runtime.config_sources if s.provider not in ("hydra", "schema")]
        only_ours = len(sources) == 1 + len(user_folders())
        self._names = {group: _names_of(group) if only_ours else set() for group in DEPTH}
        self.used, self.unused = set[tuple[str, ...]](), set[tuple[str, ...]]()

    def compose(self, job: Sequence[str]) -> Composed:
        settings = [(override, *self._setting(override)) for override in job]
        choices = {path[0]: names for _, path, names in settings if len(path) == 1}
        base = self._base(tuple(override for override, path, _ in settings if not path))
        if changed := {(group,) for group in choices if not self._unchanged(base, group)}:
            # Hydra has to apply a choice if an experiment sets parameters of the selected plugin.
            base = self._base(tuple(override for override, path, _ in settings if not path or path in changed))
            choices = {group: names for group, names in choices.items() if (group,) not in changed}
        if "dataset" in choices and not any(override.startswith("attitude=") for override in job):
            choices["attitude"] = (self._attitude_for(choices["dataset"]),)
        plain = base.plain | {group: self._defaults(group, names) for group, names in choices.items()}
        named = base.choices | {group: ",".join(names) for group, names in choices.items()}
        overrides = list[str]()
        for override, path, value in settings:
            typed, target = override, path
            if len(path) == 3:
                group, name, parameter = path
                part = plain[group] or {}
                if name not in (part if group == "disturbance" else (named[group], part.get("name"))):
                    self.unused.add(path)
                    continue
                self.used.add(path)
                if group != "disturbance":
                    target, typed = (group, parameter), f"{group}.{override.split('.', 2)[2]}"
            plain = _with(plain, target, value) if len(target) > 1 else plain
            overrides.append(typed)
        if self._interpolates(base) or "${" in "".join(job):
            plain = _plain(OmegaConf.create(plain), resolve=True)
        return Composed(plain, named, overrides)

    def _read(self, override: str) -> tuple[tuple[str, ...], Any]:
        """Return the path and the value of an override. The path is empty if only Hydra can apply the override."""
        key, equals, _ = override.partition("=")
        group, *names = path = tuple(key.split("."))
        if not equals or group not in DEPTH:
            return (), None
        value: Any = parsed_override(override).value()
        if not names:
            selected = tuple(value) if isinstance(value, list) and group == "disturbance" else (value,)
            known = all(isinstance(name, str) and new_name(group, name) in self._names[group] for name in selected)
            return (path, selected) if selected and known else ((), None)
        fits = (len(path) == DEPTH[group] or is_address(path)) and not isinstance(value, dict)
        return (path, value) if fits else ((), None)

    def _of_hydra(self, overrides: tuple[str, ...]) -> Composed:
        config = self._loader.load_sweep_config(self._sweep, list(overrides))
        return Composed(_plain(config), dict(config.hydra.runtime.choices), list(overrides))

    def _attitude_for(self, dataset: tuple[str, ...]) -> str:
        cls = plugins.get("dataset", self._defaults("dataset", dataset)["name"])
        return preferred_attitude(cls) or default_names()["attitude"]

    def _is_unchanged(self, base: Composed, group: str) -> bool:
        """Return whether all parameters of a group in the base configuration have the defaults of their plugins."""
        if group == "dataset" and base.choices.get("experiment"):  # the experiment may also choose an attitude filter
            return False
        choice, part = base.choices.get(group), base.plain[group]
        names = (choice,) if group != "disturbance" or choice in self._names[group] else tuple(part or ())
        return all(name in self._names[group] for name in names) and part == self._defaults(group, names)


def _with(plain: object, path: Sequence[str], value: object, owner: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return a copy of ``plain`` with a new value at ``path``.

    ``owner`` is the path of ``plain`` in the configuration. Keys in error messages start with this path.
    """
    known = plain if isinstance(plain, dict) else {}
    key, *rest = path
    if key not in known:
        raise PluginError(no_option(".".join((*owner, *path)), known, sweeping=True))
    return {**known, key: _with(known[key], rest, value, (*owner, key)) if rest else value}


def _part_of(group: str, names: Sequence[str]) -> dict[str, Any]:
    """Return the part of the configuration of a group for the selected names, with the defaults of the plugins."""
    if group == "noise":
        return {**{f.name: None for f in fields(Noise)}, **noise_of(names[0]).plain}
    if group == "disturbance":
        parts = [item for name in names for item in choose(group, name).plain.items()]
        return {key: _completed(group, part) for key, part in parts}
    return _completed(group, choose(group, names[0]).plain)


def _completed(kind: str, part: Mapping[str, Any]) -> dict[str, Any]:
    return _plain(OmegaConf.merge(OmegaConf.structured(plugins.schema(kind, part["name"])), part))


def _names_of(group: str) -> set[str]:
    """Return the names in a group for which `choose` and Hydra return the same configuration.

    Names of presets of the user are excluded.
    """
    user_names = {path.stem for folder in user_folders() for path in (folder / group).glob("*.yaml")}
    replaces = user_names & set(plugins.names(group) if group in plugins.KINDS else ())
    return set() if replaces else names_in(group) - user_names


def _plain(config: Any, *, resolve: bool = False) -> dict[str, Any]:  # noqa: ANN401 - the type that OmegaConf returns
    if resolve:
        config = OmegaConf.masked_copy(config, [str(key) for key in config if key != "hydra"])
    plain = cast("dict[str, Any]", OmegaConf.to_container(config, resolve=resolve))
    return {key: value for key, value in plain.items() if key != "hydra"}
