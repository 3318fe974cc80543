"""Notices that are printed only once by a group of processes, and functions that escape control characters."""

import hashlib
import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TextIO, cast

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
        return not isinstance(error, FileExistsError)
    return True


# Functions that escape control characters in untrusted text.


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
