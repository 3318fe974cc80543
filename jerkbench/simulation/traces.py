"""Traces: recorded errors of the position fixes of a real receiver, and the covariances that it reported.

The columns of a trace file are the errors in ENU, and the standard deviations and correlations of the reported
covariances. The traces in this package are stored together with the licences of the data from which they were computed.
"""

import json
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench.arrays import BoolArray, FloatArray, linear_at, require, require_times
from jerkbench.errors import RecordingError, unknown
from jerkbench.files import write_atomically
from jerkbench.recording import Recording, freeze

_MIN_ROWS = 10
"""Minimum number of fixes of a trace. Distribution and correlation cannot be estimated from fewer fixes."""


@dataclass(frozen=True)
class About:
    """Metadata about the origin of a trace.

    Attributes:
        recording: name of the recording that contains the fixes.
        reference: name of the reference trajectory that was subtracted from the fixes.
        licence: licence of the data; an empty string if the licence is unknown.
        origin: web address of the data; an empty string if the address is unknown.
        offset_m: constant offset (east, north, up) that was subtracted from the errors: their median, or zeros [m].
    """

    recording: str
    reference: str
    licence: str = ""
    origin: str = ""
    offset_m: tuple[float, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Trace:
    """Errors of position fixes (fix minus reference) in ENU over time.

    A trace has gaps where the receiver had no fixes.

    Attributes:
        t_s: (m,) times of the fixes; the first time is 0 [s].
        error_m: (m, 3) errors of the fixes in east, north and up [m].
        covariance_m2: (m, 3, 3) covariance that the receiver reported for each fix [m2].
        about: metadata about the origin of the trace.
    """

    t_s: FloatArray
    error_m: FloatArray
    covariance_m2: FloatArray
    about: About = field(default_factory=lambda: About("unknown", "unknown"))

    def __post_init__(self) -> None:
        m = len(self.t_s)
        if m < _MIN_ROWS:
            raise RecordingError(f"A trace needs at least {_MIN_ROWS} fixes, but this one has {m}.")
        freeze(self, t_s=(m,), error_m=(m, 3), covariance_m2=(m, 3, 3))
        require_times(self, self.t_s)
        require(np.isfinite(self.error_m).all(axis=1), self, "error_m", "the error is not finite")
        smallest = np.linalg.eigvalsh(self.covariance_m2)[:, 0]
        require(smallest > 0, self, "covariance_m2", "the covariance is not positive definite")

    @property
    def interval_s(self) -> float:
        """The median interval between fixes [s]."""
        return float(np.median(np.diff(self.t_s)))

    @property
    def period_s(self) -> float:
        """The period with which the trace is repeated in a long drive: its duration plus one interval [s]."""
        return float(self.t_s[-1] - self.t_s[0]) + self.interval_s

    def local_moment_m2(self, window_s: float) -> FloatArray:
        """Return for each fix the mean of e e' (m, 3, 3) over all errors e in a window of ``window_s`` around it."""
        squares = self.error_m[:, :, None] * self.error_m[:, None, :]
        sums = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(squares, axis=0)])
        first = np.searchsorted(self.t_s, self.t_s - 0.5 * window_s - 1e-9)
        last = np.searchsorted(self.t_s, self.t_s + 0.5 * window_s + 1e-9)
        return np.asarray((sums[last] - sums[first]) / (last - first)[:, None, None])


# Trace files in the Parquet format. A name selects a trace of this package, and a path selects a file of the user.

SHIPPED = Path(__file__).parent / "shipped"
SUFFIX = ".parquet"
ERRORS = ("east_m", "north_m", "up_m")
_SIGMAS = ("east_sigma_m", "north_sigma_m", "up_sigma_m")
CORRELATIONS = {"east_north": (0, 1), "east_up": (0, 2), "north_up": (1, 2)}
_KEY = b"jerkbench_trace"
DECIMALS = 4
"""Number of decimals of stored errors and standard deviations: 0.1 mm."""


def shipped() -> list[str]:
    """Return the sorted names of the traces in this package."""
    return sorted(path.stem for path in SHIPPED.glob(f"*{SUFFIX}"))


def trace_path(trace: str) -> Path:
    """Return the path of a trace file.

    ``trace`` is the name of a trace in this package, or the path of a .parquet file.

    Raises:
        RecordingError: this package has no trace with this name, or the file does not exist.
    """
    if trace in shipped():
        return SHIPPED / f"{trace}{SUFFIX}"
    path = Path(trace).expanduser()
    if path.suffix != SUFFIX:
        others = "For a trace made with `jerkbench data trace`, give the path of its file."
        raise RecordingError(f"{unknown('trace', trace, shipped())} {others}")
    if not path.is_file():
        raise RecordingError(
            f"The file {path} does not exist; correct 'trace', or create the file with `jerkbench data trace`."
        )
    return path


def write_trace(trace: Trace, path: Path) -> None:
    """Write a trace to a file. Errors and standard deviations are rounded to 0.1 mm, and correlations to 0.001."""
    sigma = np.sqrt(np.diagonal(trace.covariance_m2, axis1=1, axis2=2))
    numbers = dict(zip((*ERRORS, *_SIGMAS), np.round(np.hstack([trace.error_m, sigma]), DECIMALS).T, strict=True))
    for name, (i, j) in CORRELATIONS.items():
        numbers[name] = np.round(trace.covariance_m2[:, i, j] / (sigma[:, i] * sigma[:, j]), 3)
    columns: dict[str, Any] = {"t_s": np.round(trace.t_s, 3)}
    columns |= {name: pa.array(values, pa.float32()) for name, values in numbers.items()}
    table = pa.table(columns).replace_schema_metadata({_KEY: json.dumps(asdict(trace.about)).encode()})
    write_atomically(path, lambda partial: pq.write_table(table, partial, compression="zstd", compression_level=19))


def read_trace(path: Path) -> Trace:
    """Read a trace from a file.

    Raises:
        RecordingError: the file does not contain a valid trace.
    """
    return _read(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=8)
def _read(path: Path, version: int) -> Trace:  # noqa: ARG001 - part of the key of the cache
    try:
        table = pq.read_table(path)
        names = ("t_s", *ERRORS, *_SIGMAS, *CORRELATIONS)
        values = {name: np.asarray(table[name].to_numpy(), dtype=np.float64) for name in names}
        about = json.loads((table.schema.metadata or {})[_KEY])
        origin = About(**{**about, "offset_m": tuple(about["offset_m"])})
    except (OSError, ValueError, KeyError, TypeError, pa.ArrowException) as error:
        raise RecordingError(f"{path} is not a trace ({error}); create a trace with `jerkbench data trace`.") from error
    return Trace(values["t_s"], np.column_stack([values[name] for name in ERRORS]), _covariances(values), origin)


def _covariances(values: dict[str, FloatArray]) -> FloatArray:
    """Return the covariances (m, 3, 3) from stored standard deviations and correlations.

    If rounding made the correlation matrix of a row indefinite, the correlations of this row are ignored.
    """
    sigma = np.maximum(np.column_stack([values[name] for name in _SIGMAS]), 10.0**-DECIMALS)
    correlation = np.tile(np.eye(3), (len(sigma), 1, 1))
    for name, (i, j) in CORRELATIONS.items():
        correlation[:, i, j] = correlation[:, j, i] = values[name]
    correlation[np.linalg.eigvalsh(correlation)[:, 0] < 1e-3] = np.eye(3)
    return np.asarray(correlation * sigma[:, :, None] * sigma[:, None, :])


# Summary of a trace as text.

LAGS_S = (1.0, 10.0)
_GAP = 1.5
"""An interval of more than this multiple of the median interval is a gap."""


def trace_text(trace: Trace) -> str:
    """Return text with the number, the rate, the gaps, the size and the autocorrelation of the errors in a trace."""
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
    """Return the autocorrelation (3,) of the errors at the lag ``lag_s`` [s], from all pairs of fixes with this lag."""
    error = trace.error_m - trace.error_m.mean(axis=0)
    later = np.searchsorted(trace.t_s, trace.t_s + lag_s - 0.25 * trace.interval_s)
    paired = later < len(trace.t_s)
    paired[paired] &= np.abs(trace.t_s[later[paired]] - trace.t_s[paired] - lag_s) < 0.5 * trace.interval_s
    products = error[paired] * error[later[paired]]
    variance = np.mean(error**2, axis=0)
    moving = (variance > 0) & paired.any()  # the vertical errors of a horizontal trace are 0
    return np.where(moving, products.sum(axis=0) / max(paired.sum(), 1) / np.where(moving, variance, 1.0), np.nan)


# Computation of a trace from the fixes and the reference of a recording.

_NEAR_S = 1.5
"""Maximum interval between stamps of the reference for a linear interpolation [s]."""


def trace_of(recording: Recording, *, centred: bool = True, licence: str = "", origin: str = "") -> Trace:
    """Compute a trace: the errors of the fixes of a recording relative to its reference, and the reported covariances.

    Args:
        recording: recording with position fixes and with a reference that is not a copy of the fixes.
        centred: whether the median error is subtracted, because differences of the datum and the lever arm cause a
            constant offset.
        licence: licence of the data.
        origin: web address of the data.

    Raises:
        RecordingError: the recording has no fixes, the reference is a copy of the fixes, or the reference covers too
            few fixes.
    """
    position, reference = recording.position, recording.reference
    if position is None or reference.enu_m is None:
        raise RecordingError(f"{recording.name} has no position fixes or no reference positions; a trace needs both.")
    certain = reference.scored & np.isfinite(reference.enu_m).all(axis=1)
    true, known = _at(reference.t_s[certain], reference.enu_m[certain], position.t_s)
    usable = known & np.isfinite(position.enu_m).all(axis=1)
    if usable.sum() < _MIN_ROWS:
        raise RecordingError(f"{recording.name} has {usable.sum()} fixes with a reference; {_MIN_ROWS} are needed.")
    error = (position.enu_m - true)[usable]
    if not error.any():
        raise RecordingError(f"The reference of {recording.name} is a copy of its fixes; give another reference.")
    offset = np.median(error, axis=0) if centred else np.zeros(3)
    about = About(recording.name, reference.source, licence, origin, tuple(offset.tolist()))
    t_s = position.t_s[usable]
    return Trace(t_s - t_s[0], error - offset, position.covariance_m2[usable], about)


def _at(true_s: FloatArray, true_m: FloatArray, t_s: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the reference positions (m, 3) at the times ``t_s``, and a mask (m,) of times with a known position."""
    if len(true_s) < 2:
        return np.full((len(t_s), 3), np.nan), np.zeros(len(t_s), dtype=np.bool_)
    near = np.isfinite(linear_at(true_s, true_m, t_s, _NEAR_S)).all(axis=1)
    exact = np.isin(np.round(t_s, 6), np.round(true_s, 6))
    true = np.column_stack([np.interp(t_s, true_s, axis) for axis in true_m.T])
    return true, near | exact
