"""Files of which each seed has one: a pattern with ``{seed}`` in the place of the number."""

import glob
import hashlib
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from jerkbench.errors import RecordingError

SEED = "{seed}"


def path_of_seed(pattern: str, seed: int) -> Path:
    """Return the file of one seed."""
    return Path(pattern.replace(SEED, str(seed))).expanduser()


def seeds_of(pattern: str) -> dict[int, Path]:
    """Return the files that there are by their seeds, in order; without ``{seed}`` there are none to tell apart."""
    pattern = str(Path(pattern).expanduser())
    first, *others = map(re.escape, pattern.split(SEED))
    expression = re.compile(first + r"(\d+)" + r"\1".join(others) if others else "(?!)")
    matches = (expression.fullmatch(path) for path in glob.glob(glob.escape(pattern).replace(SEED, "*")))  # noqa: PTH207 - the folder may have a seed too
    return dict(sorted((int(match[1]), Path(match[0])) for match in matches if match))


def files_digest(pattern: str) -> str:
    """Return the SHA-256 over the files of all seeds, and their seeds.

    Raises:
        RecordingError: there is no file.
    """
    paths = seeds_of(pattern) if SEED in pattern else {0: Path(pattern).expanduser()}
    sha = hashlib.sha256()
    for seed, path in paths.items():
        if not path.is_file():
            paths = {}
            break
        sha.update(f"{seed} {len(content := path.read_bytes())} ".encode() + content)
    if not paths:
        raise RecordingError(f"There is no trajectory {pattern}; correct its name.")
    return sha.hexdigest()


def pattern_of(names: Sequence[str]) -> str:
    """Return the pattern of files that one number tells apart: ``run_0.tum``, ``run_1.tum`` -> ``run_{seed}.tum``.

    Raises:
        RecordingError: something else tells them apart, or the pattern would mean other files.
    """
    if len(set(names)) == 1:
        return names[0]
    parts = [re.split(r"(\d+)", name) for name in names]
    if len({len(split) for split in parts}) == 1:
        places = [k for k, column in enumerate(zip(*parts, strict=True)) if len(set(column)) > 1]
        pattern = "".join(SEED if k in places else part for k, part in enumerate(parts[0]))
        if pattern.count(SEED) == 1 and {str(p) for p in _of_numbers(pattern, parts, places)} == set(names):
            return pattern
    raise RecordingError(
        f"{', '.join(names[:3])}{', ...' if len(names) > 3 else ''}: files of several seeds must differ in one number,"
        " the seed; or give a pattern with {seed} in its place."
    )


def _of_numbers(pattern: str, parts: Iterable[Sequence[str]], places: Sequence[int]) -> list[str]:
    """The names that the pattern has for those numbers: leading zeros would be lost."""
    return [pattern.replace(SEED, str(int(split[places[0]]))) for split in parts if split[places[0]].isdigit()]
