"""Addresses of results: a folder of this machine, or one of an object store."""

import re
from pathlib import Path
from typing import cast

from jerkbench.errors import JerkbenchError, unknown

ADDRESS = re.compile("([a-z][a-z0-9+]+)://?")
"""The beginning of an address; a single slash is what is left of two where an address went through a `Path`."""

LOCAL = ("file", "local")


def place(words: str) -> Path:
    """Return the folder that was named: a `Path`, or for "s3://BUCKET/FOLDER" what offers the same of it.

    Raises:
        JerkbenchError: nothing is known of such addresses, or a package for them is not installed.
    """
    match = ADDRESS.match(words)
    if match is None:
        return Path(words)
    protocol, rest = match[1], words[match.end() :]
    if protocol in LOCAL:
        return Path(f"/{rest.lstrip('/')}")
    try:
        from fsspec import available_protocols, get_filesystem_class
        from upath import UPath
    except ModuleNotFoundError as error:
        raise JerkbenchError(_not_installed(words, error)) from error
    if protocol not in available_protocols():
        raise JerkbenchError(unknown("kind of address", protocol, ["s3", "gs", "memory", "file"]))
    try:
        get_filesystem_class(protocol)
    except ImportError as error:
        raise JerkbenchError(_not_installed(words, error)) from error
    folder = UPath(f"{protocol}://{rest}", use_listings_cache=False)  # others write there too
    return cast("Path", folder)  # of a path it offers all that is asked of results


def is_remote(path: Path) -> bool:
    """Whether a path is one of an object store, which has neither locks nor half-written files."""
    return not isinstance(path, Path)


def _not_installed(words: str, error: ImportError) -> str:
    reason = str(error).rstrip(".")
    return f"{words} cannot be reached ({reason}); pip install 'jerkbench[remote]' brings what s3:// needs."
