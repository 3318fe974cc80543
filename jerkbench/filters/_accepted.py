"""The adaptations that an estimator can take."""

from jerkbench import plugins
from jerkbench.contracts import Fading


def without_fading() -> tuple[str, ...]:
    """Names of all adaptations, also a third party's, that change R alone and do not fade P."""
    names = plugins.names("adaptation")
    return tuple(name for name in names if not isinstance(plugins.get("adaptation", name), Fading))
