"""The Hydra app behind `jerkbench run`: one cell, or a sweep of many."""

import sys
from collections.abc import Sequence
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.experimental.callback import Callback
from omegaconf import DictConfig

from jerkbench.errors import JerkbenchError, PluginError, exit_with
from jerkbench.hydra_app.configuration import LAUNCHER, register_hydra_parts, register_schemas, study_folder
from jerkbench.hydra_app.launched_sweep import conclude, draw_and_report, failed, forget_order, take_order
from jerkbench.hydra_app.single_run import run_job
from jerkbench.hydra_app.sweep_words import swept_addresses, without_addresses
from jerkbench.hydra_app.typed_words import arranged_words
from jerkbench.hydra_app.words import cluster_of
from jerkbench.jobs.cluster import LOCAL
from jerkbench.presets import config_folder, folder_words
from jerkbench.results.store import Store
from jerkbench.sweep.looks import typed as typed_seeds


def run_app(arguments: Sequence[str]) -> None:
    """Run the app with Hydra's command line ``arguments``."""
    if {"-m", "--multirun"} & set(arguments) and {"-c", "--cfg"} & set(arguments):
        exit_with(
            PluginError("--cfg shows the configuration of one run: leave out -m, and give each option one value.")
        )
    register_schemas()
    register_hydra_parts()
    app = hydra.main(version_base="1.3", config_path=str(config_folder()), config_name="config")(_task)
    arguments = ["dry=true" if word == "--dry" else word for word in arguments]
    words = [typed for word in arguments for typed in typed_seeds(word)]
    words = swept_addresses(words) if {"-m", "--multirun"} & set(arguments) else without_addresses(words)
    sys.argv = ["jerkbench run", *arranged_words([*folder_words(), *words])]
    app()


class Conclude(Callback):
    """Writes the table after a sweep that another launcher than ours has run."""

    def on_multirun_start(self, config: DictConfig, **_: Any) -> None:  # noqa: ANN401 - Hydra's signature
        """Forget the order of an earlier sweep that did not come to its end."""
        forget_order(study_folder(config))

    def on_multirun_end(self, config: DictConfig, **_: Any) -> None:  # noqa: ANN401 - Hydra's signature
        """Write and print the table of the sweep, in planned order; exits as our own launcher would."""
        if config.hydra.launcher["_target_"] != LAUNCHER:
            store = Store(study_folder(config))
            if config.max_seeds:
                print("Seeds are added by our own launcher only; these are the first.", file=sys.stderr)
            if cluster_of(config) != LOCAL:
                print("cluster= is for our own launcher; this sweep ran where its launcher ran it.", file=sys.stderr)
            study = conclude(store, take_order(store.folder.parent), config)
            if code := (draw_and_report(study, config) if study else 0) or failed(study):
                raise SystemExit(code)


def _task(config: DictConfig) -> None:
    """One job: a single run, or one cell of a sweep that another launcher has started."""
    try:
        run_job(config, HydraConfig.get())
    except JerkbenchError as error:  # here, because Hydra would print more than the sentence
        exit_with(error)
