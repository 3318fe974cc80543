"""The jobs of a sweep: Hydra composes a base configuration once; the choices and values of each job are put into it."""

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
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.hydra_app.configuration import (
    check_options,
    configured_job,
    register_schemas,
)
from jerkbench.hydra_app.overrides import (
    arranged_words,
    hydra_sentence,
    is_address,
    names_in,
    no_option,
    parsed_override,
)
from jerkbench.jobs.job import Job, Noise
from jerkbench.jobs.names import choose, noise_of
from jerkbench.presets import config_folder, folder_words, user_folders
from jerkbench.renamed import new_name
from jerkbench.report.labels import GROUPS

DEPTH = {**dict.fromkeys((*GROUPS, "noise", "r_scale"), 2), "disturbance": 3}
"""The groups that are put into a base configuration, and the number of names in the key of a value."""


@dataclass(frozen=True, eq=False)
class Composed:
    """The configuration of a job.

    Attributes:
        plain: the configuration without its ``hydra`` part, as plain data; other jobs may share parts of it.
        choices: Hydra's choice for each group.
        overrides: the overrides of the job, for its labels.
    """

    plain: dict[str, Any]
    choices: dict[str, Any]
    overrides: list[str]

    def job(self, dataset: Mapping[str, object] | None = None, **filter_parameters: object) -> Job:
        """Return the job.

        Args:
            dataset: more parameters of the data set.
            filter_parameters: more parameters of the filter; Hydra's rules for quotation marks do not apply to them.

        Raises:
            PluginError: something is unknown or does not fit together.
        """
        more = {"dataset": dataset, "filter": filter_parameters}
        plain = self.plain | {kind: {**self.plain[kind], **own} for kind, own in more.items() if own}
        return configured_job(plain, self.choices, self.overrides)


def composed(words: Sequence[str]) -> Composed:
    """Compose the configuration of one run from overrides.

    Raises:
        JerkbenchError: an override is unknown or has a wrong type, or an option is invalid.
    """
    register_schemas()
    overrides = arranged_words(words)
    try:
        with initialize_config_dir(str(config_folder()), version_base="1.3"):
            config = compose("config", [*folder_words(), *overrides], return_hydra_config=True)
        plain, choices = _plain(config, resolve=True), dict(config.hydra.runtime.choices)
        check_options(config)
    except (HydraException, OmegaConfBaseException) as error:
        raise JerkbenchError(hydra_sentence(error)) from error
    return Composed(plain, choices, overrides)


def compose_jobs(loader: ConfigLoader, sweep: DictConfig, jobs: Sequence[Sequence[str]]) -> list[Composed]:
    """Compose every job of a sweep once.

    A parameter with the name of its plugin (``adaptation.mtf.window=4``, ``disturbance.gnss_outage.first_s=8``) is
    given to the jobs that choose this plugin, and removed from the overrides of the others.

    Raises:
        HydraException: a job cannot be composed.
        PluginError: there is no such parameter, or no job chooses its plugin.
    """
    composer = _Composer(loader, sweep)
    composed_jobs = [composer.compose(job) for job in jobs]
    for group, name, parameter in sorted(composer.unused - composer.used):
        raise PluginError(
            f"No combination has {group}={name}, so {group}.{name}.{parameter} has no effect; add {name} to {group} or"
            " leave the parameter out."
        )
    return list({tuple(job.overrides): job for job in composed_jobs}.values())


class _Composer:
    """Puts the choices and values of a job into a base configuration that Hydra has composed.

    An override that can be put into a base has a path and a value: ``(group,)`` and the chosen names,
    ``(group, parameter)`` or ``(group, name, parameter)`` and the value. Hydra applies all other overrides.
    """

    def __init__(self, loader: ConfigLoader, sweep: DictConfig) -> None:
        self._loader, self._sweep = loader, sweep
        self._base, self._setting = cache(self._of_hydra), cache(self._read)
        self._unchanged, self._alone = cache(self._is_unchanged), cache(_alone)
        sources = [one for one in sweep.hydra.runtime.config_sources if one.provider not in ("hydra", "schema")]
        only_ours = len(sources) == 1 + len(user_folders())
        # A data set may choose an attitude filter too, so Hydra composes each data set.
        self._names = {group: _names_of(group) if only_ours and group != "dataset" else set() for group in DEPTH}
        self.used, self.unused = set[tuple[str, ...]](), set[tuple[str, ...]]()

    def compose(self, job: Sequence[str]) -> Composed:
        settings = [(word, *self._setting(word)) for word in job]
        choices = {path[0]: names for _, path, names in settings if len(path) == 1}
        base = self._base(tuple(word for word, path, _ in settings if not path))
        if changed := {(group,) for group in choices if not self._unchanged(base, group)}:
            # An experiment sets parameters of whatever is chosen: Hydra has to apply these choices.
            base = self._base(tuple(word for word, path, _ in settings if not path or path in changed))
            choices = {group: names for group, names in choices.items() if (group,) not in changed}
        plain = base.plain | {group: self._alone(group, names) for group, names in choices.items()}
        named = base.choices | {group: ",".join(names) for group, names in choices.items()}
        overrides = list[str]()
        for word, path, value in settings:
            typed, target = word, path
            if len(path) == 3:
                group, name, parameter = path
                part = plain[group] or {}
                if name not in (part if group == "disturbance" else (named[group], part.get("name"))):
                    self.unused.add(path)
                    continue
                self.used.add(path)
                if group != "disturbance":
                    target, typed = (group, parameter), f"{group}.{word.split('.', 2)[2]}"
            plain = _with(plain, target, value) if len(target) > 1 else plain
            overrides.append(typed)
        if "${" in repr(plain):
            plain = _plain(OmegaConf.create(plain), resolve=True)
        return Composed(plain, named, overrides)

    def _read(self, word: str) -> tuple[tuple[str, ...], Any]:
        """Return path and value of an override. The path is empty if only Hydra can apply it."""
        key, equals, _ = word.partition("=")
        group, *names = path = tuple(key.split("."))
        if not equals or group not in DEPTH:
            return (), None
        value: Any = parsed_override(word).value()
        if not names:
            chosen = tuple(value) if isinstance(value, list) and group == "disturbance" else (value,)
            known = all(isinstance(name, str) and new_name(group, name) in self._names[group] for name in chosen)
            return (path, chosen) if chosen and known else ((), None)
        fits = (len(path) == DEPTH[group] or is_address(path)) and not isinstance(value, dict)
        return (path, value) if fits else ((), None)

    def _of_hydra(self, overrides: tuple[str, ...]) -> Composed:
        config = self._loader.load_sweep_config(self._sweep, list(overrides))
        return Composed(_plain(config), dict(config.hydra.runtime.choices), list(overrides))

    def _is_unchanged(self, base: Composed, group: str) -> bool:
        """Whether a group of a base has what its choice alone brings."""
        chosen, part = base.choices.get(group), base.plain[group]
        names = (chosen,) if group != "disturbance" or chosen in self._names[group] else tuple(part or ())
        return all(name in self._names[group] for name in names) and part == self._alone(group, names)


def _with(plain: object, path: Sequence[str], value: object, owner: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return a copy of ``plain`` with another value at ``path``, of which ``owner`` is the part before ``plain``."""
    known = plain if isinstance(plain, dict) else {}
    key, *rest = path
    if key not in known:
        raise PluginError(no_option(".".join((*owner, *path)), known, sweeping=True))
    return {**known, key: _with(known[key], rest, value, (*owner, key)) if rest else value}


def _alone(group: str, names: Sequence[str]) -> dict[str, Any]:
    """Return what the names bring, with the defaults of the plugins."""
    if group == "noise":
        return {**{f.name: None for f in fields(Noise)}, **noise_of(names[0]).plain}
    if group == "disturbance":
        parts = [item for name in names for item in choose(group, name).plain.items()]
        return {key: _completed(group, part) for key, part in parts}
    return _completed(group, choose(group, names[0]).plain)


def _completed(kind: str, part: Mapping[str, Any]) -> dict[str, Any]:
    return _plain(OmegaConf.merge(OmegaConf.structured(plugins.schema(kind, part["name"])), part))


def _names_of(group: str) -> set[str]:
    """The names that mean the same to Hydra and to `choose`; files of the user may have anything in them."""
    own = {path.stem for folder in user_folders() for path in (folder / group).glob("*.yaml")}
    replaces = own & set(plugins.names(group) if group in plugins.KINDS else ())
    return set() if replaces else names_in(group) - own


def _plain(config: Any, *, resolve: bool = False) -> dict[str, Any]:  # noqa: ANN401 - what OmegaConf returns
    """Return a configuration without its ``hydra`` part as plain data."""
    if resolve:
        config = OmegaConf.masked_copy(config, [str(key) for key in config if key != "hydra"])
    plain = cast("dict[str, Any]", OmegaConf.to_container(config, resolve=resolve))
    return {key: value for key, value in plain.items() if key != "hydra"}
