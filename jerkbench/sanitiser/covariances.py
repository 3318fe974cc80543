"""Unusable covariances: NaN, zero, or not positive definite."""

from collections.abc import Sequence

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import RecordingError
from jerkbench.readers.ros.messages import Messages
from jerkbench.sanitiser.ledger import DROPPED, Ledger

ROUNDING = 1e-6
"""A covariance that is asymmetric by less, relatively, was rounded on its way."""

SMALLEST = 1e-14
"""A smaller variance (0.1 micrometres) is a placeholder."""


def sound_covariances(
    stream: str, messages: Messages, ledger: Ledger, field: str, sigma: Sequence[float], parameter: str
) -> Messages:
    """Symmetrise the covariances (n, 9) of ``field``; replace or drop those that are none.

    In the mode "repair" such a row gets ``sigma`` squared on its diagonal, or, where that is empty, the covariance of
    the stream's median trace; with "drop" it is dropped, unless ``sigma`` is given and no row has a covariance.

    Raises:
        RecordingError: no row has a covariance, and ``sigma`` is empty; names ``parameter``, which gives it.
    """
    matrices = messages[field].reshape(-1, 3, 3)
    whole = 0.5 * (matrices + matrices.transpose(0, 2, 1))
    good = _is_covariance(matrices, whole)
    if not good.any() and len(messages) and not sigma:
        raise RecordingError(
            f"{stream}: none of the {len(messages)} rows has a covariance (zero, NaN or not positive definite);"
            f" give {parameter}: three standard deviations."
        )
    messages = messages.with_values(**{field: whole.reshape(-1, 9)})
    fault = f"a {field.replace('_', ' ')} that is zero, NaN or not positive definite"
    if ledger.repairs or not good.any():
        replacement, done = _replacement(whole[good], sigma)
        ledger.add(stream, fault, ~good, messages.bag_ns, done)
        return messages.with_values(**{field: np.where(good[:, None], messages[field], replacement.ravel())})
    ledger.add(stream, fault, ~good, messages.bag_ns, DROPPED)
    return messages.rows(good)


def _replacement(good: FloatArray, sigma: Sequence[float]) -> tuple[FloatArray, str]:
    if sigma:
        return np.diag(np.square(sigma)), "replaced by sigmas of " + ", ".join(f"{s:g}" for s in sigma)
    if not len(good):
        return np.eye(3), "replaced"
    middle = np.argsort(np.trace(good, axis1=1, axis2=2))[len(good) // 2]
    return good[middle], "replaced by the stream's median covariance"


def _is_covariance(matrices: FloatArray, whole: FloatArray) -> BoolArray:
    finite: BoolArray = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    usable = np.where(finite[:, None, None], whole, 0.0)
    size = np.abs(usable).max(axis=(1, 2), initial=0)
    with np.errstate(over="ignore", invalid="ignore"):
        skew = np.abs(matrices - whole).max(axis=(1, 2), initial=0)
        symmetric = finite & (skew <= ROUNDING * size)
    bounded = size < 1e12  # a receiver without a fix writes 1e20 or so
    lowest = np.linalg.eigvalsh(np.where((symmetric & bounded)[:, None, None], usable, 0.0))[:, 0]
    return np.asarray(symmetric & bounded & (lowest > SMALLEST))
