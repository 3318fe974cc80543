"""Array types, and checks of arrays and parameters."""

import dataclasses
import math
from collections.abc import Collection, Hashable, Iterable, Mapping
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from jerkbench.errors import PluginError, RecordingError, require_known

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

FloatVector = Annotated[FloatArray, 1]
FloatMatrix = Annotated[FloatArray, 2]
FloatCube = Annotated[FloatArray, 3]
FloatStack = Annotated[FloatArray, 4]
IntVector = Annotated[IntArray, 1]
BoolVector = Annotated[BoolArray, 1]
"""Contiguous arrays with 1 to 4 axes, for the signatures of compiled loops (`jerkbench.compilation.compiled`)."""

WIDE = 8
"""Number of runs in a batch. A vector contains one number of each run (512 bits, one or a few processor registers)."""


class Keyed:
    """A cache key. Two keys are equal if they have the same class and equal values of ``key``."""

    def __init__(self, key: Hashable) -> None:
        """Store ``key``, and compute its hash once."""
        self._key, self._hash = key, hash(key)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, type(self)) and self._key == other._key


class Same(Keyed):
    """A cache key for several objects. The objects are compared by identity and not by value."""

    def __init__(self, *objects: Any) -> None:  # noqa: ANN401 - anything
        """Store references to the objects, so that their ids are not used again while the key exists."""
        super().__init__(tuple(map(id, objects)))
        self.objects = objects


def frozen(owner: object, name: str, value: Any, shape: tuple[int | None, ...]) -> FloatArray:  # noqa: ANN401 - anything array-like
    """Return ``value`` as a read-only float64 array, after a check of its shape. None in ``shape`` allows any length.

    Raises:
        RecordingError: The value is not numeric, or has a wrong shape. The error message names the class of ``owner``
            and the field ``name``.
    """
    where = f"{type(owner).__name__}.{name}"
    try:
        array: FloatArray = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise RecordingError(f"{where} is not an array of numbers: {error}.") from error
    if array.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, array.shape, strict=True)):
        wanted = ", ".join("n" if n is None else str(n) for n in shape)
        raise RecordingError(f"{where} has shape {array.shape}; it must be ({wanted}).")
    array.flags.writeable = False
    return array


def nearest_rows(stamps_s: FloatArray, t_s: FloatArray) -> IntArray:
    """Return the index of the stamp that is nearest to each time in ``t_s`` (m,). ``stamps_s`` (n,) must be sorted."""
    after = np.clip(np.searchsorted(stamps_s, t_s), 1, max(len(stamps_s) - 1, 1))
    before = after - 1
    last = np.minimum(after, len(stamps_s) - 1)
    return np.where(t_s - stamps_s[before] <= stamps_s[last] - t_s, before, last).astype(np.int64)


def linear_at(stamps_s: FloatArray, values: FloatArray, t_s: FloatArray, gap_s: float) -> FloatArray:
    """Interpolate ``values`` (n, k), n >= 2, linearly at the times ``t_s`` (m,). The result has the shape (m, k).

    The result is NaN before the first stamp, after the last stamp, and between two stamps whose interval is longer than
    ``gap_s``.
    """
    after = np.clip(np.searchsorted(stamps_s, t_s), 1, len(stamps_s) - 1)
    known = (stamps_s[after] - stamps_s[after - 1] <= gap_s) & (t_s >= stamps_s[0]) & (t_s <= stamps_s[-1])
    between = np.column_stack([np.interp(t_s, stamps_s, column) for column in values.T])
    return np.where(known[:, None], between, np.nan)


def streaks(flags: BoolArray) -> IntArray:
    """Return the start and the (exclusive) end of each of the k blocks of consecutive True ``flags``, shape (k, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return edges.reshape(-1, 2)


def require(ok: npt.ArrayLike, owner: object, name: str, reason: str) -> None:
    """Raise a RecordingError that names the field and the first row for which ``ok`` is False."""
    rows = np.flatnonzero(~np.asarray(ok, dtype=bool))
    if rows.size:
        more = f" (and {rows.size - 1} more rows)" if rows.size > 1 else ""
        raise RecordingError(f"{type(owner).__name__}.{name} row {rows[0]}{more}: {reason}.")


def require_times(owner: object, t_s: FloatArray) -> None:
    """Require that times are finite and strictly increasing."""
    require(np.isfinite(t_s), owner, "t_s", "the time is not a finite number")
    steps = np.concatenate([[True], np.diff(t_s) > 0])
    require(steps, owner, "t_s", "the time does not increase")


MIN_VARIANCE = 1e-20
"""Smallest variance of a measurement. Smaller values are placeholders, and lead to overflows in sums of squares."""

MIN_EIGENVALUE = 1e-14
"""Minimum ratio of the smallest to the largest eigenvalue of a covariance that is not numerically singular."""


def positive_definite(matrices: FloatArray) -> BoolArray:
    """Return a mask (n,) of the matrices (n, m, m) that are finite and numerically positive definite."""
    finite: BoolArray = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    values = np.linalg.eigvalsh(np.where(finite[:, None, None], matrices, 0.0))
    return np.asarray(finite & (values[:, 0] > np.maximum(MIN_VARIANCE, MIN_EIGENVALUE * values[:, -1])))


def require_covariances(owner: object, name: str, covariance: FloatArray, present: BoolArray) -> None:
    """Require that the covariances (n, 3, 3) are finite, symmetric and positive definite on the measured axes."""
    unused = ~present[:, :, None] | ~present[:, None, :]
    block = np.where(unused, np.eye(3), covariance)
    finite = np.isfinite(block).all(axis=(1, 2))
    require(finite, owner, name, "the covariance of a measured axis is not finite")
    asymmetry = np.abs(block - block.transpose(0, 2, 1)).max(axis=(1, 2), initial=0)
    symmetric = asymmetry <= 1e-9 * np.abs(block).max(axis=(1, 2), initial=0)
    require(symmetric, owner, name, "the covariance is not symmetric")
    variances = np.diagonal(block, axis1=1, axis2=2)
    uncorrelated = np.count_nonzero(block) == np.count_nonzero(variances)  # avoids slow eigenvalues
    definite = (variances > MIN_VARIANCE).all(axis=1) if uncorrelated else positive_definite(block)
    require(definite, owner, name, "the covariance is not positive definite")


# Checks of parameters. The parameters are attributes of ``owner``.


def require_choices(owner: object, choices: Mapping[str, Collection[str]]) -> None:
    """Raise a PluginError for the first parameter whose value is not among its choices."""
    for name, available in choices.items():
        require_known(name, getattr(owner, name), available)


def require_lengths(owner: object, lengths: Mapping[str, Collection[int]]) -> None:
    """Raise a PluginError for the first parameter whose number of entries is not allowed."""
    for name, allowed in lengths.items():
        value = getattr(owner, name)
        if len(value) not in allowed:
            *others, last = map(str, allowed)
            counts = f"{', '.join(others)} or {last}" if others else last
            raise PluginError(f"{name} has {len(value)} entries, {list(value)}; it must have {counts}.")


def require_positive(plugin: str, owner: object, names: Iterable[str]) -> None:
    """Raise a PluginError for the first parameter that is not a finite number above zero."""
    for name in names:
        value = getattr(owner, name)
        if not 0 < value < math.inf:
            raise PluginError(f"{plugin}: {name} is {value}; it must be a positive number.")


def require_not_negative(plugin: str, owner: object, names: Iterable[str]) -> None:
    """Raise a PluginError for the first parameter that is negative or not finite."""
    for name in names:
        value = getattr(owner, name)
        if not 0 <= value < math.inf:
            raise PluginError(f"{plugin}: {name} is {value}; it must be zero or positive, and finite.")


def require_axes(plugin: str, owner: object, names: Iterable[str], *, positive: bool) -> None:
    """Raise a PluginError for the first parameter that is not three finite numbers (above zero if ``positive``)."""
    for name in names:
        values = getattr(owner, name)
        fits = len(values) == 3 and all(math.isfinite(v) and (v > 0 or not positive) for v in values)
        if not fits:
            kind = "positive numbers" if positive else "numbers"
            raise PluginError(f"{plugin}: {name} is {values}; it must be three {kind}, one for each axis.")


def require_multiple(plugin: str, owner: object, high: str, low: str) -> None:
    """Raise a PluginError unless the rate ``high`` is an integer multiple of the rate ``low``."""
    ratio = getattr(owner, high) / getattr(owner, low)
    if ratio < 1 or not math.isclose(ratio, round(ratio), rel_tol=1e-9):
        values = f"{high} is {getattr(owner, high)} and {low} is {getattr(owner, low)}"
        raise PluginError(f"{plugin}: {values}; {high} must be an integer multiple of {low}.")


def identical(a: Any, b: Any) -> bool:  # noqa: ANN401 - anything that a plugin takes or returns
    """Return whether ``a`` and ``b`` have the same type and bitwise equal values. NaN counts as equal to NaN."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return a.shape == b.shape and a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if dataclasses.is_dataclass(a):
        return all(identical(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, dict):
        return list(a) == list(b) and all(identical(a[key], b[key]) for key in a)
    if isinstance(a, (tuple, list)):
        return len(a) == len(b) and all(map(identical, a, b))
    return bool(a == b) or (a != a and b != b)  # noqa: PLR0124 - only NaN is not equal to itself
