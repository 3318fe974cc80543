"""The public recordings that can be fetched, from the registry beside this file."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from jerkbench.errors import RecordingError, unknown

REGISTRY = Path(__file__).parent / "recordings.toml"


@dataclass(frozen=True)
class PublicFile:
    """One file of a recording.

    Attributes:
        name: relative to the recording's folder.
        url: where it is published, at a fixed commit.
        sha256: of its bytes.
    """

    name: str
    url: str
    sha256: str


@dataclass(frozen=True)
class PublicRecording:
    """A recording that anybody may fetch.

    Attributes:
        name: its name here.
        title: one phrase about it.
        licence: its SPDX identifier.
        files: all of it.
    """

    name: str
    title: str
    licence: str
    files: tuple[PublicFile, ...]


def public_recordings(registry: Path = REGISTRY) -> dict[str, PublicRecording]:
    """Return every recording of the registry by its name."""
    entries = tomllib.loads(registry.read_text(encoding="utf-8"))
    return {name: _recording(name, entry) for name, entry in entries.items()}


def public_recording(name: str, registry: Path = REGISTRY) -> PublicRecording:
    """Return one of them.

    Raises:
        RecordingError: there is none of that name.
    """
    known = public_recordings(registry)
    if name not in known:
        raise RecordingError(unknown("public recording", name, known))
    return known[name]


def _recording(name: str, entry: dict[str, object]) -> PublicRecording:
    address, listed = str(entry["address"]), entry["files"]
    assert isinstance(listed, dict)  # noqa: S101 - the registry is our own
    files = (PublicFile(local, address + quote(path), sha256) for local, (path, sha256) in listed.items())
    return PublicRecording(name, str(entry["title"]), str(entry["licence"]), tuple(files))
