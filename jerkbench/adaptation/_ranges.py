"""Parameters of several adaptations: the ranges they are tuned in, and the checks."""

from jerkbench.errors import PluginError
from jerkbench.parameters import PLUGIN_TITLES, Limit, Range

FORGETTING = Range(0.7, 0.999, toward_one=True, source="ours: from a memory of three updates to one of 1000")
PROBABILITY = Range(0.9, 0.99999, toward_one=True, source="ours: from one false alarm in ten updates to one in 100 000")
BANDWIDTH = Range(
    1.0, 50.0, log=True, source="ours: from a kernel that rejects good measurements to one that rejects none"
)
FREEDOM = Range(1.0, 100.0, log=True, source="ours: from Cauchy's tails to all but Gaussian ones")
SHRINKING = Range(0.01, 1.0, log=True, source="ours: from a tenth of the reported sigma to no shrinking")
WINDOW = Range(3, 200, log=True, source="ours: from an estimate that is noise itself to 40 s of fixes at 5 Hz")
SHORT_WINDOW = Range(1, 50, log=True, source="ours: from the paper's single innovation to ten seconds of fixes at 5 Hz")

MAX_PASSES = 1000
"""Of an update: a hundred times those of the papers; more take a run from minutes to years."""

ABOVE_0 = Limit(lambda value: value > 0, "it must be above 0.")
ONE_OR_MORE = Limit(lambda value: value >= 1, "it must be at least 1.")
NONE_OR_MORE = Limit(lambda value: value >= 0, "it must be 0 or more.")
WITHIN_0_AND_1 = Limit(lambda share: 0 < share < 1, "it must lie between 0 and 1.")
HITS = Limit(lambda guard: guard >= 0, "it must be 0 (off) or the number of hits that inflate.")
SOME_PASSES = Limit(lambda passes: 1 <= passes <= MAX_PASSES, f"it must be from 1 to {MAX_PASSES}.")


def one_of(values: tuple[str, ...]) -> Limit:
    """Return the limit of a parameter that is one of these words."""
    return Limit(lambda value: value in values, f"it must be one of {', '.join(values)}.")


ONE_OF_SIDES = one_of(("both", "measurement"))
"""Whom a weight may doubt: prior and measurement, or the measurement alone."""


def check_order(adaptation: object, low: str, high: str, *, equal: bool = True) -> None:
    """Raise a PluginError unless 0 < ``low`` <= ``high``, two parameters of an adaptation."""
    least, most = getattr(adaptation, low), getattr(adaptation, high)
    if not (0 < least <= most and (equal or least < most)):
        sign, title = "<=" if equal else "<", PLUGIN_TITLES.get(type(adaptation), "")
        raise PluginError(f"{title}needs 0 < {low} {sign} {high}; they are {least} and {most}.")
