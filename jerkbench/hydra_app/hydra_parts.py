"""Our launcher, sweeper and callback, by the names under which the configuration chooses them."""

from pathlib import Path
from typing import Any

from hydra._internal.sources_registry import SourcesRegistry
from hydra.core.config_store import ConfigStore
from hydra.core.plugins import Plugins
from hydra.plugins.config_source import ConfigResult
from yaml import YAMLError

from jerkbench.errors import PluginError
from jerkbench.yaml_files import require_small

SWEEPER = "hydra_plugins.jerkbench.JerkbenchSweeper"
LAUNCHER = "hydra_plugins.jerkbench.JerkbenchLauncher"


def _measure_files() -> None:
    """Let Hydra read a file only after it was measured; Hydra loads its class of files itself, from its plugins."""
    Plugins.instance()
    source = SourcesRegistry.instance().resolve("file")
    load = source.load_config

    def measured(self: Any, config_path: str) -> ConfigResult:  # noqa: ANN401 - the class that Hydra has loaded
        path = Path(self.path) / self._normalize_file_name(config_path)
        try:
            if path.is_file():
                require_small(path.read_text(encoding="utf-8"), path)
        except (OSError, UnicodeDecodeError, YAMLError) as error:
            raise PluginError(f"{path} cannot be read: {' '.join(str(error).split())}.") from error
        return load(self, config_path)

    if load.__name__ != measured.__name__:
        setattr(source, "load_config", measured)  # noqa: B010 - mypy lets no method be replaced


def register_hydra_parts() -> None:
    """Put them into Hydra's ConfigStore, and a measure of each file before Hydra reads it."""
    _measure_files()
    store = ConfigStore.instance()
    store.store(group="hydra/launcher", name="jerkbench", node={"_target_": LAUNCHER})
    sweeper: dict[str, Any] = {"_target_": SWEEPER, "max_batch_size": None, "params": {}}
    store.store(group="hydra/sweeper", name="jerkbench", node=sweeper)
    callback = {"conclude": {"_target_": "jerkbench.hydra_app.app.Conclude"}}
    store.store(group="hydra/callbacks", name="jerkbench", node=callback)
