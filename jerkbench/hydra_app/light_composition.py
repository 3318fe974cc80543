"""Hydra's composition of a job without Hydra's own part, which is that of the whole sweep.

Files are read once a sweep. A choice that stands for itself (a plugin, or a preset without a defaults list) takes the
place of another one of its group without anything else being composed.
"""

import copy
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, cast

from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra._internal.defaults_list import create_defaults_list
from hydra.core.config_loader import ConfigLoader
from hydra.core.default_element import ResultDefault
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import ConfigCompositionException, HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from jerkbench.hydra_app.sweep_files import OWN, Copies, Few, Files

NAME = re.compile(r"[A-Za-z_]\w*")
"""A choice that is one name."""


@dataclass(frozen=True, eq=False)
class Composition:
    """A composed job.

    Attributes:
        config: the configuration without its ``hydra`` part, or a part of it.
        plain: the same as plain data.
        choices: the choice for each group.
        defaults: the files it is made of, in order.
        beside: a composition of which it has everything that ``config`` has not.
    """

    config: DictConfig
    plain: dict[str, Any]
    choices: dict[str, Any]
    defaults: Sequence[ResultDefault]
    beside: "Composition | None" = None

    def part(self, keys: Sequence[str]) -> DictConfig:
        """Return a copy of some keys of the configuration, each with the type that the schema gives it."""
        own = copy.deepcopy(self.config)
        OmegaConf.set_struct(own, False)  # noqa: FBT003 - OmegaConf's signature
        for key in set(own) - set(keys):
            del own[key]
        if self.beside is None:
            return own
        rest = self.beside.part([key for key in keys if key not in own])
        rest.merge_with(own)
        return rest


class Composer:
    """Composes the jobs of one sweep."""

    def __init__(self, loader: ConfigLoader, config: DictConfig) -> None:
        """Take Hydra's loader, and the configuration of the sweep."""
        assert isinstance(loader, ConfigLoaderImpl)  # noqa: S101 - Hydra has no other
        self._loader, self._sweep = loader, config
        words: Any = OmegaConf.to_container(config.hydra.overrides.hydra)
        _, repository = loader._parse_overrides_and_create_caching_repo(config.hydra.job.config_name, words)  # noqa: SLF001 - Hydra's own way to its files
        self._files = Files(repository)
        self._copies: Any = Copies(self._files)  # Hydra's type has more methods than are asked for
        self._own = {key: value for key, value in config.hydra.runtime.choices.items() if key.startswith(f"{OWN}/")}

    def compose(self, job: Sequence[str]) -> Composition:
        """Compose what a job is without its ``hydra`` part.

        Raises:
            HydraException: it cannot be composed; the words of the error are Hydra's.
        """
        with _in_words_of_hydra():
            return self._composed(OverridesParser.create().parse_overrides(list(job)), self._files)

    def _composed(self, words: list[Override], files: Any) -> Composition:  # noqa: ANN401 - as `Copies`
        loader = self._loader
        loader.validate_sweep_overrides_legal(overrides=words, run_mode=RunMode.RUN, from_shell=True)
        listed = create_defaults_list(
            repo=files,
            config_name=self._sweep.hydra.job.config_name,
            overrides_list=words,
            prepend_hydra=False,
            skip_missing=False,
        )
        config = loader._compose_config_from_defaults_list(defaults=listed.defaults, repo=self._copies)  # noqa: SLF001
        self._apply(listed.config_overrides, config)
        choices = {**self._own, **listed.overrides.known_choices}
        return Composition(config, _plain(config), choices, listed.defaults)

    def _apply(self, words: list[Override], config: DictConfig) -> None:
        OmegaConf.set_struct(config, True)  # noqa: FBT003 - OmegaConf's signature
        ConfigLoaderImpl._apply_overrides_to_config(words, config)  # noqa: SLF001 - what Hydra itself does with them
        OmegaConf.copy_cache(from_config=self._sweep, to_config=config)

    def of_groups(self, groups: Sequence[str], words: Sequence[str]) -> Composition | None:
        """Compose some groups alone; None where their files ask for another one, or only composing the job can tell.

        Args:
            groups: that the configuration of the sweep chooses; what it says itself comes along.
            words: choices of these groups, and values of their parameters.
        """
        few: Any = Few(self._files, self._sweep.hydra.job.config_name, groups)
        try:
            return self._composed(OverridesParser.create().parse_overrides(list(words)), few)
        except (HydraException, OmegaConfBaseException):
            return None

    def exchanged(self, base: Composition, group: str, words: Sequence[str]) -> Composition | None:
        """Return what ``base`` would be with other ``words`` for one group; None where only composing can tell.

        Args:
            base: composed, with a choice of that group.
            group: whose part is all that the answer holds.
            words: a choice of the group and values of its parameters.
        """
        choices = [word.partition("=")[2] for word in words if word.partition("=")[0] == group]
        if len(choices) != 1 or not NAME.fullmatch(choices[0]) or not self._alone(f"{group}/{choices[0]}"):
            return None
        places = [place for place, default in enumerate(base.defaults) if default.override_key == group]
        if len(places) != 1 or not self._alone(str(base.defaults[places[0]].config_path)):
            return None
        defaults = list(base.defaults)
        defaults[places[0]] = self._in_place_of(defaults[places[0]], group, choices[0])
        with _in_words_of_hydra():
            config = self._part(defaults, group)
        parameters = [word for word in words if word.partition("=")[0] != group]
        self._apply(OverridesParser.create().parse_overrides(parameters), config)
        return Composition(config, _plain(config), {**base.choices, group: choices[0]}, defaults)

    def _alone(self, path: str) -> bool:
        """Whether a file brings no other along, and stands in its own group."""
        loaded = self._files.load_config(path)
        if loaded is None or loaded.header["package"] == "_global_" or "defaults" in loaded.config:
            return False
        return not loaded.defaults_list

    def _in_place_of(self, default: ResultDefault, group: str, name: str) -> ResultDefault:
        loaded = self._files.load_config(f"{group}/{name}")
        assert loaded is not None  # noqa: S101 - it stands for itself
        return replace(default, config_path=f"{group}/{name}", package=loaded.header["package"] or group)

    def _part(self, defaults: Sequence[ResultDefault], group: str) -> DictConfig:
        """Compose the part of one group alone."""
        config = OmegaConf.create()
        for default in defaults:
            package = (default.package or "").partition(".")[0]
            if package == group or (not package and self._has(str(default.config_path), group)):
                loaded: Any = self._loader._load_single_config(default=default, repo=self._copies).config  # noqa: SLF001 - as above
                config.merge_with(OmegaConf.masked_copy(loaded, [group]))
        return config

    def _has(self, path: str, group: str) -> bool:
        """Whether a file of the whole configuration says anything of a group."""
        loaded = self._files.load_config(path)
        return loaded is not None and group in loaded.config


@contextmanager
def _in_words_of_hydra() -> Iterator[None]:
    """Raise what Hydra's own composition raises."""
    try:
        yield
    except OmegaConfBaseException as error:
        raise ConfigCompositionException from error


def _plain(config: DictConfig) -> dict[str, Any]:
    return cast("dict[str, Any]", OmegaConf.to_container(config))
