"""Simulated recordings, kept in the user's cache: another sweep over the same seeds need not simulate them again."""

import dataclasses
import hashlib
import json
import os
import zlib
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from jerkbench.cells.provenance import code_digest, plugin_digest, versions
from jerkbench.contracts import Dataset
from jerkbench.files import cache_folder, forget_oldest, write_atomically
from jerkbench.recording import Drawn, Heading, Imu, Origin, Position, Recording, Reference, Velocity

PARTS = {
    "imu": Imu,
    "reference": Reference,
    "position": Position,
    "velocity": Velocity,
    "heading": Heading,
    "origin": Origin,
}
LAW = "drawn"
"""The law of the errors: numbers, besides three of the parts."""

SIMULATED = "simulated"
"""The kind of cache that holds simulated recordings."""

PATTERN = "simulated_*"
MOST_BYTES = 2_000_000_000
"""About 700 drives of 150 s; then the longest unused go."""

DAMAGE = (OSError, ValueError, KeyError, TypeError)


def simulated(dataset: Dataset, seed: int) -> Recording:
    """Return the recording of ``seed``: the one that is kept, or a new one, which then is."""
    path = cache_folder(SIMULATED) / f"simulated_{_key(dataset, seed)}.arrays"
    kept = _read(path)
    if kept is not None:
        return kept
    recording = dataset.load(seed)
    with suppress(OSError):  # no room, or no right to write: then it is simulated again the next time
        _write(recording, path)
        if seed % 16 == 0:
            forget_oldest(path.parent, PATTERN, MOST_BYTES)
    return recording


def _key(dataset: Dataset, seed: int) -> str:
    """Name everything that decides on the recording: the data set, the code, the libraries, the seed."""
    parts = [repr(dataset), type(dataset).__qualname__, code_digest(), plugin_digest(type(dataset)), versions(), seed]
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]


def _write(recording: Recording, path: Path) -> None:
    arrays: dict[str, Any] = {}
    header: dict[str, Any] = {}
    for part in ("", LAW, *PARTS):
        owner = getattr(recording, part) if part else recording
        for field in dataclasses.fields(owner) if owner is not None else ():
            value = getattr(owner, field.name)
            if isinstance(value, np.ndarray):
                arrays[f"{part}.{field.name}"] = value
            elif field.name not in (*PARTS, LAW):
                header[f"{part}.{field.name}"] = value.isoformat() if isinstance(value, datetime) else value
    write_atomically(path, lambda partial: write_arrays(partial, arrays, header))


def _read(path: Path) -> Recording | None:
    """The recording at ``path``, or None where there is none that is whole."""
    try:
        arrays, header = read_arrays(path)
        values = arrays | header
        parts: dict[str, Any] = {name: PARTS[name](**own) for name in PARTS if (own := _of(name, values))}
        law = _of(LAW, values)
        drawn = Drawn(parts["imu"], parts["position"], parts["velocity"], **law) if law else None
        own = _of("", values)
        start = own.pop("start_utc")
        own |= {"start_utc": None if start is None else datetime.fromisoformat(start), "notes": tuple(own["notes"])}
        with suppress(OSError):
            os.utime(path)  # used just now: others go first
        return Recording(**own, **parts, drawn=drawn)
    except DAMAGE:
        return None


def _of(part: str, values: dict[str, Any]) -> dict[str, Any]:
    """The fields of one part, by name."""
    return {name.partition(".")[2]: value for name, value in values.items() if name.partition(".")[0] == part}


MAGIC = b"jerkbench arrays 1\n"
ALIGNED = 64
"""Arrays begin at multiples of so many bytes."""


def write_arrays(path: Path, arrays: dict[str, Any], header: dict[str, Any]) -> None:
    """Write ``arrays`` and what JSON can say of the rest."""
    plain = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    listed = [(name, array.dtype.str, array.shape) for name, array in plain.items()]
    described = json.dumps({"header": header, "arrays": listed}).encode()
    content = bytearray(_padded(described))
    for array in plain.values():
        content += _padded(array.tobytes())
    sizes = np.array([len(described), zlib.crc32(content)], dtype="<u8").tobytes()
    path.write_bytes(_padded(MAGIC + sizes) + content)


def read_arrays(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return arrays and header.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not what `write_arrays` has written.
    """
    content = np.fromfile(path, dtype=np.uint8)
    if content[: len(MAGIC)].tobytes() != MAGIC or len(content) < ALIGNED:
        raise ValueError(f"{path} holds no arrays.")
    length, checksum = np.frombuffer(content[len(MAGIC) : len(MAGIC) + 16].tobytes(), dtype="<u8").tolist()
    if zlib.crc32(content[ALIGNED:]) != checksum:  # type: ignore[arg-type]  # an array is a buffer
        raise ValueError(f"{path} is damaged.")
    described = json.loads(content[ALIGNED : ALIGNED + length].tobytes())
    arrays, at = {}, ALIGNED + _rounded(length)
    for name, dtype, shape in described["arrays"]:
        size = np.dtype(dtype).itemsize * int(np.prod(shape))
        arrays[name] = content[at : at + size].view(dtype).reshape(shape)
        at += _rounded(size)
    return arrays, described["header"]


def _padded(content: bytes) -> bytes:
    return content + bytes(_rounded(len(content)) - len(content))


def _rounded(size: int) -> int:
    """The next multiple of ALIGNED."""
    return -(-size // ALIGNED) * ALIGNED
