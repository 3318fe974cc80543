"""Conformance checks for a plugin's author.

Each check raises an AssertionError whose sentence says what is not as it must be. In a test of your own::

    from jerkbench.testing import check_plugin
    from my_package import MyAdaptation

    def test_it_is_a_proper_adaptation():
        check_plugin("adaptation", MyAdaptation())

`check_plugin` looks at the class as well (frozen, documented, hashable); the others at what their kind promises.
"""

from jerkbench.plugins.checks import check_attitude, check_dataset, check_disturbance, check_metric, check_plugin
from jerkbench.plugins.method_checks import check_adaptation, check_engine, check_filter

__all__ = [
    "check_adaptation",
    "check_attitude",
    "check_dataset",
    "check_disturbance",
    "check_engine",
    "check_filter",
    "check_metric",
    "check_plugin",
]
