"""How good the reference is: its own sigma, and the epochs at which it is too bad to count."""

import dataclasses

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import Reference


def with_sigma(reference: Reference, sigma_m: FloatArray | None, worst_m: float) -> tuple[Reference, tuple[str, ...]]:
    """Return the reference with its sigma (k, 3), and what a reader of a table has to know of it.

    Args:
        reference: with its k stamps.
        sigma_m: one standard deviation of east, north and up; None: not known.
        worst_m: errors do not count where sqrt(sum of sigma^2) is larger, or is no number; 0: they count everywhere.
    """
    if sigma_m is None:
        return reference, ()
    size_m = np.sqrt((sigma_m**2).sum(axis=1))
    good = np.isfinite(size_m) & ((size_m <= worst_m) if worst_m else True)
    reference = dataclasses.replace(reference, sigma_m=sigma_m, scored=reference.scored & good)
    floor_m = float(np.sqrt(np.mean(size_m[good] ** 2))) if good.any() else float("nan")
    known = f"The reference is known to {floor_m:.3g} m (3-D, one sigma)"
    notes = [f"{known}: a perfect estimate has that RMSE, and smaller differences get no verdict."]
    if not good.all():
        notes.append(f"{int((~good).sum())} of {len(good)} epochs of the reference are too bad: they do not count.")
    return reference, tuple(notes)
