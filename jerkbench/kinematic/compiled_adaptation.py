"""The adaptation of an estimator over kinematic filters, compiled as their engine compiles it."""

from collections.abc import Hashable
from functools import lru_cache
from typing import cast

from jerkbench.contracts import Adaptation
from jerkbench.estimation.adaptation_call import made_or_said
from jerkbench.kinematic.plugin_call import Rule, rule_of


def compiled_rule(adaptation: Adaptation) -> Rule | None:
    """Return the compiled adaptation; None, and one line that says why, where there is none."""
    return _compiled(cast("Hashable", adaptation))


@lru_cache(maxsize=256)
def _compiled(adaptation: Hashable) -> Rule | None:
    return made_or_said(lambda: rule_of(cast("Adaptation", adaptation)), adaptation)
