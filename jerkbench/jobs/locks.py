"""Bundles shared with other processes: locked before they run, left out where another process has run them already."""

import hashlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self
from uuid import uuid4

from filelock import FileLock, Timeout

from jerkbench.notices import notify

LOCKS_FOLDER = ".locks"
"""The folder of the locks, in the study's."""


def plan_name(draws: Mapping[str, Sequence[int]]) -> str:
    """Name a plan by its keys and their seeds; its bundles have the same numbers in every process."""
    sha = hashlib.sha256()
    for key, own in draws.items():
        sha.update(f"{key} {own}\n".encode())
    return sha.hexdigest()[:12]


class Locks:
    """The locks of this process on the bundles of one plan. A lock ends with its process, whatever has ended that.

    Attributes:
        mark: a file of this process; a worker that sees it has this folder, and may store there.
    """

    def __init__(self, folder: Path, plan: str) -> None:
        """Lock in ``folder``; ``plan`` names the plan."""
        self._folder, self._plan = folder, plan
        self.mark = folder / f"{uuid4().hex}.process"
        self._held: dict[str, FileLock] = {}

    def __enter__(self) -> Self:
        """Say that this process is here."""
        while not self.mark.exists():
            self._folder.mkdir(parents=True, exist_ok=True)
            self._take(self.mark)
            with suppress(FileNotFoundError):  # another process has just cleared the folder
                self.mark.touch()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give up what is still locked; the last process clears the folder."""
        for name in list(self._held):
            self._release(name)
        with suppress(OSError):  # what is left does no harm
            self.mark.unlink(missing_ok=True)
            if all(self._left_behind(path) for path in self._folder.glob("*.process")):
                for path in self._folder.iterdir():
                    path.unlink(missing_ok=True)
                self._folder.rmdir()

    def take(self, bundle: int) -> bool:
        """Lock a bundle; False where another process has it."""
        return self._take(self._path(bundle))

    def release(self, bundle: int) -> None:
        """Give up a bundle."""
        self._release(self._path(bundle).name)

    def _path(self, bundle: int) -> Path:
        return self._folder / f"{self._plan}.{bundle}"

    def _take(self, path: Path) -> bool:
        lock = FileLock(f"{path}.lock", timeout=0, thread_local=False)
        try:
            lock.acquire()
        except Timeout:
            return False
        except (OSError, NotImplementedError):
            notify(f"{self._folder} can hold no locks: let one process at a time work there")
            return True
        self._held[path.name] = lock
        return True

    def _release(self, name: str) -> None:
        if lock := self._held.pop(name, None):
            lock.release()

    def _left_behind(self, mark: Path) -> bool:
        """Whether the process of a mark has ended."""
        if not self._take(mark):
            return False
        self._release(mark.name)
        return True
