"""Text from elsewhere as plain text: what would steer a terminal is written out."""

import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from typing import Any, TextIO, cast

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
