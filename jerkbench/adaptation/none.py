"""The two references for the comparison of adaptations: the reported R, and the true covariance as R."""

from dataclasses import dataclass
from typing import ClassVar

from jerkbench.adaptation.common import UnchangedR
from jerkbench.parameters import Provenance
from jerkbench.plugins import register


@register("adaptation", "none")
@dataclass(frozen=True)
class NoAdaptation(UnchangedR):
    """Uses the R that the receiver reports, without an adaptation.

    The plugin `none` is the baseline for comparisons with all other adaptations.

    Source: the Kalman filter (R. E. Kalman, 1960, doi:10.1115/1.3662552).
    """

    provenance = Provenance("published", "doi:10.1115/1.3662552")
    changes_nothing: ClassVar[bool] = True


@register("adaptation", "oracle")
@dataclass(frozen=True)
class Oracle(UnchangedR):
    """Uses the true covariance of the error of each measurement as R.

    The engine replaces R by the true covariance before it calls the adaptation. The true covariance is known only in a
    simulation, or for a simulated disturbance of a recording. The true variance of an axis includes the square of a
    constant offset. No adaptation of R is expected to be more accurate than `oracle`, so the difference between `none`
    and `oracle` is the possible improvement. If the true covariance is not known, the result is the same as with
    `none`.
    """

    provenance = Provenance("own", "", "A reference that uses the true R; not a method.")

    wants_true_covariance: ClassVar[bool] = True
