"""Tuning ranges and limits that several adaptations share."""

from jerkbench.errors import PluginError
from jerkbench.parameters import PLUGIN_TITLES, Limit, Range

FORGETTING = Range(0.7, 0.999, toward_one=True, source="ours: from a memory of 3 updates to one of 1000")
PROBABILITY = Range(0.9, 0.99999, toward_one=True, source="ours: from one false alarm in ten updates to one in 100 000")
BANDWIDTH = Range(
    1.0, 50.0, log=True, source="ours: from a kernel that rejects good measurements to one that rejects none"
)
FREEDOM = Range(1.0, 100.0, log=True, source="ours: from the tails of a Cauchy distribution to nearly Gaussian ones")
SHRINKING = Range(0.01, 1.0, log=True, source="ours: from a tenth of the reported sigma to no shrinking")
WINDOW = Range(3, 200, log=True, source="ours: from a very noisy estimate to 40 s of fixes at 5 Hz")
SHORT_WINDOW = Range(1, 50, log=True, source="ours: from the single innovation of the paper to 10 s of fixes at 5 Hz")

MAX_PASSES = 1000
"""Maximum number of passes of an iterated update, which limits the run time. The papers use at most ten passes."""

ABOVE_0 = Limit(lambda value: value > 0, "it must be above 0.")
ZERO_OR_MORE = Limit(lambda value: value >= 0, "it must be 0 or more.")
HITS = Limit(lambda guard: guard >= 0, "it must be 0 (off) or the number of consecutive hits that inflate R.")
PASSES = Limit(lambda passes: 1 <= passes <= MAX_PASSES, f"it must be from 1 to {MAX_PASSES}.")


def one_of(values: tuple[str, ...]) -> Limit:
    """Return the limit of a parameter whose value must be one of ``values``."""
    return Limit(lambda value: value in values, f"it must be one of {', '.join(values)}.")


ONE_OF_SIDES = one_of(("both", "measurement"))
"""Limit of the parameter ``sides``: a robust filter weights prior and measurement, or only the measurement."""


def check_order(adaptation: object, low: str, high: str, *, equal: bool = True) -> None:
    """Check that 0 < low <= high for two parameters of an adaptation.

    The names of the two parameters are ``low`` and ``high``. If ``equal`` is false, the values must also differ.

    Raises:
        PluginError: the values of the parameters are not in this order.
    """
    minimum, maximum = getattr(adaptation, low), getattr(adaptation, high)
    if not (0 < minimum <= maximum and (equal or minimum < maximum)):
        sign, title = "<=" if equal else "<", PLUGIN_TITLES.get(type(adaptation), "")
        raise PluginError(f"{title}{low} is {minimum} and {high} is {maximum}; 0 < {low} {sign} {high} is required.")
