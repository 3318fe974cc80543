"""A trace: the errors of a real receiver's fixes, with the covariances that it reported.

Each has its errors and sigmas, in ENU, and the correlations of the reported covariance; beside a file of this package
lies the licence of the data that it was derived from.
"""

import json
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench.arrays import BoolArray, FloatArray, frozen, linear_at, require, require_times
from jerkbench.errors import RecordingError, unknown
from jerkbench.files import write_atomically
from jerkbench.recording import Recording, Reference

_MIN_ROWS = 10
"""A shorter trace has neither a distribution nor a correlation."""


@dataclass(frozen=True)
class About:
    """Where a trace comes from.

    Attributes:
        recording: the fixes.
        reference: what they were compared with.
        licence: of the data that it was derived from; empty: not stated.
        origin: where those data are; empty: not stated.
        offset_m: constant (east, north, up) that was taken off the errors: their median, or zeros.
    """

    recording: str
    reference: str
    licence: str = ""
    origin: str = ""
    offset_m: tuple[float, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Trace:
    """Fixes less reference, in ENU; what is missing in time was a gap.

    Attributes:
        t_s: (m,) times, from 0 on.
        error_m: (m, 3) east, north, up.
        covariance_m2: (m, 3, 3) as the receiver reported it.
        about: where it comes from.
    """

    t_s: FloatArray
    error_m: FloatArray
    covariance_m2: FloatArray
    about: About = field(default_factory=lambda: About("unknown", "unknown"))

    def __post_init__(self) -> None:
        """Check shapes, times, errors and covariances."""
        m = len(self.t_s)
        if m < _MIN_ROWS:
            raise RecordingError(f"A trace of {m} fixes says too little; it needs {_MIN_ROWS}.")
        for name, shape in {"t_s": (m,), "error_m": (m, 3), "covariance_m2": (m, 3, 3)}.items():
            object.__setattr__(self, name, frozen(self, name, getattr(self, name), shape))
        require_times(self, self.t_s)
        require(np.isfinite(self.error_m).all(axis=1), self, "error_m", "the error is no number")
        smallest = np.linalg.eigvalsh(self.covariance_m2)[:, 0]
        require(smallest > 0, self, "covariance_m2", "the covariance is not positive definite")

    @property
    def interval_s(self) -> float:
        """The usual interval between fixes (median)."""
        return float(np.median(np.diff(self.t_s)))

    @property
    def period_s(self) -> float:
        """After so long it begins anew: its length and one interval."""
        return float(self.t_s[-1] - self.t_s[0]) + self.interval_s

    def local_moment_m2(self, window_s: float) -> FloatArray:
        """Return (m, 3, 3) the mean of e e' over the fixes within half a window of each, itself included."""
        squares = self.error_m[:, :, None] * self.error_m[:, None, :]
        sums = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(squares, axis=0)])
        first = np.searchsorted(self.t_s, self.t_s - 0.5 * window_s - 1e-9)
        last = np.searchsorted(self.t_s, self.t_s + 0.5 * window_s + 1e-9)
        return np.asarray((sums[last] - sums[first]) / (last - first)[:, None, None])


# Traces as Parquet files: those of this package by their name, a person's own by their path.

SHIPPED = Path(__file__).parent / "shipped"
SUFFIX = ".parquet"
ERRORS = ("east_m", "north_m", "up_m")
_SIGMAS = ("east_sigma_m", "north_sigma_m", "up_sigma_m")
CORRELATIONS = {"east_north": (0, 1), "east_up": (0, 2), "north_up": (1, 2)}
_KEY = b"jerkbench_trace"
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
        others = "`jerkbench data trace` makes others: give the file."
        raise RecordingError(f"{unknown('trace', trace, shipped())} {others}")
    if not path.is_file():
        raise RecordingError(f"There is no file {path}; correct 'trace', or make it with `jerkbench data trace`.")
    return path


def write_trace(trace: Trace, path: Path) -> None:
    """Write a trace; errors and sigmas to .1 mm, correlations to .001."""
    sigma = np.sqrt(np.diagonal(trace.covariance_m2, axis1=1, axis2=2))
    numbers = dict(zip((*ERRORS, *_SIGMAS), np.round(np.hstack([trace.error_m, sigma]), DECIMALS).T, strict=True))
    for name, (i, j) in CORRELATIONS.items():
        numbers[name] = np.round(trace.covariance_m2[:, i, j] / (sigma[:, i] * sigma[:, j]), 3)
    columns: dict[str, Any] = {"t_s": np.round(trace.t_s, 3)}
    columns |= {name: pa.array(values, pa.float32()) for name, values in numbers.items()}
    table = pa.table(columns).replace_schema_metadata({_KEY: json.dumps(asdict(trace.about)).encode()})
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
        names = ("t_s", *ERRORS, *_SIGMAS, *CORRELATIONS)
        values = {name: np.asarray(table[name].to_numpy(), dtype=np.float64) for name in names}
        about = json.loads((table.schema.metadata or {})[_KEY])
        origin = About(**{**about, "offset_m": tuple(about["offset_m"])})
    except (OSError, ValueError, KeyError, TypeError, pa.ArrowException) as error:
        raise RecordingError(f"{path} is no trace: {error}; make it with `jerkbench data trace`.") from error
    return Trace(values["t_s"], np.column_stack([values[name] for name in ERRORS]), _covariances(values), origin)


def _covariances(values: dict[str, FloatArray]) -> FloatArray:
    """Return (m, 3, 3); where rounding left none that is positive definite, the variances alone."""
    sigma = np.maximum(np.column_stack([values[name] for name in _SIGMAS]), 10.0**-DECIMALS)
    correlation = np.tile(np.eye(3), (len(sigma), 1, 1))
    for name, (i, j) in CORRELATIONS.items():
        correlation[:, i, j] = correlation[:, j, i] = values[name]
    correlation[np.linalg.eigvalsh(correlation)[:, 0] < 1e-3] = np.eye(3)
    return np.asarray(correlation * sigma[:, :, None] * sigma[:, None, :])


# A trace in a few words.

LAGS_S = (1.0, 10.0)
_GAP = 1.5
"""A step of more than so many usual intervals is a gap."""


def trace_text(trace: Trace) -> str:
    """Return rows, rate, gaps, size and correlation of the errors."""
    gaps = (steps := np.diff(trace.t_s))[steps > _GAP * trace.interval_s]
    level = np.hypot(trace.error_m[:, 0], trace.error_m[:, 1])
    nees = np.einsum("mi,mij,mj->m", trace.error_m, np.linalg.inv(trace.covariance_m2), trace.error_m)
    correlation = ", ".join(f"{value:.2f}" for value in (lagged_correlation(trace, lag)[:2].mean() for lag in LAGS_S))
    return (
        f"errors of {len(trace.t_s)} fixes of {trace.about.recording} against {trace.about.reference}\n"
        f"{1 / trace.interval_s:.3g} Hz over {trace.period_s:.0f} s; {len(gaps)} gaps, the longest"
        f" {gaps.max(initial=0.0):.1f} s\n"
        f"horizontal error rms {np.sqrt(np.mean(level**2)):.3g} m, 95 % {np.quantile(level, 0.95):.3g} m, largest"
        f" {level.max():.3g} m; median taken off: {', '.join(f'{x:.3f}' for x in trace.about.offset_m)} m\n"
        f"NEES (3 expected): median {np.median(nees):.3g}, mean {nees.mean():.3g}; horizontal autocorrelation at 1 s"
        f" and 10 s: {correlation}"
    )


def lagged_correlation(trace: Trace, lag_s: float) -> FloatArray:
    """Return (3,) of the errors about their mean, over all pairs of fixes that are ``lag_s`` apart."""
    error = trace.error_m - trace.error_m.mean(axis=0)
    later = np.searchsorted(trace.t_s, trace.t_s + lag_s - 0.25 * trace.interval_s)
    paired = later < len(trace.t_s)
    paired[paired] &= np.abs(trace.t_s[later[paired]] - trace.t_s[paired] - lag_s) < 0.5 * trace.interval_s
    products = error[paired] * error[later[paired]]
    variance = np.mean(error**2, axis=0)
    moving = (variance > 0) & paired.any()  # a trace of the plane has no errors of up
    return np.where(moving, products.sum(axis=0) / max(paired.sum(), 1) / np.where(moving, variance, 1.0), np.nan)


# The trace of a recording's fixes, from a better reference.

_NEAR_S = 1.5
"""The reference is taken linearly between its stamps, where these are no further apart."""


def trace_of(recording: Recording, *, centred: bool = True, licence: str = "", origin: str = "") -> Trace:
    """Return the errors of the fixes against the reference, with the covariances as reported.

    Args:
        recording: with position fixes, and a reference that has positions of its own.
        centred: take the median off: a constant offset is a matter of datum and lever arm, which no fix shows.
        licence: of the data.
        origin: where the data are.

    Raises:
        RecordingError: it has no fixes, no reference but the fixes themselves, or too few that both have.
    """
    position, reference = recording.position, recording.reference
    if position is None or reference.enu_m is None:
        raise RecordingError(f"{recording.name} lacks position fixes or a reference of positions: no errors to trace.")
    true, known = _at(reference, position.t_s)
    kept = known & np.isfinite(position.enu_m).all(axis=1)
    if kept.sum() < _MIN_ROWS:
        few = f"{kept.sum()} fixes where its reference is known; {_MIN_ROWS} are needed."
        raise RecordingError(f"{recording.name} has {few}")
    error = (position.enu_m - true)[kept]
    if not error.any():
        own = "is its own fixes, which have no errors against themselves."
        raise RecordingError(f"The reference of {recording.name} {own}")
    offset = np.median(error, axis=0) if centred else np.zeros(3)
    about = About(recording.name, reference.source, licence, origin, tuple(offset.tolist()))
    t_s = position.t_s[kept]
    return Trace(t_s - t_s[0], error - offset, position.covariance_m2[kept], about)


def _at(reference: Reference, t_s: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the reference (m, 3) at ``t_s``, and where it is known."""
    values = reference.enu_m
    usable = reference.scored & np.isfinite(values).all(axis=1) if values is not None else np.zeros(0, dtype=np.bool_)
    if values is None or usable.sum() < 2:
        return np.full((len(t_s), 3), np.nan), np.zeros(len(t_s), dtype=np.bool_)
    own_s, own_m = reference.t_s[usable], values[usable]
    near = np.isfinite(linear_at(own_s, own_m, t_s, _NEAR_S)).all(axis=1)
    exact = np.isin(np.round(t_s, 6), np.round(own_s, 6))
    true = np.column_stack([np.interp(t_s, own_s, axis) for axis in own_m.T])
    return true, near | exact
