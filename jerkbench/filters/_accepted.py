"""The adaptations that an estimator can take."""

from jerkbench import plugins
from jerkbench.contracts import AdaptingGain, AdaptingPrior, Fading

BEYOND_R = (Fading, AdaptingPrior, AdaptingGain)
"""What an adaptation changes besides R: it needs the one prior covariance of one linear filter."""


def of_r_alone() -> tuple[str, ...]:
    """Names of all adaptations, also a third party's, that change R alone."""
    names = plugins.names("adaptation")
    return tuple(name for name in names if not isinstance(plugins.get("adaptation", name), BEYOND_R))


def of_r_or_fading() -> tuple[str, ...]:
    """Names of all that change R, or fade the prior covariance."""
    names = plugins.names("adaptation")
    return tuple(n for n in names if not isinstance(plugins.get("adaptation", n), (AdaptingPrior, AdaptingGain)))
