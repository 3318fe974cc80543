"""Checks of plugins, for use in the tests of plugin packages.

Each check raises an AssertionError whose message describes the problem. For example::

    from jerkbench.testing import check_plugin
    from my_package import MyAdaptation

    def test_the_adaptation_satisfies_its_contract():
        check_plugin("adaptation", MyAdaptation())

`check_plugin` checks the class (frozen, documented, hashable) and the methods of a plugin. The functions for one kind
of plugin, such as `check_filter`, check only the methods. `small_recording` and `true_attitude` return the recording
and the attitude that the checks pass to a plugin.
"""

from jerkbench.plugins.checks import (
    check_adaptation,
    check_attitude,
    check_dataset,
    check_disturbance,
    check_engine,
    check_filter,
    check_metric,
    check_plugin,
)
from jerkbench.plugins.samples import small_recording, true_attitude

__all__ = [
    "check_adaptation",
    "check_attitude",
    "check_dataset",
    "check_disturbance",
    "check_engine",
    "check_filter",
    "check_metric",
    "check_plugin",
    "small_recording",
    "true_attitude",
]
