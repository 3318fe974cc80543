"""The download of a public recording into the cache: intact files stay, the others are downloaded and checked."""

from collections.abc import Callable
from pathlib import Path

from jerkbench.errors import RecordingError
from jerkbench.fetching.download import ResumingDownloader
from jerkbench.fetching.listing import PublicFile, PublicRecording

PARTS = ".parts"
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
        if (unfinished / PARTS).is_dir():
            (unfinished / PARTS).rmdir()
        unfinished.rename(folder)
    except OSError as error:
        raise RecordingError(f"{folder} cannot be written: {error.strerror or error}.") from error


def _fetch_file(file: PublicFile, folder: Path, say: Callable[[str], None]) -> None:
    import pooch

    target, name = folder / file.name, Path(file.name)
    present = target.is_file() and pooch.file_hash(str(target)) == file.sha256
    say(f"{file.name}: {'there' if present else 'downloading'}")
    if present:
        return
    target.unlink(missing_ok=True)
    pooch.get_logger().setLevel("WARNING")  # what is downloaded was said above
    try:
        pooch.retrieve(
            file.url,
            known_hash=file.sha256,
            fname=name.name,
            path=target.parent,
            downloader=ResumingDownloader(folder / PARTS / file.sha256),
        )
    except ValueError as error:  # pooch's word for a wrong hash
        raise RecordingError(
            f"{file.url} is not the file that was recorded (its SHA-256 is another); nothing of it is kept: try again,"
            " and if it stays so, the publisher has changed the file."
        ) from error
