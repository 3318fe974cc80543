"""Messages to the user: exceptions that state the value, the allowed values and a remedy, and notices.

A notice is printed only once by a group of processes. Control characters in messages are escaped.
"""

import difflib
import errno
import hashlib
import os
import re
import sys
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NoReturn, TextIO, cast

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


# The notices, which are printed only once by a group of processes.

NOTICES_FOLDER = "JERKBENCH_NOTICES"
"""Environment variable with the folder in which cooperating processes record the notices that were printed."""

_GIVEN: set[str] = set()
"""Topics of the notices that this process or another process has already printed."""


def notify(text: str, topic: str = "") -> None:
    """Print ``text`` on standard error, unless a notice with this ``topic`` (default: ``text``) was printed before."""
    topic = topic or text
    if topic in _GIVEN:
        return
    _GIVEN.add(topic)
    if _claimed(topic):
        sys.stderr.write(f"jerkbench: {text}\n")


@contextmanager
def shared_notices() -> Iterator[None]:
    """Print each notice only once, for this process and all processes that are started inside the context."""
    if NOTICES_FOLDER in os.environ:
        yield
        return
    with TemporaryDirectory(prefix="jerkbench-notices-") as folder:
        os.environ[NOTICES_FOLDER] = folder
        try:
            for topic in _GIVEN:
                _claimed(topic)
            yield
        finally:
            del os.environ[NOTICES_FOLDER]


def _claimed(topic: str) -> bool:
    """Return False if another process has already printed a notice with this topic, otherwise True."""
    folder = os.environ.get(NOTICES_FOLDER)
    if not folder:
        return True
    try:
        (Path(folder) / hashlib.sha256(topic.encode()).hexdigest()).touch(exist_ok=False)
    except OSError as error:
        return not isinstance(error, FileExistsError)  # an unusable folder does not hide the notice
    return True


# The functions that escape control characters in untrusted text.

STEERING = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f"  # control characters except tab and newline
    "\u200e\u200f\u2028-\u202e\u2066-\u2069"  # line separators and changes of the text direction
    "\ud800-\udfff]"  # bytes of a file name that are not valid UTF-8
)


def plain(text: str) -> str:
    r"""Return ``text`` with every control character escaped.

    >>> plain("/imu\x1b[2J")
    '/imu\\x1b[2J'
    """
    return STEERING.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def is_plain(text: str) -> bool:
    """Return whether ``text`` has no control characters."""
    return STEERING.search(text) is None


class PlainStream:
    """A text stream that escapes control characters.

    Attributes:
        styled: The underlying stream. It accepts control characters and is used for output with colours.
    """

    def __init__(self, stream: TextIO) -> None:
        self.styled = stream

    def write(self, text: str) -> int:
        """Write ``text`` with control characters escaped, and return the length of ``text``."""
        self.styled.write(plain(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write each of ``lines`` with control characters escaped."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any attribute of a stream
        """Return any other attribute of the underlying stream."""
        return getattr(self.styled, name)


def styled(stream: TextIO) -> TextIO:
    """Return the stream that accepts colours: the underlying stream of a `PlainStream`, or ``stream`` itself."""
    return stream.styled if isinstance(stream, PlainStream) else stream


@contextmanager
def plain_output() -> Iterator[None]:
    """Escape control characters in standard output and standard error inside the context."""
    with redirect_stdout(_plain(sys.stdout)), redirect_stderr(_plain(sys.stderr)):
        yield


def make_output_plain() -> None:
    """Escape control characters in standard output and standard error until the process ends."""
    sys.stdout, sys.stderr = _plain(sys.stdout), _plain(sys.stderr)


def _plain(stream: TextIO) -> TextIO:
    return cast("TextIO", PlainStream(styled(stream)))
