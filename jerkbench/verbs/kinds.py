"""Types of the command line."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    Verbs = argparse._SubParsersAction[argparse.ArgumentParser]  # noqa: SLF001 - argparse has no public name for it
else:
    Verbs = Any


def count(text: str) -> int:
    """Read a number of things.

    Raises:
        ArgumentTypeError: it is none.
    """
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"'{text}' is no number of scenarios; give 0 or more")
    return int(text)


def output(text: str) -> Path:
    """Read the path of a file or folder to write.

    Raises:
        ArgumentTypeError: it is empty.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError("the path is empty; give the name of a file or folder")
    return Path(text)


def percentage(text: str) -> float:
    """Read a limit in percent.

    Raises:
        ArgumentTypeError: it is no number that a change could exceed.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > -100.0):
        raise argparse.ArgumentTypeError(f"'{text}' is no percentage; give a number, for example 5")
    return value
