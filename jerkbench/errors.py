"""Errors that are sentences: what was given, what there is, what to do."""

import difflib
from collections.abc import Iterable


class JerkbenchError(Exception):
    """Anything the user can put right; the command line prints its message and no traceback."""


class RecordingError(JerkbenchError):
    """A recording, or a file it comes from, that cannot be used as it is."""


class PluginError(JerkbenchError):
    """A plugin that is unknown, or whose parameters do not fit."""


def unknown(what: str, given: str, available: Iterable[str]) -> str:
    """Say that ``given`` is no ``what``, what there is, and the nearest match.

    >>> unknown("filter", "jrk", ["baseline", "jerk"])
    "There is no filter 'jrk'. Did you mean 'jerk'? Available: baseline, jerk."
    """
    names = sorted(available)
    near = difflib.get_close_matches(given, names, n=1)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    return f"There is no {what} '{given}'.{hint} Available: {', '.join(names)}."
