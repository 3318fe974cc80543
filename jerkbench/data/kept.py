"""Everything that is kept in the user's cache: one line a kind."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from jerkbench.files import cache_folder


@dataclass(frozen=True)
class Kept:
    """One kind of files.

    Attributes:
        what: in words.
        folder: where they are; it may hold other files, which are not ours.
        patterns: which of the files are ours.
    """

    what: str
    folder: Path
    patterns: tuple[str, ...]

    def files(self) -> list[Path]:
        """Return the files that there are."""
        return [path for pattern in self.patterns for path in sorted(self.folder.glob(pattern)) if path.is_file()]


def kept() -> Iterator[Kept]:
    """Yield every kind. Recordings that were fetched are none: they are data, not a cache."""
    from jerkbench.bags import extract
    from jerkbench.compilation import module_cache as entry
    from jerkbench.execution import simulation_cache as simulated

    yield Kept(
        "compiled filters and adaptations", cache_folder(entry.COMPILED), ("jerkbench_*", "__pycache__/jerkbench_*")
    )
    yield Kept("what was read of bags", cache_folder(extract.BAGS), (extract.PATTERN,))
    yield Kept("simulated recordings", cache_folder(simulated.SIMULATED), (simulated.PATTERN,))
