"""Checks of options that belong to no cell."""

import os
import re

from omegaconf import DictConfig

from jerkbench.errors import PluginError

LONGEST_NAME = 255
"""Bytes of a folder's name, on the file systems that there are."""


def check_options(config: DictConfig) -> None:
    """Check where the results go and how many processes work, before anything is written.

    Raises:
        PluginError: the study's name is no name of a folder, or the number of workers is negative.
        MissingMandatoryValue: one of them has no value.
    """
    study = str(config.study)
    if not re.fullmatch(r"[^/\\\x00-\x1f\x7f]+", study) or study in (".", ".."):
        raise PluginError(
            f"study is '{study}'; it must be the name of one folder, which is made in results={config.results}."
        )
    if len(os.fsencode(study)) > LONGEST_NAME:
        raise PluginError(f"study has {len(study)} letters ('{study[:20]}...'); a folder's name has at most 255 bytes.")
    if config.workers < 0:
        raise PluginError(f"workers is {config.workers}; give 0 (one for each processor) or more.")
