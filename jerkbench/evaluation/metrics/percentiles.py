"""Percentiles of the position error."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, position_error_m
from jerkbench.plugins import register
from jerkbench.recording import Recording

PERCENTILES = (50, 68, 95, 99)


@register("metric", "percentiles")
@dataclass(frozen=True)
class Percentiles:
    """Percentiles of the length of the position error.

    With e_i = p_i - p_ref,i [m] over the N counted rows, position_pQ_m is the value that Q % of the |e_i| do not exceed
    (linear between the order statistics). Horizontal likewise, with east and north.

    NaN without a row. Not computed unless asked for: ``metrics=[percentiles]``.
    """

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the eight values by column name."""
        values: dict[str, float] = {}
        for name, axes in (("", (0, 1, 2)), ("_horizontal", (0, 1))):
            rows = counted & known(recording.reference.enu_m, estimate, axes)
            with np.errstate(over="ignore", invalid="ignore"):
                norm = np.sqrt(np.sum(position_error_m(estimate, recording)[rows][:, axes] ** 2, axis=1))
                percentiles = np.percentile(norm, PERCENTILES) if len(norm) else np.full(len(PERCENTILES), np.nan)
            values |= {f"position{name}_p{q}_m": float(v) for q, v in zip(PERCENTILES, percentiles, strict=True)}
        return values
