"""The jobs of a sweep: Hydra composes a base configuration once; the choices and values of each job are put into it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, NamedTuple, cast

from hydra import compose, initialize_config_dir
from hydra.core.config_loader import ConfigLoader
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from jerkbench import plugins
from jerkbench.errors import JerkbenchError, PluginError, let_interrupt_through
from jerkbench.hydra_app.configuration import (
    Schema,
    check_options,
    configured_job,
    register_hydra_parts,
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
from jerkbench.jobs.labels import GROUPS
from jerkbench.jobs.names import choose, noise_of
from jerkbench.contracts import preferred_attitude
from jerkbench.presets import config_folder, folder_words, user_folders
from jerkbench.renamed import new_name

PLACED_GROUPS = (*GROUPS, "disturbance", "noise")
"""Groups whose choices are put into a base configuration."""

DEPTH = {
    **dict.fromkeys({f.name for f in fields(Schema)} - {*PLACED_GROUPS, "cluster"}, 1),
    **dict.fromkeys((*GROUPS, "noise", "r_scale"), 2),
    "disturbance": 3,
}
"""For each option and group the number of names in the key of a value."""


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
    register_hydra_parts()
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
    """Compose every job of a sweep.

    A parameter with the name of its plugin (``adaptation.mtf.window=4``, ``disturbance.gnss_outage.first_s=8``) is
    given to the jobs that choose this plugin, and removed from the overrides of the others.

    Raises:
        HydraException: a job cannot be composed.
        PluginError: there is no such parameter, or no job chooses its plugin.
    """
    composer = _Composer(loader, sweep)
    return composer.compose_all(jobs)


class _Setting(NamedTuple):
    """An override that is put into a base configuration.

    Attributes:
        path: the names in its key.
        value: of a choice the tuple of its names.
        addressed: whether the second name is that of a plugin or preset, which a job may choose or not.
    """

    path: tuple[str, ...]
    value: Any
    addressed: bool

    @property
    def choice(self) -> str:
        """The group in which it chooses; empty for a value."""
        return self.path[0] if len(self.path) == 1 and self.path[0] in PLACED_GROUPS else ""


class _Composer:
    def __init__(self, loader: ConfigLoader, sweep: DictConfig) -> None:
        self._loader, self._sweep = loader, sweep
        self._base, self._setting = cache(self._of_hydra), cache(self._read)
        self._unchanged, self._alone = cache(self._is_unchanged), cache(_alone)
        self._options = OmegaConf.structured(Schema)
        sources = [
            source for source in sweep.hydra.runtime.config_sources if source.provider not in ("hydra", "schema")
        ]
        only_ours = len(sources) == 1 + len(user_folders())
        self._names = {group: _names_of(group) if only_ours else set() for group in PLACED_GROUPS}
        self._similar: dict[str | None, str] = {}
        self._used, self._unused = set[tuple[str, ...]](), set[tuple[str, ...]]()

    def compose_all(self, jobs: Sequence[Sequence[str]]) -> list[Composed]:
        composed = [self._compose(job) for job in jobs]
        for group, name, parameter in sorted(self._unused - self._used):
            raise PluginError(
                f"No combination has {group}={name}, so {group}.{name}.{parameter} has no effect; add {name} to {group}"
                " or leave the parameter out."
            )
        return list({tuple(one.overrides): one for one in composed}.values())

    def _compose(self, job: Sequence[str]) -> Composed:
        settings = [(word, self._setting(word)) for word in job]
        choices = {setting.choice: setting.value for _, setting in settings if setting and setting.choice}
        base = self._base(self._others(settings, choices))
        kept = {group: names for group, names in choices.items() if self._unchanged(base, group)}
        if kept != choices:  # an experiment sets parameters of whatever is chosen: only Hydra knows which
            base, choices = self._base(self._others(settings, kept)), kept
        plain = base.plain | {group: self._alone(group, names) for group, names in choices.items()}
        named = base.choices | {group: ",".join(names) for group, names in choices.items()}
        overrides = list[str]()
        for word, setting in settings:
            typed = word
            if setting and not setting.choice:
                path = setting.path
                if setting.addressed:
                    group, name, parameter = path
                    part = plain[group] or {}
                    if name not in (part if group == "disturbance" else (named[group], part.get("name"))):
                        self._unused.add(path)
                        continue
                    self._used.add(path)
                    if group != "disturbance":
                        path, typed = (group, parameter), f"{group}.{word.split('.', 2)[2]}"
                plain = _with(plain, path, setting.value)
            overrides.append(typed)
        if "${" in repr(plain):
            plain = _plain(OmegaConf.create(plain), resolve=True)
        return Composed(plain, named, overrides)

    def _read(self, word: str) -> _Setting | None:
        """Read an override; None: only Hydra can apply it."""
        key, equals, _ = word.partition("=")
        path = tuple(key.split("."))
        group = path[0]
        if not equals or not re.fullmatch(r"\w+(\.\w+)*", key) or group not in DEPTH:
            return None
        value: Any = parsed_override(word).value()
        if len(path) == 1 and group in PLACED_GROUPS:
            names = tuple(value) if isinstance(value, list) and group == "disturbance" else (value,)
            known = all(isinstance(name, str) and new_name(group, name) in self._names[group] for name in names)
            return _Setting(path, names, addressed=False) if names and known else None
        addressed = is_address(path)
        if (len(path) != DEPTH[group] and not addressed) or isinstance(value, dict):
            return None
        if group not in plugins.KINDS:
            if "${" in repr(value) or value == "???":
                return None
            try:
                OmegaConf.update(self._options, key, value)
            except OmegaConfBaseException as error:
                let_interrupt_through(error)
                return None
            value = OmegaConf.select(self._options, key)
            value = OmegaConf.to_container(value) if OmegaConf.is_config(value) else value
        return _Setting(path, value, addressed)

    def _others(self, settings: Sequence[tuple[str, _Setting | None]], choices: Mapping[str, Any]) -> tuple[str, ...]:
        """Return the overrides for Hydra: all but values and ``choices``.

        A data set may prefer an attitude filter. So one of the data sets with the same preference stands for the chosen
        one, unless an attitude filter is chosen.
        """
        others = [word for word, one in settings if one is None or (one.choice and one.choice not in choices)]
        if "dataset" in choices and not any(word.startswith("attitude=") for word, _ in settings):
            (name,) = choices["dataset"]
            preferred = preferred_attitude(plugins.get("dataset", self._alone("dataset", (name,))["name"]))
            others.append(f"dataset={self._similar.setdefault(preferred, name)}")
        return tuple(others)

    def _of_hydra(self, overrides: tuple[str, ...]) -> Composed:
        config = self._loader.load_sweep_config(self._sweep, list(overrides))
        return Composed(_plain(config), dict(config.hydra.runtime.choices), list(overrides))

    def _is_unchanged(self, base: Composed, group: str) -> bool:
        """Whether a group of a base has what its choice alone brings."""
        chosen = base.choices.get(group)
        names = (
            tuple(base.plain[group] or ()) if group == "disturbance" and chosen not in self._names[group] else (chosen,)
        )
        return all(name in self._names[group] for name in names) and base.plain[group] == self._alone(group, names)


def _with(plain: dict[str, Any], path: Sequence[str], value: object) -> dict[str, Any]:
    """Return a copy of ``plain`` with a value at ``path``, where there has to be one.

    Raises:
        PluginError: there is none.
    """

    def put(inside: object, depth: int) -> Any:  # noqa: ANN401 - plain data
        if depth == len(path):
            return value
        known = inside if isinstance(inside, dict) else {}
        if path[depth] not in known:
            raise PluginError(no_option(".".join(path), known, sweeping=True))
        return {**known, path[depth]: put(known[path[depth]], depth + 1)}

    return cast("dict[str, Any]", put(plain, 0))


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
