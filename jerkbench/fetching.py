"""Public recordings from where they are published: listed, downloaded, checked, kept."""

import http.client
import shutil
import time
import tomllib
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, NamedTuple
from urllib.parse import quote

from jerkbench.errors import NO_ROOM, RecordingError, require_known

# The download of a file over HTTP into a part that survives: an interrupted one goes on where it
# stopped.

ATTEMPTS = 4
"""The number of times that a lost connection is opened again before giving up."""

TIMEOUT_S = 30.0
BLOCK_BYTES = 1 << 16

MAX_BYTES = 2 * 10**9
"""The limit for a file whose size the registry does not have."""

MIN_BYTES_PER_S, PERIOD_S = 2000.0, 30.0
"""A download ends if its rate is lower over such a period."""

PROGRESS_S = 5.0
"""The time between two lines of progress."""


class HttpsRedirects(urllib.request.HTTPRedirectHandler):
    """Follows redirects to https addresses only."""

    def redirect_request(self, req: urllib.request.Request, *others: Any) -> urllib.request.Request | None:  # noqa: ANN401 - urllib's signature
        """Return the request for the new address.

        Raises:
            RecordingError: the address is not one of https.
        """
        if not others[-1].startswith("https://"):
            raise RecordingError(f"{req.full_url} redirects to {others[-1]}, which is not https; nothing was fetched.")
        return super().redirect_request(req, *others)


class ResumingDownloader:
    """A downloader for `pooch`: it keeps ``part`` until the file is complete, and requests only the rest of it.

    Attributes:
        part: the file with the bytes received so far.
        size: number of bytes of the complete file; 0: not known.
        say: prints a line of progress.
    """

    def __init__(self, part: Path, size: int = 0, say: Callable[[str], None] = print) -> None:
        """Store the parameters."""
        self.part, self.size, self.say = part, size, say

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
            with urllib.request.build_opener(HttpsRedirects).open(request, timeout=TIMEOUT_S) as answer:
                self._append(url, answer, resumed=answer.status == http.HTTPStatus.PARTIAL_CONTENT)
        except urllib.error.HTTPError as error:
            if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE and have:
                if have == (self.size or have):  # complete, unless the hash says otherwise
                    return ""
                self.part.unlink()
                return f"the server does not continue the file after {have} bytes"
            refused = f"{url}: the server answers {error.code} {error.reason}; try again later."
            if error.code == http.HTTPStatus.NOT_FOUND:
                refused = f"There is nothing at {url} (404); the repository may have moved: fetch the file by hand."
            raise RecordingError(refused) from error
        except urllib.error.URLError as error:
            return f"the server cannot be reached ({error.reason})"
        except (OSError, http.client.HTTPException) as error:
            if isinstance(error, OSError) and error.errno in NO_ROOM:
                raise
            return f"the connection was cut ({type(error).__name__})"
        except ValueError as error:
            raise RecordingError(f"{url} redirects to an invalid address ({error}); nothing was fetched.") from error
        return ""

    def _append(self, url: str, answer: http.client.HTTPResponse, *, resumed: bool) -> None:
        """Write the answer to the part; refuse one that is too large or too slow."""
        limit = self.size or MAX_BYTES
        begun = shown = time.monotonic()
        with self.part.open("ab" if resumed else "wb") as file:
            before = file.tell()
            while block := answer.read1(BLOCK_BYTES):
                file.write(block)
                have, now = file.tell(), time.monotonic()
                if have > limit:
                    file.truncate(0)
                    raise RecordingError(f"{url} sends more than the expected {limit} bytes; nothing of it is kept.")
                if now - begun >= PERIOD_S:
                    rate = (have - before) / (now - begun)
                    if rate < MIN_BYTES_PER_S:
                        raise RecordingError(
                            f"{url} sends {rate:.0f} bytes per second, and at least {MIN_BYTES_PER_S:.0f} are needed;"
                            f" {have} bytes are kept, and the same command continues from there."
                        )
                    begun, before = now, have
                if now - shown >= PROGRESS_S:
                    of_all = f" of {self.size / 1e6:.1f}" if self.size else ""
                    self.say(f"{have / 1e6:.1f}{of_all} MB")
                    shown = now
        if answer.length:  # a plain read1() ends at a cut without an exception
            raise http.client.IncompleteRead(b"", answer.length)


# The public recordings that can be fetched, from the registry beside this file.

REGISTRY = Path(__file__).parent / "recordings.toml"


class PublicFile(NamedTuple):
    """One file of a recording.

    Attributes:
        name: relative to the recording's folder.
        url: where it is published, at a fixed commit.
        sha256: of its bytes.
        size: number of its bytes; 0: not known.
    """

    name: str
    url: str
    sha256: str
    size: int = 0


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
    files = (PublicFile(local, address + quote(path), *checks) for local, (path, *checks) in listed.items())
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
        downloader = ResumingDownloader(folder / PARTS_FOLDER / file.sha256, file.size, say)
        pooch.retrieve(file.url, file.sha256, fname=target.name, path=target.parent, downloader=downloader)
    except ValueError as error:  # pooch's word for a wrong hash
        raise RecordingError(
            f"{file.url} is not the file that was recorded (its SHA-256 is another); nothing of it is kept: try again,"
            " and if it stays so, the publisher has changed the file."
        ) from error
