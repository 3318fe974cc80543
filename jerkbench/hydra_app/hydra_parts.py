"""Our launcher, sweeper and callback, by the names under which the configuration chooses them."""

from typing import Any

from hydra.core.config_store import ConfigStore

SWEEPER = "hydra_plugins.jerkbench.JerkbenchSweeper"
LAUNCHER = "hydra_plugins.jerkbench.JerkbenchLauncher"


def register_hydra_parts() -> None:
    """Put them into Hydra's ConfigStore."""
    store = ConfigStore.instance()
    store.store(group="hydra/launcher", name="jerkbench", node={"_target_": LAUNCHER})
    sweeper: dict[str, Any] = {"_target_": SWEEPER, "max_batch_size": None, "params": {}}
    store.store(group="hydra/sweeper", name="jerkbench", node=sweeper)
    callback = {"conclude": {"_target_": "jerkbench.hydra_app.app.Conclude"}}
    store.store(group="hydra/callbacks", name="jerkbench", node=callback)
