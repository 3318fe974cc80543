"""Claims in a folder of an object store, where it can say who was first; else a sentence."""

import uuid
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from jerkbench.notices import notify
from jerkbench.places import is_remote
from jerkbench.sweep.claims import LEFT, Claims


def claims_in(folder: Path, plan: str) -> "Claims | Unclaimed":
    """Return the claims of this process in a folder, wherever that is; ``plan`` names the plan."""
    if not is_remote(folder):
        return Claims(folder, plan)
    if says_who_was_first(folder):
        return StoredClaims(folder, plan)
    notify(f"{folder} cannot say which of two processes was first: let one process at a time work there")
    return Unclaimed(folder)


def says_who_was_first(folder: Path) -> bool:
    """Whether of two who make one object the second is told so: not every store can, nor every package for one."""
    probe = folder / f"probe.{uuid.uuid4().hex}"
    try:
        return _made(probe, "first") and not _made(probe, "second")
    except (TypeError, NotImplementedError, OSError):
        return False
    finally:
        probe.unlink(missing_ok=True)


class StoredClaims(Claims):
    """The same in an object store: times are the store's, and workers store nothing themselves."""

    def __init__(self, folder: Path, plan: str) -> None:
        """Claim in ``folder``."""
        super().__init__(folder, plan)
        self.seen = folder / "none"

    def __enter__(self) -> Self:
        """Register this process."""
        self._touch()
        self._thread.start()
        return self

    def _create(self, path: Path) -> bool:
        return _made(path, self.own)

    def _touch(self) -> None:
        self.mark.write_text("", encoding="utf-8")

    def _leave(self) -> None:
        self._give_up()
        self.mark.with_suffix(LEFT).write_text("", encoding="utf-8")
        self.mark.unlink(missing_ok=True)

    def _clear(self) -> None:
        for path in list(self.folder.iterdir()):
            path.unlink(missing_ok=True)
        with suppress(OSError):  # most stores have no folders
            self.folder.rmdir()


class Unclaimed:
    """No claims: every process takes all.

    Attributes:
        seen: a file that is not there, so that workers store nothing themselves.
    """

    def __init__(self, folder: Path) -> None:
        """Stand for claims in ``folder``."""
        self.seen = folder / "none"

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


def _made(path: Path, content: str) -> bool:
    """Make an object; False where it was there."""
    remote: Any = path
    try:
        remote.fs.pipe_file(remote.path, content.encode(), mode="create")
    except FileExistsError:
        return False
    return True
