"""Claims on bundles: of several processes that work on one folder, one runs each.

A claim is a file that only one process can make. It holds as long as its owner lives: a process touches a file of its
own every `BEAT_S`, and one whose file is older than `LIMIT_S`, or of which this machine knows that it has ended, has
lost its claims. Times are those of the file system, not of any machine's clock.
"""

import itertools
import os
import re
import socket
import threading
import uuid
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

BEAT_S = 10.0
LIMIT_S = 120.0
PROCESS, LEFT, CLAIM = ".process", ".left", ".claim"


def machine() -> str:
    """Name this machine, or the container: two of one name have processes of the same number."""
    namespace = Path("/proc/self/ns/pid")
    with suppress(OSError):
        return f"{_host()}_{namespace.stat().st_ino}"
    return _host()


def _host() -> str:
    return re.sub(r"[^A-Za-z0-9_-]", "_", socket.gethostname())


class Claims:
    """The claims of this process on the bundles of one plan."""

    def __init__(self, folder: Path, plan: str) -> None:
        """Claim in ``folder``; ``plan`` names the plan, whose bundles others number alike."""
        self.folder, self.plan = folder, plan
        self.own = f"{machine()}.{os.getpid()}.{uuid.uuid4().hex[:12]}"
        self.mark = folder / f"{self.own}{PROCESS}"
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._beat, daemon=True)

    def __enter__(self) -> Self:
        """Register this process."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self.mark.touch()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give up what is still claimed; the last process clears the folder."""
        self._ended.set()
        self._thread.join()
        with suppress(OSError):  # what is left says that a process has been here, which is no harm
            if any(self._lives(path.name.removesuffix(PROCESS)) for path in self._others(PROCESS)):
                self._leave()
            else:
                self._clear()

    def take(self, bundle: int) -> bool:
        """Claim a bundle; False where a process that lives has it."""
        for turn in itertools.count():
            path = self._path(bundle, turn)
            try:
                with path.open("x", encoding="utf-8") as file:
                    file.write(self.own)
            except FileExistsError:
                if self._holds(path):
                    return False
            else:
                return True
        raise AssertionError("One turn is free.")

    def release(self, bundle: int) -> None:
        """Give up a bundle, and what a process that has ended left of a claim on it."""
        for path in self._turns(bundle):
            path.unlink(missing_ok=True)

    def alone(self) -> bool:
        """Whether no other process has been here since this one came."""
        return not any(itertools.chain(self._others(PROCESS), self._others(LEFT)))

    def _path(self, bundle: int, turn: int) -> Path:
        return self.folder / f"{self.plan}.{bundle}.{turn}{CLAIM}"

    def _turns(self, bundle: int) -> Iterator[Path]:
        turns = (self._path(bundle, turn) for turn in itertools.count())
        return iter(list(itertools.takewhile(Path.exists, turns)))

    def _holds(self, path: Path) -> bool:
        """Whether a claim still counts; one that its owner is just writing, or has just given up, does."""
        try:
            owner = path.read_text(encoding="utf-8")
            return self._lives(owner) if owner else self._now() - path.stat().st_mtime < LIMIT_S
        except FileNotFoundError:
            return True

    def _lives(self, owner: str) -> bool:
        if owner == self.own:
            return True
        host, number, _ = owner.rsplit(".", 2)
        if host == machine() and not _runs(int(number)):
            return False
        try:
            return self._now() - (self.folder / f"{owner}{PROCESS}").stat().st_mtime < LIMIT_S
        except FileNotFoundError:
            return False

    def _now(self) -> float:
        """The time as the file system has it [s]."""
        os.utime(self.mark)
        return self.mark.stat().st_mtime

    def _others(self, kind: str) -> Iterator[Path]:
        return (path for path in self.folder.glob(f"*{kind}") if path != self.mark)

    def _leave(self) -> None:
        for path in self.folder.glob(f"{self.plan}.*{CLAIM}"):
            if path.read_text(encoding="utf-8") == self.own:
                path.unlink(missing_ok=True)
        self.mark.rename(self.mark.with_suffix(LEFT))

    def _clear(self) -> None:
        for path in self.folder.iterdir():
            path.unlink(missing_ok=True)
        self.folder.rmdir()

    def _beat(self) -> None:
        while not self._ended.wait(BEAT_S):
            with suppress(OSError):  # a server that does not answer now does later
                os.utime(self.mark)


class Unclaimed:
    """No claims, on a folder of an object store, where nobody can make a file that only one process can make.

    Attributes:
        mark: a file that is not there, so that workers store nothing themselves.
    """

    def __init__(self, folder: Path) -> None:
        """Stand for claims in ``folder``."""
        self.mark = folder / "none"

    def __enter__(self) -> Self:
        """Do nothing."""
        return self

    def __exit__(self, *_: object) -> None:
        """Do nothing."""

    def take(self, _: int) -> bool:
        """Take every bundle."""
        return True

    def release(self, _: int) -> None:
        """Do nothing."""

    def alone(self) -> bool:
        """Believe so."""
        return True


def _runs(number: int) -> bool:
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it is somebody else's
        return True
    return True
