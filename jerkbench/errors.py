"""Exceptions whose message states the given value, the allowed values and a remedy."""

import difflib
import errno
import sys
from collections.abc import Collection, Iterable
from typing import NoReturn

FAILED = 1
"""Exit code of the command line if a run failed, a plugin violates its contract, or a repeated run differs."""

BAD_INPUT = 2
"""Exit code of the command line for invalid input."""

NOT_COMPARABLE = 4
"""Exit code of the command line if two sets of results, or parts of them, cannot be compared."""

INTERRUPTED = 130
"""Exit code of the command line after Ctrl-C."""


MAX_MESSAGE_CHARACTERS = 8000
"""Maximum number of characters of a message. Longer messages are shortened in the middle."""

DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)
"""Error numbers of the operating system for a disk that is full or read-only."""


class JerkbenchError(Exception):
    """Base class of the errors that a user can correct. The command line prints the message without a traceback.

    Attributes:
        exit_code: Exit code of the command line.
    """

    exit_code = BAD_INPUT


class NotComparableError(JerkbenchError):
    """Two sets of results cannot be compared: they have nothing in common, or were measured differently."""

    exit_code = NOT_COMPARABLE


class RecordingError(JerkbenchError):
    """A recording is invalid, or the file of a recording is invalid."""


class PluginError(JerkbenchError):
    """A plugin is unknown, or its parameters are invalid."""


def unknown(kind: str, name: str, available: Iterable[str]) -> str:
    """Return the error message for an unknown ``name``, with the most similar name and all available names.

    >>> unknown("filter", "jrk", ["baseline", "jerk"])
    "There is no filter 'jrk'. Did you mean 'jerk'? Available: baseline, jerk."
    >>> unknown("tag", "thesis", [])
    "There is no tag 'thesis'. Available: none."
    """
    names = sorted(available)
    near = difflib.get_close_matches(name, names, n=1)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    listed = ", ".join(f"'{one}'" if "," in one else one for one in names)  # such as the label 'baseline, tuned'
    return f"There is no {kind} '{name}'.{hint} Available: {listed or 'none'}."


def require_known(kind: str, name: str, available: Collection[str], error: type[JerkbenchError] = PluginError) -> None:
    """Raise ``error`` with the message of `unknown` if ``name`` is not among ``available``."""
    if name not in available:
        raise error(unknown(kind, name, available))


def article(noun: str) -> str:
    """Return the indefinite article for ``noun``: "a" or "an"."""
    return "an" if noun[0] in "aeiou" else "a"


def let_interrupt_through(error: BaseException | None) -> None:
    """Raise ``error`` if it is a `KeyboardInterrupt`, or the `KeyboardInterrupt` in its context, or nothing.

    A library that cleans up after an interrupt may raise another exception, which would hide the interrupt.

    Raises:
        KeyboardInterrupt: ``error``, or an exception in its context, is an interrupt.
    """
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            raise error
        error = error.__context__


def exit_with(error: JerkbenchError) -> NoReturn:
    """Print the message of ``error``, and exit the process with the exit code of ``error``.

    Raises:
        KeyboardInterrupt: The error was raised while a `KeyboardInterrupt` was handled.
    """
    let_interrupt_through(error)
    print(f"jerkbench: {shortened(str(error))}", file=sys.stderr)
    raise SystemExit(error.exit_code) from None


def shortened(text: str, maximum: int = MAX_MESSAGE_CHARACTERS) -> str:
    """Return ``text`` without its middle if it has more than ``maximum`` characters."""
    if len(text) <= maximum:
        return text
    half = maximum // 2
    return f"{text[:half]} [... {len(text) - 2 * half} characters ...] {text[-half:]}"
