"""Standard deviations that are far too small."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.diagnosis.diagnosis import Diagnosis
from jerkbench.inspection.sigmas import (
    MEDIAN_OF_SQUARE,
    REFERENCE,
    REST,
    Sigma,
    stated_against_real_sigma,
    stated_streams,
)
from jerkbench.recording import Recording

LEAST_RATIO = 4.0
"""A receiver among towers errs 3.2 times as much as it says, in the middle of its errors; a mistake is more."""

LEAST_SPREAD = 2.0
"""About its median a receiver among towers errs 1.2 times as much as it says; this is less than a mistake by 10 leaves
of sigmas that are four times too large."""

LONGEST_GAP_S = 1.1

LEAST_ROWS = 30

FAST_SHARE = 1.5
"""Variance of x_i - (x_i-1 + x_i+1)/2 of white noise with variance 1."""

PARAMETERS = {"position": "position_sigma_scale or position_sigma_m", "velocity": "velocity_sigma_mps"}


def understated_noise(recording: Recording) -> list[Diagnosis]:
    """Return the streams that err at least four times as much as they say, fixes about their offset at least twice.

    By the scatter at rest, by the error against a reference, and by the jitter from row to row; of errors with a long
    tail only the middle counts, for a false fix is no matter of scale. Too large ones are not told: a slow error hides.
    """
    ratios = [*_jitter(recording), *(_ratio(sigma) for sigma in stated_against_real_sigma(recording))]
    worst: dict[str, tuple[float, str]] = {}
    spread = [entry for entry in _spread(recording) if entry[1] >= LEAST_SPREAD]
    for stream, ratio, basis in [*(entry for entry in ratios if entry[1] >= LEAST_RATIO), *spread]:
        if ratio > worst.get(stream, (0.0, ""))[0]:
            worst[stream] = ratio, basis
    return [_understated(stream, ratio, basis) for stream, (ratio, basis) in worst.items()]


def _spread(recording: Recording) -> list[tuple[str, float, str]]:
    """The middle of the fixes' errors about their median against their sigmas, all axes together.

    The reference is taken linearly between stamps a second apart, too: an offset, which a reference may have, is gone,
    and half a metre of a bend within a second is nothing to the sigma of a receiver at 1 Hz.
    """
    position, reference = recording.position, recording.reference
    if position is None or reference.enu_m is None or len(reference.t_s) < LEAST_ROWS:
        return []
    t_s = position.t_s
    after = np.clip(np.searchsorted(reference.t_s, t_s), 1, len(reference.t_s) - 1)
    near = (reference.t_s[after] - reference.t_s[after - 1] <= LONGEST_GAP_S) & (t_s >= reference.t_s[0])
    near &= (t_s <= reference.t_s[-1]) & np.isfinite(position.enu_m).all(axis=1)
    truth = np.column_stack([np.interp(t_s, reference.t_s, column) for column in reference.enu_m.T])
    error = (position.enu_m - truth)[near]
    if len(error) < LEAST_ROWS or not np.isfinite(error).all() or not error.any():
        return []
    sigmas = np.sqrt(np.diagonal(position.covariance_m2[near], axis1=1, axis2=2))
    squares = ((error - np.median(error, axis=0)) / sigmas) ** 2
    ratio = float(np.sqrt(np.median(squares) / MEDIAN_OF_SQUARE))
    return [("position", ratio, "the middle of the error against the reference, about its median")]


def _ratio(sigma: Sigma) -> tuple[str, float, str]:
    bases = {REST: "the scatter at rest", REFERENCE: "the median error against the reference"}
    return sigma.stream, sigma.ratio if sigma.basis == REST else sigma.median_ratio, bases[sigma.basis]


def _jitter(recording: Recording) -> list[tuple[str, float, str]]:
    """Of each stream the middle of |x_i - (x_i-1 + x_i+1)/2| against its sigma, east and north together."""
    ratios = []
    for stream, _, _, values, covariance in stated_streams(recording):
        sigmas = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))[1:-1, :2]
        fast = values[1:-1, :2] - 0.5 * (values[2:, :2] + values[:-2, :2])
        rows = np.isfinite(fast).all(axis=1)
        if rows.sum() >= LEAST_ROWS:
            ratios.append((stream, _middle(fast[rows] / sigmas[rows]), "the jitter from row to row"))
    return ratios


def _middle(standardised: FloatArray) -> float:
    return float(np.sqrt(np.median(standardised**2) / (MEDIAN_OF_SQUARE * FAST_SHARE)))


def _understated(stream: str, ratio: float, basis: str) -> Diagnosis:
    return Diagnosis(
        f"sd of {stream} too small",
        f"{basis} is {ratio:.1f} times as large as stated",
        f"The standard deviations of {stream} are too small",
        f"Scale them by {ratio:.0f}: {PARAMETERS[stream]}",
    )
