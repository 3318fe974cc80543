"""The files that the jobs of a sweep are composed of: each read once, without what belongs to Hydra."""

import copy
from collections.abc import Sequence
from typing import Any

from hydra._internal.config_repository import CachingConfigRepository
from hydra.core.default_element import GroupDefault, InputDefault
from hydra.plugins.config_source import ConfigResult, ConfigSource
from omegaconf import DictConfig, open_dict

OWN = "hydra"
"""The key, and the folder of groups, of what belongs to Hydra itself."""


class Files(CachingConfigRepository):
    """The files of a sweep, each read once, without what belongs to Hydra."""

    def __init__(self, files: CachingConfigRepository) -> None:
        """Read from where ``files`` reads."""
        super().__init__(files.delegate)

    def load_config(self, config_path: str) -> ConfigResult | None:
        """Load a file."""
        known = f"config_path={config_path}" in self.cache
        loaded = super().load_config(config_path)
        if loaded is None or known:
            return loaded
        loaded.defaults_list = [default for default in loaded.defaults_list or [] if not _is_own(default)]
        if isinstance(loaded.config, DictConfig) and OWN in loaded.config:
            loaded.config = copy.deepcopy(loaded.config)
            with open_dict(loaded.config):
                del loaded.config[OWN]
        return loaded


class Few:
    """The files of a sweep, whose configuration chooses some groups only."""

    def __init__(self, files: Files, primary: str, groups: Sequence[str]) -> None:
        """Leave of the choices of the file ``primary`` those of ``groups``."""
        self._files, self._primary, self._groups = files, primary, groups

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever Hydra asks for
        """Return what ``files`` has."""
        return getattr(self._files, name)

    def load_config(self, config_path: str) -> ConfigResult | None:
        """Load a file."""
        loaded = self._files.load_config(config_path)
        if loaded is None or config_path != self._primary:
            return loaded
        few = copy.copy(loaded)
        few.defaults_list = [default for default in loaded.defaults_list or [] if self._stays(default)]
        return few

    def _stays(self, default: InputDefault) -> bool:
        return default.group in self._groups if isinstance(default, GroupDefault) else default.is_self()


class Copies:
    """Files whose content may be changed."""

    def __init__(self, files: Files) -> None:
        """Copy what ``files`` reads."""
        self._files = files

    def load_config(self, config_path: str) -> ConfigResult | None:
        """Load a file."""
        loaded = self._files.load_config(config_path)
        if loaded is not None:
            loaded = copy.copy(loaded)
            loaded.config = copy.deepcopy(loaded.config)
        return loaded

    def get_schema_source(self) -> ConfigSource:
        """Return where Hydra looks for schemas."""
        return self._files.get_schema_source()


def _is_own(default: object) -> bool:
    return isinstance(default, GroupDefault) and str(default.group).startswith(f"{OWN}/")
