"""Every plugin of this package passes the checks that it offers to others."""

import pytest

from jerkbench import plugins
from jerkbench.testing import check_plugin

KINDS = ("disturbance", "attitude", "filter", "adaptation", "metric")
SHORT = {"duration_s": 12.0, "stand_s": 2.0, "rut_times_s": (8.0,)}
"""A simulated drive of a few seconds is as good as a long one here."""


def own(kind):
    return [name for name in plugins.names(kind) if plugins.get(kind, name).__module__.startswith("jerkbench.")]


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind in KINDS for name in own(kind)])
def test_it_conforms(kind, name):
    check_plugin(kind, plugins.create(kind, {"name": name}))


@pytest.mark.parametrize("name", [name for name in own("dataset") if name.startswith("field")])
def test_a_simulated_data_set_conforms(name):
    check_plugin("dataset", plugins.create("dataset", {"name": name, **SHORT}))


def test_the_reference_engine_conforms():
    check_plugin("engine", plugins.create("engine", {"name": "filterpy"}))


def test_the_real_drive_conforms(shared_folder):
    folder = shared_folder / "data" / "rtklib_drive_0708"
    check_plugin("dataset", plugins.create("dataset", {"name": "rtklib", "folder": str(folder)}))
