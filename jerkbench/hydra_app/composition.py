"""The composition of a sweep's jobs: Hydra makes what their choices of plugins share, once; the choices stand in it."""

import copy
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any, cast

from hydra.core.config_loader import ConfigLoader
from hydra.core.config_store import ConfigStore
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException

from jerkbench import plugins
from jerkbench.contracts import preferred_attitude
from jerkbench.errors import PluginError, let_interrupt_through
from jerkbench.hydra_app.configuration import Schema
from jerkbench.jobs.job import Noise
from jerkbench.jobs.labels import GROUPS
from jerkbench.jobs.names import choose, noise_of
from jerkbench.presets import config_folder

COMPOSED_GROUPS = (*GROUPS, "disturbance", "noise")
"""Groups whose choices are put into what Hydra has composed."""

NO_GROUPS = {f.name for f in fields(Schema)} - {*COMPOSED_GROUPS, "cluster"}
"""Options that are no group."""

BLANK = "blank"
"""A choice without parameters: what a group has with it, the other words (an experiment) say of every choice."""

NOISE_FIELDS = [f.name for f in fields(Noise)]

UNSAID = -1.2345e300
"""What the noise has where nobody says anything; its blank has to have numbers, for it has types."""

CHOICE = r"[A-Za-z_]\w*"
NAMES = rf"{CHOICE}|\[{CHOICE}(?:,{CHOICE})*\]"
"""A choice of several."""

JobWords = Sequence[str]


@dataclass(frozen=True, eq=False)
class Composed:
    """A job's configuration.

    Attributes:
        plain: the configuration without its ``hydra`` part, as plain data; it may be shared with other jobs.
        choices: Hydra's choice for each group.
        overrides: the overrides of the job.
    """

    plain: dict[str, Any]
    choices: dict[str, Any]
    overrides: list[str]


def compose_jobs(loader: ConfigLoader, config: DictConfig, jobs: Sequence[JobWords]) -> list[Composed]:
    """Compose every job: what it would be alone.

    Raises:
        HydraException: a job cannot be composed.
    """
    composer = _Composer(loader, config)
    return [composer.compose(job) for job in jobs]


@dataclass(frozen=True, eq=False)
class _Whole:
    """What Hydra makes of some words, without its own part."""

    config: DictConfig
    plain: dict[str, Any]
    choices: dict[str, Any]


class _Composer:
    """Composes the jobs of one sweep, each part of them once."""

    def __init__(self, loader: ConfigLoader, sweep: DictConfig) -> None:
        self._loader, self._sweep = loader, sweep
        self._whole, self._choice, self._part = cache(self._of_hydra), cache(self._chosen), cache(self._made)
        self._ours, self._config = cache(self._is_ours), cache(self._chosen_config)
        self._value = cache(OverridesParser.create().parse_override)
        sources = [
            source for source in sweep.hydra.runtime.config_sources if source.provider not in ("hydra", "schema")
        ]
        folders = [source.path for source in sources if source.schema == "file"]
        self._readable = len(folders) == len(sources) and str(config_folder()) in folders
        others = (Path(folder) for folder in folders if folder != str(config_folder()))
        self._of_user = {(path.parent.name, path.stem) for folder in others for path in folder.glob("*/*.yaml")}

    def compose(self, job: JobWords) -> Composed:
        """Compose a job; where its parts do not fit together, Hydra does it, or says why."""
        about: dict[str, tuple[str, ...]] = {}
        for word in job:
            about[owner(word)] = (*about.get(owner(word), ()), word)
        try:
            plain, choices = self._put_together(about)
        except (HydraException, OmegaConfBaseException, PluginError) as error:
            let_interrupt_through(error)
            whole = self._of_hydra(job)
            plain, choices = whole.plain, whole.choices
        if "${" in repr(plain):  # only then is OmegaConf needed, which takes longer than all the rest
            plain = _plain(OmegaConf.create(plain), resolve=True)
        return Composed(plain, choices, list(job))

    def _put_together(self, about: Mapping[str, tuple[str, ...]]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Put values, and choices of plugins, into what Hydra makes of all other words."""
        chosen = {key: choice for key, words in about.items() if (choice := self._choice(key, words))}
        parts = {key: words for key, words in about.items() if key in chosen or all(map(_is_value, words))}
        shared = tuple(word for key, words in about.items() if key not in parts for word in words)
        attitude = None
        if "dataset" in chosen and "attitude" not in chosen:
            attitude = preferred_attitude(plugins.get("dataset", choose("dataset", chosen["dataset"]).plain["name"]))
        whole = self._whole(shared, tuple(chosen), attitude)
        plain = {key: self._part(whole, key, words) for key, words in parts.items()}
        names = {key: None if choice.startswith("[") else choice for key, choice in chosen.items()}
        return whole.plain | plain, whole.choices | names

    def _of_hydra(self, words: JobWords, blank: tuple[str, ...] = (), attitude: str | None = None) -> _Whole:
        """Let Hydra compose ``words``, some groups ``blank``, with the ``attitude`` that a data set prefers."""
        with _blanks(blank, attitude):
            config = self._loader.load_sweep_config(self._sweep, [*words, *(f"{group}={BLANK}" for group in blank)])
        choices: Any = OmegaConf.to_container(config.hydra.runtime.choices)
        with open_dict(config):
            del config["hydra"]
        return _Whole(config, _plain(config), choices)

    def _chosen(self, group: str, words: tuple[str, ...]) -> str:
        """Return the name that is chosen in a group, or the [names]; empty where only Hydra can tell what is."""
        choices = [word for word in words if not _is_value(word)]
        if group not in COMPOSED_GROUPS or len(choices) != 1:
            return ""
        choice = choices[0].removeprefix(f"{group}=")
        is_plain = re.fullmatch(NAMES if group == "disturbance" else CHOICE, choice)
        return choice if is_plain and all(self._ours(group, name) for name in _names(choice)) else ""

    def _is_ours(self, group: str, name: str) -> bool:
        """Whether a plugin, or a preset, is made of nothing that the user's own folders have."""
        if (group, name) in self._of_user:
            return False
        try:
            alone = _alone(group, name)
        except (PluginError, OmegaConfBaseException) as error:
            let_interrupt_through(error)
            return False
        return self._readable and self._of_user.isdisjoint((group, key) for key in (name, alone.get("name"), *alone))

    def _made(self, whole: _Whole, key: str, words: tuple[str, ...]) -> Any:  # noqa: ANN401 - whatever stands under the key
        """Return what stands under a key with ``words``: their choice, or what ``whole`` has, with their values."""
        choice = self._choice(key, words)
        config, own = self._config(whole, key, choice)
        parsed = [self._value(word) for word in words if _is_value(word)]
        values = {value.key_or_group: value.value() for value in parsed}
        if choice and key in plugins.KINDS and key != "disturbance" and all(name.count(".") == 1 for name in values):
            named = {name.partition(".")[2]: value for name, value in values.items()}
            return own | plugins.converted(key, own["name"], named) if named else own
        config = copy.deepcopy(config)
        for name, value in values.items():
            OmegaConf.update(config, name, value, merge=True)
        return _plain(config)[key]

    def _chosen_config(self, whole: _Whole, key: str, choice: str) -> tuple[DictConfig, Any]:
        """Return what ``whole`` is with the choice, before any value, and what stands under the key then."""
        config = whole.config
        if choice:
            said = whole.plain[key]
            if key == "noise":
                said = {name: value for name, value in said.items() if value != UNSAID}
            merged = OmegaConf.merge(*({key: _alone(key, name)} for name in _names(choice)), {key: said})
            config = cast("DictConfig", merged)
        OmegaConf.set_struct(config, True)  # noqa: FBT003 - OmegaConf's signature
        return config, _plain(config).get(key)


def _names(choice: str) -> list[str]:
    return choice.strip("[]").split(",")


def _alone(group: str, name: str) -> DictConfig:
    """Return what stands under a group where ``name`` is chosen and nothing else is said."""
    if group == "noise":
        return cast("DictConfig", OmegaConf.merge(Noise, noise_of(name).plain))
    plain = choose(group, name).plain
    if group == "disturbance":
        return OmegaConf.create({key: _with_schema(group, part) for key, part in plain.items()})
    return _with_schema(group, plain)


def _with_schema(group: str, plain: Mapping[str, Any]) -> DictConfig:
    return cast("DictConfig", OmegaConf.merge(plugins.schema(group, plain["name"]), plain))


@contextmanager
def _blanks(groups: tuple[str, ...], attitude: str | None) -> Iterator[None]:
    """Let groups have the choice `BLANK`; that of the data sets chooses an attitude filter, if one is given."""
    store = ConfigStore.instance()
    for group in groups:
        store.store(BLANK, dict.fromkeys(NOISE_FIELDS, UNSAID) if group == "noise" else {}, group)
    if attitude:
        choosing = {"defaults": ["_self_", {"override /attitude": attitude}], "dataset": {}}
        store.store(BLANK, choosing, "dataset", "_global_")
    try:
        yield
    finally:
        for group in groups:
            del store.repo[group][f"{BLANK}.yaml"]


def _is_value(word: str) -> bool:
    """Whether a word only gives a value to a key that is there: no group, no mapping, nothing of Hydra's own."""
    key, _, value = word.partition("=")
    plain = key.replace(".", "").replace("_", "").isalnum() and not value.startswith("{")
    return plain and (("." in key and owner(word) != "hydra") or key in NO_GROUPS)


def owner(word: str) -> str:
    """Return the group, or the first part of the key, that an override is about."""
    return word.lstrip("+~").partition("=")[0].partition(".")[0].partition("@")[0]


def _plain(config: DictConfig, *, resolve: bool = False) -> dict[str, Any]:
    return cast("dict[str, Any]", OmegaConf.to_container(config, resolve=resolve))
