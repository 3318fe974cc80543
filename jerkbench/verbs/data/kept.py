"""The kinds of files in the user's cache: one line a kind."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from jerkbench.files import cache_folder


@dataclass(frozen=True)
class CacheKind:
    """One kind of files.

    Attributes:
        title: its name for a person.
        folder: where they are; it may hold other files, which are not ours.
        patterns: which of the files are ours.
    """

    title: str
    folder: Path
    patterns: tuple[str, ...]

    def files(self) -> list[Path]:
        """Return the files that there are."""
        return [path for pattern in self.patterns for path in sorted(self.folder.glob(pattern)) if path.is_file()]


def cache_kinds() -> Iterator[CacheKind]:
    """Yield every kind. Recordings that were fetched are none: they are data, not a cache."""
    from jerkbench.compilation import module_cache
    from jerkbench.execution import simulation_cache
    from jerkbench.io.ros import extract

    yield CacheKind(
        "compiled filters and adaptations",
        cache_folder(module_cache.COMPILED),
        ("jerkbench_*", "__pycache__/jerkbench_*"),
    )
    yield CacheKind("messages of bags", cache_folder(extract.BAGS), (extract.PATTERN,))
    yield CacheKind("simulated recordings", cache_folder(simulation_cache.SIMULATED), (simulation_cache.PATTERN,))
