"""The rows of an estimate that count, and what an estimate must reach for them."""

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.errors import RecordingError
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_stamps import known_axes
from jerkbench.recording import Recording


def counted_rows(estimate: Estimate, recording: Recording, burn_in_s: float) -> BoolArray:
    """Return (k,) which rows of the estimate count.

    The reference is scored there, the burn-in [s] is over, and something of the reference is known; with an empty
    reference the innovations count all the same. Whether the estimate itself is a number does not matter here: a filter
    must not improve its score by failing.
    """
    reference = recording.reference
    truths = (reference.enu_m, reference.velocity_mps, reference.euler_rad)
    something = [known_axes(truth, estimate.index).any(axis=1) for truth in truths]
    late = reference.t_s[estimate.index] >= burn_in_s
    rows: BoolArray = reference.scored[estimate.index] & late & (reference.empty | np.any(something, axis=0))
    return rows


def require_begin(estimate: Estimate, recording: Recording, burn_in_s: float) -> None:
    """Require that an estimate leaves nothing out at its begin that counts.

    Errors count from the burn-in [s] on, or from the first fix where that is later.

    Raises:
        RecordingError: it begins later.
    """
    fix_s = float(recording.position.t_s[0]) if recording.position is not None else 0.0
    stamps_s, latest_s = recording.reference.t_s, max(burn_in_s, fix_s)
    due = int(np.searchsorted(stamps_s, latest_s))
    if len(estimate.index) == 0 or due == len(stamps_s) or estimate.index[0] <= due:
        return
    raise RecordingError(
        f"The estimate begins at {stamps_s[estimate.index[0]]:.2f} s, and errors count from {latest_s:.2f} s on; let it"
        " begin earlier, or let the errors of all methods count later (burn_in_s)."
    )


def nothing_counts(recording: Recording, burn_in_s: float) -> str:
    """Return the sentence for a run of which no row counts."""
    return (
        f"No error counts: burn_in_s is {burn_in_s:g}, the recording '{recording.name}' lasts "
        f"{recording.duration_s:.2f} s, and no row of its reference after the burn-in is known, scored and reached; "
        "give a shorter burn-in, or a recording with a reference."
    )
