"""How fast the position error grows while there is no aiding."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, position_error_m
from jerkbench.evaluation.outage import inside_outages, outage_rows
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("metric", "outage_drift")
@dataclass(frozen=True)
class OutageDrift:
    """Growth of the position error over an outage, per second.

    With f(j) and l(j) the first and the last row inside outage j, as in the metric `outage`, and e_i the error [m]::

        outage_drift_mps = mean over j of |e_l(j) - e_f(j)|/(t_l(j) - t_f(j))

    The error with which the outage began does not count. NaN without an outage of two rows.
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the value by column name."""
        t_s = recording.reference.t_s[estimate.index]
        late = t_s >= np.min(t_s[counted], initial=np.inf)
        inside = inside_outages(t_s, recording.outages_s) & known(recording.reference.enu_m, estimate) & late
        error = position_error_m(estimate, recording)
        with np.errstate(over="ignore", invalid="ignore"):
            drifts = [
                np.linalg.norm(error[b] - error[a]) / (t_s[b] - t_s[a])
                for a, b in outage_rows(inside, t_s, recording)
                if b > a
            ]
        return {"outage_drift_mps": float(np.mean(drifts)) if drifts else np.nan}
