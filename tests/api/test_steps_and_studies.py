"""The Python API: its steps are those of a run, its studies those of the command line."""

import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from commands import environment, swept
from jerkbench import api
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.disturbances.imu import ImuBias
from jerkbench.errors import JerkbenchError
from jerkbench.filters.kinematic import Jerk
from jerkbench.jobs.study import Study, load_study

ROOT = Path(__file__).parents[2]
SHORT = {"name": "field", "duration_s": 12}
FAULTS = [{"name": "imu_bias", "accel_mps2": 0.1}, {"name": "gnss_outage", "first_s": 8}]


def test_step_by_step_gives_the_row_of_a_run():
    row = api.run(
        dataset=SHORT, disturbance=FAULTS, filter="jerk", adaptation="mtf", noise="real", first_seed=3, seeds=1
    )
    recording = api.disturb(api.load(SHORT, seed=3), FAULTS, seed=3)
    estimate = api.estimate(recording, filter="jerk", adaptation="mtf", noise="real")
    values = api.evaluate(estimate, recording)

    assert set(values) <= set(row.columns)
    for name, value in values.items():
        assert row.loc[0, name] == pytest.approx(value, rel=1e-9, nan_ok=True), name


def test_a_plugin_itself_stands_for_its_name():
    recording = api.load(SHORT)
    by_name = api.estimate(api.disturb(recording, FAULTS[0]), filter={"name": "jerk", "accel_mps2": 0.3})
    itself = api.estimate(api.disturb(recording, ImuBias(accel_mps2=0.1)), filter=Jerk(accel_mps2=0.3))

    np.testing.assert_array_equal(itself.position_m, by_name.position_m)
    rows = api.run(dataset=SHORT, filter=Jerk(accel_mps2=0.3), seeds=1)
    assert rows.loc[0, "filter"] == "jerk(accel_mps2=0.3)"


@dataclass(frozen=True)
class Nameless(NoAdaptation):
    """An adaptation that nobody has registered."""


@pytest.mark.slow
def test_one_that_is_not_registered_can_be_run_and_not_stored(tmp_path):
    recording = api.load(SHORT)
    ours, theirs = (api.estimate(recording, adaptation=part) for part in (Nameless(), "none"))

    np.testing.assert_array_equal(ours.position_m, theirs.position_m)
    with pytest.raises(JerkbenchError, match=r"Nameless is not registered; write @jerkbench.register"):
        api.sweep(tmp_path, dataset=SHORT, adaptation=Nameless())


@pytest.mark.slow
def test_a_study_is_that_of_the_command_line(tmp_path):
    study = api.sweep(
        tmp_path / "ours",
        dataset=SHORT,
        disturbance=["none", ["bias", "gnss_outage"]],
        filter=["gnss_only", "jerk"],
        adaptation=["none", "mtf"],
        seeds=1,
    )
    swept("filter=gnss_only,jerk", "adaptation=none,mtf", "disturbance=none,[imu_bias,gnss_outage]", cwd=tmp_path)
    theirs = load_study(tmp_path / "results" / "adhoc").rows
    order = ["disturbance", "filter", "adaptation"]

    pd.testing.assert_frame_equal(
        study.rows.sort_values(order, ignore_index=True),
        theirs[study.rows.columns].sort_values(order, ignore_index=True),
    )
    assert len(study.rows) == 6  # gnss_only takes no mtf
    assert (tmp_path / "ours" / "table.md").is_file()


def test_a_table_is_markdown_as_text_and_html_in_a_notebook(tmp_path):
    api.sweep(tmp_path, dataset=SHORT, filter=["baseline", "jerk"], adaptation=["none", "mtf"], seeds=2)
    table = api.table(tmp_path, metric="velocity_rmse_mps", baseline="adaptation=none")

    assert str(table).startswith("## Velocity RMSE (3-D) [m/s]\n\n| filter ")
    assert table._repr_html_().startswith("<section")
    assert table.to_latex().startswith(r"% \usepackage{booktabs,siunitx}")
    assert "Position RMSE" in Study.open(tmp_path)._repr_html_()
    assert repr(Study.open(tmp_path)) == f"Study({str(tmp_path)!r}, 4 combinations, 8 runs, 0 diverged or failed)"
    assert api.report(tmp_path, scenarios=0) == tmp_path / "report.html"


def test_a_recording_and_an_estimate_are_one_line_as_text():
    recording = api.load(SHORT)
    estimate = api.estimate(recording, filter="gnss_only")
    imu, fixes, stamps = (len(of.t_s) for of in (recording.imu, recording.position, recording.reference))
    assert repr(recording).startswith(f"Recording({recording.name!r}, 12.00 s: imu {imu}, position {fixes}, ")
    assert repr(recording).endswith(f", reference {stamps})")
    assert repr(estimate) == f"Estimate({len(estimate.index)} estimates, {len(estimate.updates.t_s)} updates)"
    stopped = repr(replace(estimate, failure="the covariance\nis no number"))
    assert stopped.endswith(" updates, stopped early: the covariance is no number)")
    estimate = api.estimate(recording, filter="jerk")
    frame = estimate.to_frame(recording.reference.t_s)
    assert list(frame.index) == list(estimate.index)
    assert list(frame.columns) == [
        *("t_s", "east_m", "north_m", "up_m", "velocity_east_mps", "velocity_north_mps", "velocity_up_mps"),
        *("sigma_east_m", "sigma_north_m", "sigma_up_m"),
        *("sigma_velocity_east_mps", "sigma_velocity_north_mps", "sigma_velocity_up_mps"),
        *("roll_rad", "pitch_rad", "yaw_rad"),
    ]
    assert frame["t_s"].iloc[-1] == recording.reference.t_s[estimate.index[-1]]
    assert frame["up_m"].iloc[7] == estimate.position_m[7, 2]
    assert frame["sigma_velocity_up_mps"].iloc[7] ** 2 == pytest.approx(estimate.covariance[7, 5, 5])
    assert "t_s" not in estimate.to_frame()


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: api.load("feld"), "Did you mean 'field'"),
        (lambda: api.disturb(api.load(SHORT), "imu_bia"), "Did you mean 'imu_bias'"),
        (lambda: api.figure(api.load(SHORT), {}, "error"), "Did you mean 'errors'"),
        (lambda: api.estimate(api.load(SHORT), noise="tund"), "Did you mean 'tuned'"),
    ],
)
def test_what_is_wrong_with_a_step_is_a_sentence(call, sentence):
    with pytest.raises(JerkbenchError, match=sentence):
        call()


@pytest.mark.slow
def test_the_first_quarter_of_an_hour(tmp_path):
    command = [sys.executable, str(ROOT / "examples" / "first_quarter_hour.py"), "mine"]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=300, check=False
    )

    assert done.returncode == 0, done.stderr
    assert (tmp_path / "mine" / "errors.png").stat().st_size > 10_000
    assert "wearing_off(tau_s=10.0)" in done.stdout
    rows = load_study(tmp_path / "mine" / "study").rows
    assert set(rows["status"]) == {"ok"}
    assert len(rows) == 2 * (1 + 2 + 2)


def test_a_damaged_file_is_set_aside_and_its_cells_run_again(tmp_path, capsys):
    first = api.sweep(tmp_path, filter="gnss_only", seeds=2)
    for part in (tmp_path / "cells").glob("part-*"):
        part.write_bytes(part.read_bytes()[:-40])

    again = api.sweep(tmp_path, filter="gnss_only", seeds=2)

    assert not again.damaged
    assert len(again.rows) == len(first.rows) == 2
    assert "damaged file of results is renamed" in capsys.readouterr().err
