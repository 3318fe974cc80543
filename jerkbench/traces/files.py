"""Traces as Parquet files: those of this package by their name, a person's own by their path.

Each has its errors and sigmas, in ENU, and the correlations of the reported covariance; beside a file of this package
lies the licence of the data that it was derived from.
"""

import json
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError, unknown
from jerkbench.files import write_atomically
from jerkbench.traces.trace import About, Trace

SHIPPED = Path(__file__).parent / "shipped"
SUFFIX = ".parquet"
ERRORS = ("east_m", "north_m", "up_m")
SIGMAS = ("east_sigma_m", "north_sigma_m", "up_sigma_m")
CORRELATIONS = {"east_north": (0, 1), "east_up": (0, 2), "north_up": (1, 2)}
KEY = b"jerkbench_trace"
DECIMALS = 4
"""Of errors and sigmas: .1 mm."""


def shipped() -> list[str]:
    """Names of the traces of this package, sorted."""
    return sorted(path.stem for path in SHIPPED.glob(f"*{SUFFIX}"))


def trace_path(trace: str) -> Path:
    """Return the file of a trace: its name if it is one of this package, or a path that ends in .parquet.

    Raises:
        RecordingError: there is none.
    """
    if trace in shipped():
        return SHIPPED / f"{trace}{SUFFIX}"
    path = Path(trace).expanduser()
    if path.suffix != SUFFIX:
        raise RecordingError(
            unknown("trace", trace, shipped()) + " `jerkbench data trace` makes others: give the file."
        )
    if not path.is_file():
        raise RecordingError(f"There is no file {path}; correct 'trace', or make it with `jerkbench data trace`.")
    return path


def write_trace(trace: Trace, path: Path) -> None:
    """Write a trace; errors and sigmas to .1 mm, correlations to .001."""
    sigma = np.sqrt(np.diagonal(trace.covariance_m2, axis1=1, axis2=2))
    columns: dict[str, Any] = {"t_s": np.round(trace.t_s, 3)}
    columns |= {name: _short(trace.error_m[:, axis], DECIMALS) for axis, name in enumerate(ERRORS)}
    columns |= {name: _short(sigma[:, axis], DECIMALS) for axis, name in enumerate(SIGMAS)}
    for name, (i, j) in CORRELATIONS.items():
        columns[name] = _short(trace.covariance_m2[:, i, j] / (sigma[:, i] * sigma[:, j]), 3)
    table = pa.table(columns).replace_schema_metadata({KEY: json.dumps(asdict(trace.about)).encode()})
    write_atomically(path, lambda partial: pq.write_table(table, partial, compression="zstd", compression_level=19))


def read_trace(path: Path) -> Trace:
    """Read a trace.

    Raises:
        RecordingError: the file is none.
    """
    return _read(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=8)
def _read(path: Path, version: int) -> Trace:  # noqa: ARG001 - it says when to read it again
    try:
        table = pq.read_table(path)
        values = {name: np.asarray(table[name].to_numpy(), dtype=np.float64) for name in _columns()}
        about = json.loads((table.schema.metadata or {})[KEY])
        origin = About(**{**about, "offset_m": tuple(about["offset_m"])})
    except (OSError, ValueError, KeyError, TypeError, pa.ArrowException) as error:
        raise RecordingError(f"{path} is no trace: {error}; make it with `jerkbench data trace`.") from error
    return Trace(values["t_s"], np.column_stack([values[name] for name in ERRORS]), _covariances(values), origin)


def _columns() -> tuple[str, ...]:
    return ("t_s", *ERRORS, *SIGMAS, *CORRELATIONS)


def _short(values: FloatArray, decimals: int) -> Any:  # noqa: ANN401 - an array of pyarrow, which has no types
    return pa.array(np.round(values, decimals), pa.float32())


def _covariances(values: dict[str, FloatArray]) -> FloatArray:
    """Return (m, 3, 3); where rounding left none that is positive definite, the variances alone."""
    sigma = np.maximum(np.column_stack([values[name] for name in SIGMAS]), 10.0**-DECIMALS)
    correlation = np.tile(np.eye(3), (len(sigma), 1, 1))
    for name, (i, j) in CORRELATIONS.items():
        correlation[:, i, j] = correlation[:, j, i] = values[name]
    broken = np.linalg.eigvalsh(correlation)[:, 0] < 1e-3
    correlation[broken] = np.eye(3)
    return np.asarray(correlation * sigma[:, :, None] * sigma[:, None, :])
