"""Public recordings from where they are published: listed, downloaded, checked, kept."""

import http.client
import shutil
import tomllib
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import IO, NamedTuple
from urllib.parse import quote

from jerkbench.errors import RecordingError, require_known

# The download of a file over HTTP into a part that survives: an interrupted one goes on where it
# stopped.

ATTEMPTS = 4
"""The number of times that a lost connection is opened again before giving up."""

TIMEOUT_S = 30.0
BLOCK_BYTES = 1 << 16

_OK, PARTIAL, BEYOND = 200, 206, 416


class ResumingDownloader:
    """A downloader for `pooch`: keeps ``part`` until the file is whole, and asks for the rest of it only."""

    def __init__(self, part: Path) -> None:
        """Keep what was received in ``part``."""
        self.part = part

    def __call__(self, url: str, output_file: str | IO[bytes], pooch: object) -> None:
        """Download ``url`` to ``output_file``.

        Raises:
            RecordingError: the server refuses, or the connection is cut again and again; the part is kept.
        """
        del pooch
        self.part.parent.mkdir(parents=True, exist_ok=True)
        for _ in range(ATTEMPTS):
            if not (reason := self._receive(url)):
                break
        else:
            received = self.part.stat().st_size if self.part.exists() else 0
            kept = f"{received} bytes are kept, and the same command goes on from there."
            raise RecordingError(f"{url}: {reason}; {kept}")
        with self.part.open("rb") as source:
            if isinstance(output_file, str):
                shutil.copyfile(self.part, output_file)
            else:
                shutil.copyfileobj(source, output_file)
        self.part.unlink()

    def _receive(self, url: str) -> str:
        """Receive the rest; returns why it was cut off, or an empty string."""
        have = self.part.stat().st_size if self.part.exists() else 0
        request = urllib.request.Request(url, headers={"Range": f"bytes={have}-"} if have else {})  # noqa: S310 - from the registry
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT_S) as answer:  # noqa: S310 - as above
                self._append(answer, resumed=answer.status == PARTIAL)
        except urllib.error.HTTPError as error:
            if error.code == BEYOND:  # the part is whole already, or of another file: the hash decides
                return ""
            refused = f"{url}: the server answers {error.code} {error.reason}; try again later."
            if error.code == http.HTTPStatus.NOT_FOUND:
                refused = f"There is nothing at {url} (404); the repository may have moved: fetch the file by hand."
            raise RecordingError(refused) from error
        except urllib.error.URLError as error:
            return f"the server cannot be reached ({error.reason})"
        except (OSError, http.client.HTTPException) as error:
            return f"the connection was cut ({type(error).__name__})"
        return ""

    def _append(self, answer: http.client.HTTPResponse, *, resumed: bool) -> None:
        with self.part.open("ab" if resumed else "wb") as file:
            while block := answer.read(BLOCK_BYTES):
                file.write(block)
        if answer.length:  # a plain read() stops at a cut without a word
            raise http.client.IncompleteRead(b"", answer.length)


# The public recordings that can be fetched, from the registry beside this file.

REGISTRY = Path(__file__).parent / "recordings.toml"


class PublicFile(NamedTuple):
    """One file of a recording.

    Attributes:
        name: relative to the recording's folder.
        url: where it is published, at a fixed commit.
        sha256: of its bytes.
    """

    name: str
    url: str
    sha256: str


class PublicRecording(NamedTuple):
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
    require_known("public recording", name, known, RecordingError)
    return known[name]


def _recording(name: str, entry: dict[str, object]) -> PublicRecording:
    address, listed = str(entry["address"]), entry["files"]
    assert isinstance(listed, dict)  # noqa: S101 - the registry is our own
    files = (PublicFile(local, address + quote(path), sha256) for local, (path, sha256) in listed.items())
    return PublicRecording(name, str(entry["title"]), str(entry["licence"]), tuple(files))


PARTS_FOLDER = ".parts"
"""Folder of what was received of files that are not whole yet."""


def fetch(recording: PublicRecording, folder: Path, say: Callable[[str], None]) -> None:
    """Download what ``folder`` lacks of the recording, and check every file's SHA-256.

    The folder appears under its name only when all of it is there: until then it is called ``NAME.incomplete``.

    Raises:
        RecordingError: a file cannot be had, is not the one that is listed, or cannot be written.
    """
    unfinished = folder.with_name(f"{folder.name}.incomplete")
    try:
        if folder.is_dir():
            folder.rename(unfinished)
        unfinished.mkdir(parents=True, exist_ok=True)
        for file in recording.files:
            _fetch_file(file, unfinished, say)
        if (unfinished / PARTS_FOLDER).is_dir():
            (unfinished / PARTS_FOLDER).rmdir()
        unfinished.rename(folder)
    except OSError as error:
        raise RecordingError(f"{folder} cannot be written: {error.strerror or error}.") from error


def _fetch_file(file: PublicFile, folder: Path, say: Callable[[str], None]) -> None:
    import pooch

    target = folder / file.name
    present = target.is_file() and pooch.file_hash(str(target)) == file.sha256
    say(f"{file.name}: {'there' if present else 'downloading'}")
    if present:
        return
    target.unlink(missing_ok=True)
    pooch.get_logger().setLevel("WARNING")  # what is downloaded was said above
    try:
        downloader = ResumingDownloader(folder / PARTS_FOLDER / file.sha256)
        pooch.retrieve(file.url, file.sha256, fname=target.name, path=target.parent, downloader=downloader)
    except ValueError as error:  # pooch's word for a wrong hash
        raise RecordingError(
            f"{file.url} is not the file that was recorded (its SHA-256 is another); nothing of it is kept: try again,"
            " and if it stays so, the publisher has changed the file."
        ) from error
