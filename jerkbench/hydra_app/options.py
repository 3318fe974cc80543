"""Checks of options that belong to no cell."""

import os
import re

from omegaconf import DictConfig

from jerkbench.errors import PluginError

LONGEST_NAME = 255
"""Bytes of a folder's name, on the file systems that there are."""


def check_options(config: DictConfig) -> None:
    """Check where the results go, how many processes work and which seeds are added, before anything is written.

    Raises:
        PluginError: the study's name is no name of a folder, or a number of workers or seeds makes no sense.
        MissingMandatoryValue: one of them has no value.
    """
    study = str(config.study)
    if not re.fullmatch(r"[^/\\\x00-\x1f\x7f]+", study) or study in (".", ".."):
        raise PluginError(
            f"study is '{study}'; it must be the name of one folder, which is made in results={config.results}."
        )
    if len(os.fsencode(study)) > LONGEST_NAME:
        raise PluginError(f"study has {len(study)} letters ('{study[:20]}...'); a folder's name has at most 255 bytes.")
    if config.max_seeds and config.max_seeds < config.seeds:
        raise PluginError(f"max_seeds is {config.max_seeds}; give as many as seeds={config.seeds}, or 0 for no more.")
    if config.workers < 0:
        raise PluginError(f"workers is {config.workers}; give 0 (one for each processor) or more.")
    for tag in config.tags:
        if not re.fullmatch(r"[\w.:-]+", str(tag)):
            raise PluginError(
                f"'{tag}' cannot be a tag; write letters, digits, _, ., : and -, for example tags=[thesis]."
            )
