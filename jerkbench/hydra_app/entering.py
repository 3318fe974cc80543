"""The words of `jerkbench suite run`: those of `jerkbench run` that make a method."""

import re
from collections.abc import Sequence

from jerkbench.errors import PluginError
from jerkbench.hydra_app.composition import owner
from jerkbench.hydra_app.words import composed
from jerkbench.suite.entrant import Entrant

METHOD = ("filter", "adaptation", "noise", "r_scale")
"""Groups of a method; all else is the suite's."""


def entrant_of(words: Sequence[str]) -> Entrant:
    """Return the method that ``words`` describe.

    Raises:
        JerkbenchError: a word is unknown, or not of a method.
    """
    for word in words:
        if owner(word) not in METHOD:
            raise PluginError(
                f"'{word}' is not part of a method; the suite sets all else. Give {', '.join(METHOD)} and what is in"
                " them, for example filter=jerk adaptation=mtf adaptation.window=3."
            )
    spec = composed(words).cell().spec
    return Entrant(**{kind: dict(spec[kind]) for kind in ("filter", "adaptation", "r_scale")})


def folder_name(entry: str) -> str:
    """Return what the folder of an entry is called: its name, without what a folder should not have."""
    return re.sub(r"[^\w.]+", "-", entry).strip("-.") or "entry"
