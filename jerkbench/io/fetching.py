"""The registry of public recordings, and their download with verification of the hashes."""

import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

from jerkbench.errors import RecordingError, require_known

TIMEOUT_S = 30.0
"""Longest time without a byte from the server [s]."""

RETRIES = 3
"""Number of further attempts after an interrupted download."""

REGISTRY = Path(__file__).parent / "recordings.toml"


class PublicFile(NamedTuple):
    """A file of a public recording.

    Attributes:
        name: Path relative to the folder of the recording.
        url: Address of the file at a fixed commit.
        sha256: SHA-256 hash of the file.
        size: Number of bytes of the file, or 0 if the size is not known.
    """

    name: str
    url: str
    sha256: str
    size: int = 0


class PublicRecording(NamedTuple):
    """A public recording.

    Attributes:
        name: Name in the registry.
        title: Description in one phrase.
        licence: SPDX identifier of the licence.
        files: All files of the recording.
    """

    name: str
    title: str
    licence: str
    files: tuple[PublicFile, ...]


def public_recordings() -> dict[str, PublicRecording]:
    """Return all recordings in the registry, by name."""
    entries = tomllib.loads(REGISTRY.read_text(encoding="utf-8"))
    return {name: _recording(name, entry) for name, entry in entries.items()}


def public_recording(name: str) -> PublicRecording:
    """Return the public recording ``name``.

    Raises:
        RecordingError: The name is unknown.
    """
    known = public_recordings()
    require_known("public recording", name, known, RecordingError)
    return known[name]


def _recording(name: str, entry: Mapping[str, Any]) -> PublicRecording:
    listed = entry["files"].items()
    files = tuple(PublicFile(local, entry["address"] + quote(path), *checks) for local, (path, *checks) in listed)
    return PublicRecording(name, entry["title"], entry["licence"], files)


def fetch(recording: PublicRecording, folder: Path, say: Callable[[str], None]) -> None:
    """Download the files of a recording that are missing in ``folder``, and verify the SHA-256 hash of every file.

    During the download, the folder is called ``NAME.incomplete``. Complete files are not downloaded again.

    Raises:
        RecordingError: A file cannot be downloaded or written, or its hash differs from the registry.
    """
    unfinished = folder.with_name(f"{folder.name}.incomplete")
    try:
        if folder.is_dir():
            folder.rename(unfinished)
        unfinished.mkdir(parents=True, exist_ok=True)
        for file in recording.files:
            _fetch_file(file, unfinished, say)
        unfinished.rename(folder)
    except OSError as error:
        raise RecordingError(f"{folder} cannot be written: {error.strerror or error}.") from error


def _fetch_file(file: PublicFile, folder: Path, say: Callable[[str], None]) -> None:
    import pooch
    from requests.exceptions import RequestException

    target = folder / file.name
    if target.is_file() and pooch.file_hash(str(target)) == file.sha256:
        say(f"{file.name}: there")
        return
    say(f"{file.name}: downloading {f'{file.size / 1e6:.1f} MB' if file.size else ''}".rstrip())
    pooch.get_logger().setLevel("ERROR")  # pooch would print the name of the file again
    hashes, urls = {file.name: file.sha256}, {file.name: file.url}
    files = pooch.create(folder, "", registry=hashes, urls=urls, retry_if_failed=RETRIES)
    try:
        files.fetch(file.name, downloader=pooch.HTTPDownloader(timeout=TIMEOUT_S))
    except RequestException as error:
        answer = type(error).__name__ if error.response is None else f"the server answers {error.response.status_code}"
        message = f"{file.url} cannot be downloaded ({answer})"
        raise RecordingError(f"{message}; run the command again to continue, or download the file by hand.") from error
    except ValueError as error:  # pooch raises a ValueError if the hash is wrong
        changed = f"The SHA-256 of {file.url} differs from the registry, so the file was not stored"
        raise RecordingError(f"{changed}. Try again; the publisher may have changed the file.") from error
