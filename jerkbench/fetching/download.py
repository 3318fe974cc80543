"""The download of a file over HTTP into a part that survives: an interrupted one goes on where it stopped."""

import http.client
import shutil
import urllib.error
import urllib.request
from pathlib import Path
from typing import IO

from jerkbench.errors import RecordingError

ATTEMPTS = 4
"""The number of times that a lost connection is opened again before giving up."""

TIMEOUT_S = 30.0
BLOCK = 1 << 16

OK, PARTIAL, BEYOND = 200, 206, 416


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
        reason = ""
        for _ in range(ATTEMPTS):
            reason = self._receive(url)
            if not reason:
                break
        else:
            received = self.part.stat().st_size if self.part.exists() else 0
            raise RecordingError(
                f"{url}: {reason}; {received} bytes are kept, and the same command goes on from there."
            )
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
            raise RecordingError(_refused(url, error)) from error
        except urllib.error.URLError as error:
            return f"the server cannot be reached ({error.reason})"
        except (OSError, http.client.HTTPException) as error:
            return f"the connection was cut ({type(error).__name__})"
        return ""

    def _append(self, answer: http.client.HTTPResponse, *, resumed: bool) -> None:
        with self.part.open("ab" if resumed else "wb") as file:
            while block := answer.read(BLOCK):
                file.write(block)
        if answer.length:  # a plain read() stops at a cut without a word
            raise http.client.IncompleteRead(b"", answer.length)


def _refused(url: str, error: urllib.error.HTTPError) -> str:
    if error.code == http.HTTPStatus.NOT_FOUND:
        return f"There is nothing at {url} (404); the repository may have moved: fetch the file by hand."
    return f"{url}: the server answers {error.code} {error.reason}; try again later."
