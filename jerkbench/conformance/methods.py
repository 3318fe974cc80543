"""The methods and attributes that a plugin of each kind cannot do without."""

from collections.abc import Mapping
from typing import Any

from jerkbench.conformance.require import require
from jerkbench.errors import article

METHODS: Mapping[str, tuple[str, ...]] = {
    "dataset": ("load", "fingerprint"),
    "disturbance": ("apply", "replicates"),
    "attitude": ("estimate",),
    "adaptation": ("adapt",),
    "engine": ("run",),
    "metric": ("evaluate",),
    "kinematic filter": ("axis_model", "initial_variances"),
    "estimator": ("estimate",),
}


def require_methods(kind: str, plugin: Any) -> None:  # noqa: ANN401 - the plugin under test
    """Check that ``plugin`` has the methods of its ``kind``; a filter those of one of the two sorts.

    Raises:
        AssertionError: one is not there.
    """
    subject, sort = type(plugin).__name__, kind
    if kind == "filter":
        sort = next((s for s in ("kinematic filter", "estimator") if hasattr(plugin, METHODS[s][0])), "")
        require(sort, f"{subject} has neither axis_model() nor estimate(); it needs one of them.")
    for name in METHODS[sort]:
        has = callable(getattr(plugin, name, None))
        require(has, f"{subject} has no method {name}(); {article(sort)} {sort} needs it (see jerkbench.contracts).")
    if sort in ("dataset", "disturbance"):
        require_seeded(subject, plugin)
    if sort == "estimator":
        require(hasattr(plugin, "adaptations"), f"{subject} has no adaptations; it must name those that it accepts.")


def require_seeded(subject: str, plugin: Any) -> None:  # noqa: ANN401 - the plugin under test
    """Check that it says whether it is random."""
    seeded = getattr(plugin, "seeded", None)
    require(isinstance(seeded, bool), f"{subject}.seeded is {seeded!r}; it must be True or False.")
