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
    """The claims of this process on the bundles of one plan.

    Attributes:
        mark: a file; a worker that sees it has this folder, and may store there.
    """

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
            accompanied = any(self._lives(path.name.removesuffix(PROCESS)) for path in self._others(PROCESS))
            if accompanied:
                self._leave()
            if not accompanied or not any(self._others(PROCESS)):  # the other may have left at the same moment
                self._clear()

    def take(self, bundle: int) -> bool:
        """Claim a bundle; False where a process that lives has it."""
        for turn in itertools.count():
            path = self._path(bundle, turn)
            if self._create(path):
                return True
            if self._holds(path):
                return False
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
        return iter(list(itertools.takewhile(lambda path: path.exists(), turns)))

    def _create(self, path: Path) -> bool:
        """Make a claim; False where somebody has made it before."""
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(self.own)
        except FileExistsError:
            return False
        return True

    def _holds(self, path: Path) -> bool:
        """Whether a claim still counts; one that its owner is just writing, or has just given up, does."""
        try:
            owner = path.read_text(encoding="utf-8")
            return self._lives(owner) if owner else self._now() - _modified_s(path) < LIMIT_S
        except FileNotFoundError:
            return True

    def _lives(self, owner: str) -> bool:
        if owner == self.own:
            return True
        host, number, _ = owner.rsplit(".", 2)
        if host == machine() and not _runs(int(number)):
            return False
        try:
            return self._now() - _modified_s(self.folder / f"{owner}{PROCESS}") < LIMIT_S
        except FileNotFoundError:
            return False

    def _now(self) -> float:
        """The time as the file system has it [s]."""
        self._touch()
        return _modified_s(self.mark)

    def _touch(self) -> None:
        """Say that this process lives."""
        os.utime(self.mark)

    def _others(self, kind: str) -> Iterator[Path]:
        return (path for path in self.folder.glob(f"*{kind}") if path != self.mark)

    def _leave(self) -> None:
        self._give_up()
        self.mark.rename(self.mark.with_suffix(LEFT))

    def _give_up(self) -> None:
        for path in self.folder.glob(f"{self.plan}.*{CLAIM}"):
            if path.read_text(encoding="utf-8") == self.own:
                path.unlink(missing_ok=True)

    def _clear(self) -> None:
        for path in self.folder.iterdir():
            path.unlink(missing_ok=True)
        self.folder.rmdir()

    def _beat(self) -> None:
        while not self._ended.wait(BEAT_S):
            with suppress(OSError):  # a server that does not answer now does later
                self._touch()


def _modified_s(path: Path) -> float:
    return path.stat().st_mtime


def _runs(number: int) -> bool:
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it is somebody else's
        return True
    return True
