"""What a person reads: notices, each once, whichever of the processes comes first with it; and text as plain text."""

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
"""Environment variable: where processes that work together note what has been said."""

_GIVEN: set[str] = set()
"""Notices that this process has given, or has seen given."""


def notify(text: str, topic: str = "") -> None:
    """Write ``text`` to standard error, unless something was said about its ``topic`` (default: the same text)."""
    topic = topic or text
    if topic in _GIVEN:
        return
    _GIVEN.add(topic)
    if _claimed(topic):
        sys.stderr.write(f"jerkbench: {text}\n")


@contextmanager
def shared_notices() -> Iterator[None]:
    """Let this process, and those that it starts meanwhile, say each thing once between them."""
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
    """Whether it is this process that speaks of ``topic``; one whose word cannot be noted is rather said twice."""
    folder = os.environ.get(NOTICES_FOLDER)
    if not folder:
        return True
    try:
        (Path(folder) / hashlib.sha256(topic.encode()).hexdigest()).touch(exist_ok=False)
    except FileExistsError:
        return False
    except OSError:
        return True
    return True


# Text from elsewhere as plain text: what would steer a terminal is written out.


STEERING = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f"  # controls, but tab and newline
    "\u200e\u200f\u2028-\u202e\u2066-\u2069"  # which end a line, or turn the direction of what follows
    "\ud800-\udfff]"  # bytes of a file name that are no text
)


def plain(text: str) -> str:
    r"""Return ``text`` with every character that steers a terminal as its escape.

    >>> plain("/imu\x1b[2J")
    '/imu\\x1b[2J'
    """
    return STEERING.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def is_plain(text: str) -> bool:
    """Whether nothing in ``text`` steers a terminal."""
    return STEERING.search(text) is None


class PlainStream:
    """A text stream to which nothing goes but plain text.

    Attributes:
        styled: the stream behind it, for what draws in colours of its own.
    """

    def __init__(self, stream: TextIO) -> None:
        """Write to ``stream``."""
        self.styled = stream

    def write(self, text: str) -> int:
        """Write ``text``; returns its length."""
        self.styled.write(plain(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write each of ``lines``."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the stream has
        """Give everything else of the stream."""
        return getattr(self.styled, name)


def styled(stream: TextIO) -> TextIO:
    """Return the stream that takes colours: the one behind a `PlainStream`, or ``stream`` itself."""
    return stream.styled if isinstance(stream, PlainStream) else stream


@contextmanager
def plain_output() -> Iterator[None]:
    """Let nothing but plain text through standard output and standard error."""
    with redirect_stdout(_plain(sys.stdout)), redirect_stderr(_plain(sys.stderr)):
        yield


def keep_output_plain() -> None:
    """The same, for as long as the process lives."""
    sys.stdout, sys.stderr = _plain(sys.stdout), _plain(sys.stderr)


def _plain(stream: TextIO) -> TextIO:
    return cast("TextIO", PlainStream(styled(stream)))
