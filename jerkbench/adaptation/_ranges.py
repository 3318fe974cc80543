"""Parameters of several adaptations: the ranges they are tuned in, and the checks."""

from jerkbench.errors import PluginError, unknown
from jerkbench.parameters import Range

FORGETTING = Range(0.7, 0.999, toward_one=True, source="ours: from a memory of three updates to one of 1000")
PROBABILITY = Range(0.9, 0.99999, toward_one=True, source="ours: from one false alarm in ten updates to one in 100 000")
BANDWIDTH = Range(
    1.0, 50.0, log=True, source="ours: from a kernel that rejects good measurements to one that rejects none"
)
FREEDOM = Range(1.0, 100.0, log=True, source="ours: from Cauchy's tails to all but Gaussian ones")
SHRINKING = Range(0.01, 1.0, log=True, source="ours: from a tenth of the reported sigma to no shrinking")
WINDOW = Range(3, 200, log=True, source="ours: from an estimate that is noise itself to 40 s of fixes at 5 Hz")
SHORT_WINDOW = Range(1, 50, log=True, source="ours: from the paper's single innovation to ten seconds of fixes at 5 Hz")

MOST_PASSES = 1000
"""Of an update: a hundred times those of the papers; more take a run from minutes to years."""

SIDES = ("both", "measurement")
"""Whom a weight may doubt: prior and measurement, or the measurement alone."""


def check_passes(name: str, passes: int) -> None:
    """Refuse a number of passes that is none, or that no run would end with.

    Raises:
        PluginError: it is below 1 or above `MOST_PASSES`.
    """
    if not 1 <= passes <= MOST_PASSES:
        raise PluginError(f"{name}.passes is {passes}; it must be from 1 to {MOST_PASSES}.")


def check_window(name: str, window: int, guard: int = 0) -> None:
    """Raise a PluginError where the window or the guard of adaptation ``name`` makes no sense."""
    if window < 1:
        raise PluginError(f"{name}.window is {window}; it must be at least 1.")
    if guard < 0:
        raise PluginError(f"{name}.guard is {guard}; it must be 0 (off) or the number of hits that inflate.")


def check_probability(name: str, probability: float) -> None:
    """Raise a PluginError where ``probability`` of adaptation ``name`` is none."""
    if not 0 < probability < 1:
        raise PluginError(f"{name}.probability is {probability}; it must lie between 0 and 1.")


def check_sides(name: str, sides: str) -> None:
    """Raise a PluginError where ``sides`` of adaptation ``name`` is none of `SIDES`."""
    if sides not in SIDES:
        raise PluginError(f"{name}.sides: {unknown('value', sides, SIDES)}")
