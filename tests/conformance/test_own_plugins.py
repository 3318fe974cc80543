"""Every plugin of this package passes the checks that it offers to others."""

import importlib.util
import math
from dataclasses import fields
from typing import get_type_hints

import numpy as np
import pandas as pd
import pytest

from jerkbench import plugins
from jerkbench.errors import PluginError
from jerkbench.plugins.samples import small_recording
from jerkbench.testing import check_plugin

KINDS = ("disturbance", "attitude", "filter", "adaptation", "metric")
SHORT = {"duration_s": 12.0, "stand_s": 2.0, "rut_times_s": (8.0,)}
"""A simulated drive of a few seconds is as good as a long one here."""


FROM_ELSEWHERE = ("trajectory", "command", "attitude_command")
"""Filters that need something of the user's."""


WITH_LOOPS = ("eskf15", "iekf", "imm", "rts")
"""Estimators that compile a loop of their own, or two."""

NOT_HERE = () if importlib.util.find_spec("vqf") else ("vqf", "offline_vqf")


def own(kind):
    names = [name for name in plugins.names(kind) if plugins.get(kind, name).__module__.startswith("jerkbench.")]
    return [name for name in names if name not in (*FROM_ELSEWHERE, *NOT_HERE)]


def plugin(kind, name):
    """Its kind and its name."""
    slow = [pytest.mark.slow] if kind == "filter" and name in WITH_LOOPS else []
    return pytest.param(kind, name, marks=slow)


@pytest.mark.parametrize(("kind", "name"), [plugin(kind, name) for kind in KINDS for name in own(kind)])
def test_it_conforms(kind, name):
    check_plugin(kind, plugins.create(kind, {"name": name}))


UNLIMITED = {"beta", "slip", "forward_m", "left_m", "up_m", "first_s", "every_s", "length_s", "start_s"}
"""Parameters that may be negative, and those of regular windows, which are checked when the windows are computed."""
OTHERS = {"first", "second", "stream", "trace"}
"""Names of models, whose message names the filter, and names that may be anything."""
INFINITE = {"gyro_correlation_s", "accel_correlation_s", "track_least_m", "constraint_interval_s", "kappa"}
"""Parameters of filters that may be infinite, apart from the limits of a standstill."""


WRONG = {float: (-1e9, math.nan), int: (-(10**9),), str: ("no such value",)}


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind in KINDS for name in own(kind)])
def test_every_parameter_has_a_limit_and_the_message_names_it(kind, name):
    cls = plugins.get(kind, name)
    types = get_type_hints(cls)
    for parameter in (field.name for field in fields(cls) if field.name not in UNLIMITED | OTHERS):
        finite = parameter not in INFINITE and not parameter.startswith("still_")
        infinite = [math.inf] if types[parameter] is float and kind in ("filter", "attitude") and finite else []
        for value in (*WRONG.get(types[parameter], ()), *infinite):
            with pytest.raises(PluginError, match=rf"\b{parameter}\b"):
                plugins.create(kind, {"name": name, parameter: value})


@pytest.mark.parametrize("name", [name for name in own("dataset") if name.startswith("field")])
def test_a_simulated_data_set_conforms(name):
    check_plugin("dataset", plugins.create("dataset", {"name": name, **SHORT}))


def test_a_trajectory_from_elsewhere_conforms(tmp_path):
    reference = small_recording().reference
    names = ["t_s", "east_m", "north_m", "up_m", "east_mps", "north_mps", "up_mps", "roll_rad", "pitch_rad", "yaw_rad"]
    columns = np.column_stack([reference.t_s, reference.enu_m, reference.velocity_mps, reference.euler_rad])
    table = pd.DataFrame(columns, columns=names).assign(**{f"s{k}": 0.01 for k in range(6)})
    table.to_csv(tmp_path / "a.csv", index=False)
    given = {"file": str(tmp_path / "a.csv"), "covariance": [f"s{k}" for k in range(6)]}
    check_plugin("filter", plugins.create("filter", {"name": "trajectory", **given}))


def test_the_reference_engine_conforms():
    check_plugin("engine", plugins.create("engine", {"name": "filterpy"}))


def test_the_real_drive_conforms(shared_folder):
    folder = shared_folder / "data" / "rtklib_drive_0708"
    check_plugin("dataset", plugins.create("dataset", {"name": "rtklib", "folder": str(folder)}))
