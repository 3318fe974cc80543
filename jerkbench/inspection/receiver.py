"""Comparison of the declared covariance of a receiver with the scatter and the errors of its fixes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.inspection.evidence import mostly_gaps
from jerkbench.inspection.noise import FAST_SHARE, MAX_FIX_GAP_S, second_difference, truth_at
from jerkbench.recording import Recording

_AXES = ("east", "north", "up")
LEVELS_M = (0.0, 0.05, 0.5, 5.0, np.inf)
"""Limits of the declared sigma [m]. The limits distinguish the states of the receiver (fixed, float, single point, no
solution), which a recording does not contain."""

_MIN_FIXES = 30
SIGMA_OF_MEDIAN = 1.4826
"""Ratio of the standard deviation of a normal distribution to the median of its absolute values."""

GROSS = 5.0
"""Minimum distance of a gross error from the median, in robust sigmas (one of two million normal errors)."""

MAX_LAG_FRACTION = 0.25
"""Maximum lag as a fraction of the compared time."""


class AxisErrors(NamedTuple):
    """Error statistics of one axis, for the fixes whose declared sigma is in the same range.

    Attributes:
        level: range of the declared sigma, as text.
        axis: name of the axis: east, north or up.
        fixes: number of fixes in this range.
        declared_m: root of the median of the declared variances [m].
        scatter_m: robust sigma of the white noise [m], computed from x_i - (x_i-1 + x_i+1)/2. Bends of the track
            increase this value, but slow errors do not.
        error_m: robust sigma of the error about its median [m]; NaN without a reference.
        bias_m: median of the error [m]; NaN without a reference.
        gross_percent: percentage of gross errors, whose distance from the median, divided by the declared sigma,
            exceeds `GROSS` times ``factor`` [%].
        factor: robust sigma of the normalised errors (errors divided by their declared sigmas). Without a reference,
            the factor is computed from the scatter, which gives a lower bound.
    """

    level: str
    axis: str
    fixes: int
    declared_m: float
    scatter_m: float
    error_m: float
    bias_m: float
    gross_percent: float
    factor: float


@dataclass(frozen=True, eq=False)
class ReceiverErrors:
    """Errors of the fixes of a recording, compared with the declared covariances.

    Attributes:
        source: source of the reference; an empty string without a reference.
        step_s: median interval between fixes [s].
        axes: statistics of the three axes over all fixes, then of the three axes for each range of the declared sigma.
        lags_s: (k,) lags of the autocorrelation [s].
        correlation: (k, 3) autocorrelation of the error of each axis; empty without a reference, or if the stamps of
            the fixes have too many gaps.
    """

    source: str
    step_s: float
    axes: tuple[AxisErrors, ...]
    lags_s: FloatArray
    correlation: FloatArray

    @property
    def overall(self) -> tuple[AxisErrors, ...]:
        """The statistics of the three axes over all fixes."""
        return self.axes[:3]

    @property
    def memory_s(self) -> FloatArray:
        """The lags (3,) at which the autocorrelations of the errors fall below 1/e, or NaN without such a lag [s]."""
        below, times = self.correlation < np.exp(-1.0), np.full(3, np.nan)
        for axis in np.flatnonzero(below.any(axis=0)):
            k = int(np.argmax(below[:, axis]))
            above, under = self.correlation[k - 1 : k + 1, axis]
            part = (above - np.exp(-1.0)) / (above - under)
            times[axis] = self.lags_s[k - 1] + part * (self.lags_s[k] - self.lags_s[k - 1])
        return times


def receiver_errors(recording: Recording) -> ReceiverErrors | None:
    """Return the error statistics of the fixes, or None if the recording has fewer than `_MIN_FIXES` fixes.

    The reference is interpolated linearly between stamps with an interval of at most 1.1 s. A reference that is a copy
    of the fixes is not used.
    """
    position = recording.position
    if position is None or np.isfinite(position.enu_m).all(axis=1).sum() < _MIN_FIXES:
        return None
    t_s, enu_m = position.t_s, position.enu_m
    sigma_m = np.sqrt(np.diagonal(position.covariance_m2, axis1=1, axis2=2))
    error_m = enu_m - truth_at(recording, "position", t_s, MAX_FIX_GAP_S)
    compared = np.asarray(np.isfinite(error_m).any(axis=1), dtype=np.bool_)
    if compared.sum() < _MIN_FIXES or not np.nan_to_num(error_m).any():
        error_m, compared = np.full_like(enu_m, np.nan), np.zeros(len(t_s), dtype=np.bool_)
    second_m = np.full_like(enu_m, np.nan)
    second_m[1:-1] = second_difference(enu_m)
    declared_m = np.sqrt((sigma_m[:, :2] ** 2).mean(axis=1))
    groups = [("all", np.ones(len(t_s), dtype=np.bool_))]
    for low, high in pairwise(LEVELS_M):
        rows = (declared_m >= low) & (declared_m < high)
        name = f"below {high:g} m" if np.isfinite(high) else f"{low:g} m or more"
        groups += [(name, rows)] if _MIN_FIXES <= rows.sum() < len(t_s) else []
    columns = list(enumerate(zip(sigma_m.T, second_m.T, error_m.T, strict=True)))
    axes = tuple(_axis(level, k, *(one[rows] for one in three)) for level, rows in groups for k, three in columns)
    centred_m = error_m - (np.nanmedian(error_m[compared], axis=0) if compared.any() else 0.0)
    step_s = float(np.median(np.diff(t_s)))
    lags_s, correlation = _autocorrelation(t_s, centred_m, step_s, compared)
    source = recording.reference.source if compared.any() else ""
    return ReceiverErrors(source, step_s, axes, lags_s, correlation)


def _axis(level: str, axis: int, sigma_m: FloatArray, second_m: FloatArray, error_m: FloatArray) -> AxisErrors:
    known, inner = np.isfinite(error_m), np.isfinite(second_m)
    scatter_m = _middle(second_m[inner]) / np.sqrt(FAST_SHARE)
    bias_m = error_size_m = gross = np.nan
    factor = _middle(second_m[inner] / sigma_m[inner]) / np.sqrt(FAST_SHARE)
    if np.nan_to_num(error_m).any():
        bias_m = float(np.median(error_m[known]))
        centred_m = error_m[known] - bias_m
        error_size_m, factor = _middle(centred_m), _middle(centred_m / sigma_m[known])
        gross = 100 * float(np.mean(np.abs(centred_m / sigma_m[known]) > GROSS * factor))
    sizes = float(np.median(sigma_m)), scatter_m, error_size_m, bias_m, gross, float(factor)
    return AxisErrors(level, _AXES[axis], len(sigma_m), *sizes)


def _middle(values: FloatArray) -> float:
    """Return a robust standard deviation of ``values``, computed from the median of their absolute values."""
    return SIGMA_OF_MEDIAN * float(np.median(np.abs(values))) if len(values) else float("nan")


def _autocorrelation(
    t_s: FloatArray, error_m: FloatArray, step_s: float, compared: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return lags (k,) and autocorrelations (k, 3) of the errors on a regular time grid, with clipped gross errors."""
    if not compared.any() or mostly_gaps(step_s, t_s):
        return np.empty(0), np.empty((0, 3))
    index = np.round((t_s - t_s[0]) / step_s).astype(int)
    grid = np.full((index[-1] + 1, 3), np.nan)
    limit_m = GROSS * np.array([_middle(error[np.isfinite(error)]) for error in error_m.T])
    grid[index] = np.clip(error_m, -limit_m, limit_m)
    both = np.hstack([np.nan_to_num(grid), np.isfinite(grid)])
    size = 1 << int(np.ceil(np.log2(2 * len(grid))))  # Wiener-Khinchin theorem; gaps count in neither sum
    power, pairs = np.hsplit(np.fft.irfft(np.abs(np.fft.rfft(both, size, axis=0)) ** 2, axis=0), 2)
    most = max(2, int(MAX_LAG_FRACTION * len(grid)))
    mean = power[:most] / np.maximum(np.round(pairs[:most]), 1)
    return step_s * np.arange(most, dtype=np.float64), mean / np.where(mean[0] > 0, mean[0], np.nan)


# Report with a table and with advice for the parameters of a filter.


def table_rows(errors: ReceiverErrors) -> Iterator[list[str]]:
    """Yield the rows of the table as texts. The names of the columns are in `HEADER`."""
    for e in errors.axes:
        memory = dict(zip(_AXES, errors.memory_s, strict=True))[e.axis] if e.level == "all" else np.nan
        numbers = (e.declared_m, e.scatter_m, e.error_m, e.bias_m, e.factor, memory, e.gross_percent)
        texts = ["" if np.isnan(number) else f"{number:.3g}" for number in numbers]
        texts[5] = "none" if memory <= errors.step_s else texts[5]
        yield [e.level, e.axis, str(e.fixes), *texts]


HEADER = (
    *("declared sigma", "axis", "fixes", "declared [m]", "scatter [m]", "error [m]", "bias [m]", "factor"),
    *("memory [s]", "gross [%]"),
)


def advice(errors: ReceiverErrors) -> Iterator[str]:
    """Yield advice for the parameters of a filter: factors on the sigmas, and the time constant of the errors."""
    horizontal, up = horizontal_and_up(errors.overall)
    if not errors.source:
        yield "No reference: the factor is computed from the scatter between fixes and does not include slow errors."
        if horizontal < 1:
            yield "The declared sigmas are not too small. Only with a reference can they be tested for being too large."
            return
    yield f"Multiply the declared sigmas by {horizontal:.3g} (east, north) and {up:.3g} (up)."
    yield (
        f"robot_localization, fusioncore: multiply the covariance in the message by {horizontal**2:.3g} and"
        f" {up**2:.3g}. KF-GINS: the same factors on the standard deviations in the file of the fixes. Here:"
        f" r_scale.position={horizontal**2:.3g}."
    )
    memory_s = np.nanmax(errors.memory_s[:2]) if np.isfinite(errors.memory_s[:2]).any() else np.nan
    if np.isfinite(memory_s) and memory_s > errors.step_s:
        share = np.exp(-errors.step_s / memory_s)
        more = (1 + share) / (1 - share)
        yield (
            f"The correlation time of the errors is {memory_s:.3g} s; the interval of the fixes is"
            f" {errors.step_s:.3g} s. In a filter that assumes independent errors, multiply the covariance by another"
            f" {more:.3g} (total {more * horizontal**2:.3g}), or model the errors as a Gauss-Markov state with"
            f" {memory_s:.3g} s."
        )


def horizontal_and_up(axes: Sequence[AxisErrors]) -> tuple[float, float]:
    """Return the root mean square of the factors of east and north, and the factor of up.

    If the factor of up is 0, the horizontal factor is returned for up as well.
    """
    east, north, up = (axis.factor for axis in axes)
    horizontal = float(np.sqrt(0.5 * (east**2 + north**2)))
    return horizontal, up or horizontal  # a factor of 0 means that the height is constant and was not measured
