"""Combinations that stand in a study as a reference and compete with nobody."""

from collections.abc import Mapping

ORACLE, FLOOR = "oracle", "gnss_only"

WHY = {
    "adaptation": {ORACLE: "is told the true covariance"},
    "filter": {FLOOR: "is the floor, without an IMU"},
}
"""Factor -> label without its parameters -> why it does not compete."""

TOLD_ATTITUDE = "reference"
"""This attitude is the reference's own; it makes a scenario, and competes with no other attitude."""


def competes(values: Mapping[str, str]) -> bool:
    """Whether a combination can be the best, by the labels of some of its factors.

    >>> competes({"filter": "jerk", "adaptation": "oracle"})
    False
    """
    return not any(_name(values.get(factor, "")) in references for factor, references in WHY.items())


def attitude_competes(attitude: str) -> bool:
    """Whether an attitude can be the best of several."""
    return _name(attitude) != TOLD_ATTITUDE


def standing_apart(labels: Mapping[str, set[str]]) -> str:
    """Return a sentence about those that are among the labels of each factor; empty where none is."""
    apart = [
        f"{name} ({why})"
        for factor, references in WHY.items()
        for name, why in references.items()
        if name in {_name(label) for label in labels.get(factor, ())}
    ]
    return f"{' and '.join(apart)} {'do' if len(apart) > 1 else 'does'} not compete." if apart else ""


def _name(label: str) -> str:
    return label.partition("(")[0]
