"""Errors that are sentences: what was given, what there is, what to do."""

import difflib
import errno
import sys
from collections.abc import Collection, Iterable
from typing import NoReturn

BAD_INPUT = 2
"""Exit code of the command line where the input is at fault."""

NOT_COMPARABLE = 4
"""Exit code of the command line where two sets of results cannot be compared, or not all of them."""

INTERRUPTED = 130
"""Exit code of the command line after Ctrl-C."""


MAX_MESSAGE_CHARACTERS = 8000
"""Characters of a message."""

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)
"""Errors of the system for a full disk."""


class JerkbenchError(Exception):
    """Anything the user can put right; the command line prints its message and no traceback.

    Attributes:
        exit_code: with which the command line ends.
    """

    exit_code = BAD_INPUT


class NotComparableError(JerkbenchError):
    """Two sets of results that have nothing in common, or were not measured alike."""

    exit_code = NOT_COMPARABLE


class RecordingError(JerkbenchError):
    """A recording, or a file it comes from, that cannot be used as it is."""


class PluginError(JerkbenchError):
    """A plugin that is unknown, or whose parameters do not fit."""


def unknown(kind: str, name: str, available: Iterable[str]) -> str:
    """Return the sentence for a ``name`` that no ``kind`` has, with the nearest match and all names.

    >>> unknown("filter", "jrk", ["baseline", "jerk"])
    "There is no filter 'jrk'. Did you mean 'jerk'? Available: baseline, jerk."
    >>> unknown("tag", "thesis", [])
    "There is no tag 'thesis'; there is none at all."
    """
    names = sorted(available)
    if not names:
        return f"There is no {kind} '{name}'; there is none at all."
    near = difflib.get_close_matches(name, names, n=1)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    return f"There is no {kind} '{name}'.{hint} Available: {', '.join(names)}."


def require_known(kind: str, name: str, available: Collection[str], error: type[JerkbenchError] = PluginError) -> None:
    """Raise ``error`` with the sentence of `unknown` where ``name`` is not among ``available``."""
    if name not in available:
        raise error(unknown(kind, name, available))


def article(noun: str) -> str:
    """Return the indefinite article of ``noun``."""
    return "an" if noun[0] in "aeiou" else "a"


def let_interrupt_through(error: BaseException | None) -> None:
    """Raise the interrupt that was on its way when ``error`` was raised: a library tidied up what it had half made.

    Raises:
        KeyboardInterrupt: there was one.
    """
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            raise error
        error = error.__context__


def exit_with(error: JerkbenchError) -> NoReturn:
    """End the command line with the sentence of ``error``.

    Raises:
        KeyboardInterrupt: an interrupt is behind the error.
    """
    let_interrupt_through(error)
    print(f"jerkbench: {shortened(str(error))}", file=sys.stderr)
    raise SystemExit(error.exit_code) from None


def shortened(text: str) -> str:
    """Return ``text`` without its middle where it is longer than a screen, as one that repeats megabytes."""
    if len(text) <= MAX_MESSAGE_CHARACTERS:
        return text
    half = MAX_MESSAGE_CHARACTERS // 2
    return f"{text[:half]} [... {len(text) - 2 * half} characters ...] {text[-half:]}"
