"""Notices to a person: each once, whichever of the processes that work together comes first with it."""

import hashlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

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
