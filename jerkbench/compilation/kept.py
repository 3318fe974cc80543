"""Compiled code on the disk: one file for each entry point, which is believed only as far as it can be checked."""

import hashlib
import json
import os
import stat
from collections.abc import Mapping
from pathlib import Path

from jerkbench.files import write_atomically

Files = Mapping[str, bytes]
"""What numba wrote for an entry point, and its text: content by name."""


class Distrusted(Exception):  # noqa: N818 - no error: it is compiled anew
    """Why a file is not loaded."""


def read_kept(path: Path, name: str, source: str) -> Files | None:
    """Return what `write_kept` kept at ``path``, or None where there is nothing to read.

    Loading it means running it. The file that is checked is the one that is read, whoever puts another in its place.

    Args:
        path: the file.
        name: of the entry point's module.
        source: its text.

    Raises:
        Distrusted: it belongs to somebody else, others may write to it, or it is not what was written.
    """
    try:
        with path.open("rb") as file:
            _require_own(os.fstat(file.fileno()))
            content = file.read()
    except OSError:  # there is none, or it cannot be read; whether it can be written shows later
        return None
    return _unpacked(content, name, source)


def write_kept(path: Path, files: Files) -> None:
    """Keep ``files`` at ``path``, as a whole, for this user.

    Raises:
        OSError: nothing can be written there.
    """
    lengths = {name: len(inside) for name, inside in files.items()}
    packed = b"".join([json.dumps(lengths).encode(), b"\n", *files.values()])

    def write(partial: Path) -> None:
        """Write it so that nobody else may."""
        partial.touch(mode=0o600)
        partial.write_bytes(hashlib.sha256(packed).hexdigest().encode() + b"\n" + packed)

    write_atomically(path, write)


def _require_own(file: os.stat_result) -> None:
    """Check that only this user, or the system's, can have written it; where there are no such users, all is well."""
    if not hasattr(os, "geteuid"):
        return
    if file.st_uid not in (os.geteuid(), 0):
        raise Distrusted(f"it belongs to another user ({file.st_uid})")
    if file.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise Distrusted("others may write to it")


def _unpacked(content: bytes, name: str, source: str) -> Files:
    digest, _, packed = content.partition(b"\n")
    if digest != hashlib.sha256(packed).hexdigest().encode():
        raise Distrusted("it is not what was written there")
    head, _, rest = packed.partition(b"\n")
    files, begin = {}, 0
    for inside, length in json.loads(head).items():
        files[inside] = rest[begin : begin + length]
        begin += length
    if files.get(f"{name}.py") != source.encode():
        raise Distrusted("it belongs to something else")
    return files
