"""Every plugin of this package passes the checks that it offers to others."""

import importlib.util
import math
from dataclasses import fields
from typing import get_type_hints

import numpy as np
import pandas as pd
import pytest

from jerkbench import plugins
from jerkbench.contracts import Batched
from jerkbench.errors import PluginError
from jerkbench.evaluation.counted_rows import counted_rows, largest_norm, position_error_m
from jerkbench.evaluation.evaluated_run import prepare_reference, run_status, sums_from, sums_of, why_diverged
from jerkbench.plugins.checks import AGREEMENT, AGREEMENT_M, BURN_IN_S, check_agreement
from jerkbench.plugins.samples import small_recording, true_attitude
from jerkbench.testing import check_plugin
from jerkbench.timeline import RecordedRun, build_timeline

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
    plugin = plugins.create(kind, {"name": name})
    check_plugin(kind, plugin)
    if kind == "filter" and isinstance(plugin, Batched):
        check_batched(plugin)


def check_batched(plugin):
    """Compare a compiled run, and the sums of two batched runs that diverge, with a run in Python."""
    recording = small_recording()
    attitude, adaptation = true_attitude(recording), plugins.create("adaptation", {"name": plugin.adaptations[0]})
    wanted = plugin.estimate(recording, attitude, adaptation)
    if (compiled := plugin.estimate_compiled(recording, attitude, adaptation)) is not None:
        check_agreement("estimate_compiled()", compiled, wanted, "estimate()")
    timeline = build_timeline(recording, attitude)
    limit_m = 0.5 * largest_norm(position_error_m(wanted, recording))
    if (reference := prepare_reference(recording, timeline, BURN_IN_S, limit_m)) is None:
        return
    expected = sums_of(wanted, recording, counted_rows(wanted, recording, BURN_IN_S))
    diverged = run_status(wanted, recording, limit_m)[1]
    run, settings = RecordedRun(recording, attitude, timeline, reference.scoring), ([plugin] * 2, [adaptation] * 2)
    results = plugin.run_settings([run, run], *settings, updates=False, attitude=False, threads=1)
    assert len(results) == 2
    for result in filter(None, results):
        got = sums_from(result, reference, recording)
        for name in ("position_m2", "velocity_m2ps2", "nees", "nis_per_row"):
            assert np.allclose(getattr(got, name), getattr(expected, name), rtol=AGREEMENT, atol=AGREEMENT_M**2), name
        assert why_diverged(result, reference, recording) == diverged


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
