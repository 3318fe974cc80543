"""Checks of options that belong to no cell."""

import re

from omegaconf import DictConfig

from jerkbench.errors import PluginError


def check_options(config: DictConfig) -> None:
    """Check where the results go and how many processes work, before anything is written.

    Raises:
        PluginError: the study's name is no name of a folder, or the number of workers is negative.
    """
    study = str(config.study)
    if not re.fullmatch(r"[^/\\]+", study) or study in (".", ".."):
        raise PluginError(
            f"study is '{study}'; it must be the name of one folder, which is made in results={config.results}."
        )
    if config.workers < 0:
        raise PluginError(f"workers is {config.workers}; give 0 (one for each processor) or more.")
