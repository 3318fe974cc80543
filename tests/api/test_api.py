"""The Python interface, also in plain scripts."""

import inspect
import subprocess
import sys

import pandas as pd
import pytest
from omegaconf import OmegaConf

import jerkbench
from commands import PATIENCE_S, environment
from commands import verb as command_line
from jerkbench.errors import PluginError
from jerkbench.hydra_app.configuration import Schema
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.names import job_of_parts
from jerkbench.jobs.study import load_study
from jerkbench.presets import config_folder, default_names
from jerkbench.report.labels import GROUPS
from made_jobs import job_of_words, with_data

DRIVE = {"name": "rtklib", "folder": "anywhere"}


def by_parts(disturbance=(), noise=None, **single):
    """The cell that Python's arguments make."""
    usual = {"dataset": "field", "attitude": None, "filter": "baseline", "adaptation": "none", "engine": "compiled"}
    return job_of_parts({**usual, **single}, disturbance, noise, Protocol())


def test_its_rows_are_those_of_the_command_line(tmp_path):
    words = [
        "disturbance=[imu_bias,gnss_outage]",
        "disturbance.imu_bias.accel_mps2=0.1",
        "disturbance.gnss_outage.first_s=8",
    ]
    words += ["filter=baseline_untuned", "adaptation=mtf", "attitude=real", "dataset.duration_s=12", "seeds=2"]
    done = command_line("run", "figures=false", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    theirs = load_study(tmp_path / "results" / "adhoc").rows

    ours = jerkbench.run(
        dataset={"name": "field", "duration_s": 12},
        disturbance=[{"name": "imu_bias", "accel_mps2": 0.1}, {"name": "gnss_outage", "first_s": 8}],
        filter="baseline_untuned",
        adaptation="mtf",
        attitude="real",
        seeds=2,
    )

    assert (ours["status"] == "ok").all()
    pd.testing.assert_frame_equal(ours, theirs[ours.columns], check_exact=True, check_dtype=False)


@pytest.mark.parametrize(
    ("words", "arguments"),
    [
        ([], {}),
        (["dataset=rtklib", "dataset.folder=anywhere"], {"dataset": DRIVE}),
        (["dataset=rtklib", "dataset.folder=anywhere", "attitude=none"], {"dataset": DRIVE, "attitude": "none"}),
        (
            ["dataset=field_combined", "disturbance=combined"],
            {"dataset": "field_combined", "disturbance": ["combined"]},
        ),
        (["attitude=real", "attitude.sigma_accel_mps2=0.7"], {"attitude": {"name": "real", "sigma_accel_mps2": 0.7}}),
        (["attitude=gyro_only"], {"attitude": "gyro_only"}),
        (["filter=jerk", "noise=real"], {"filter": "jerk", "noise": "real"}),
        (
            ["filter=jerk", "noise=real", "noise.accel_mps2=0.4"],
            {"filter": "jerk", "noise": {"name": "real", "accel_mps2": 0.4}},
        ),
        (["filter=gnss_only", "noise=tuned"], {"filter": "gnss_only", "noise": "tuned"}),
        (["filter=jerk", "filter.accel_mps2=0.4"], {"filter": {"name": "jerk", "accel_mps2": 0.4}}),
        (["disturbance=[withhold,twelve_outages]"], {"disturbance": ["withhold", "twelve_outages"]}),
        (
            [
                "disturbance=combined",
                "disturbance.imu_bias.accel_mps2=0.5",
                "disturbance.gnss_outage.windows_s=[[3,4]]",
            ],
            {
                "disturbance": [
                    {"name": "combined", "imu_bias": {"accel_mps2": 0.5}, "gnss_outage": {"windows_s": [[3, 4]]}}
                ]
            },
        ),
        (["dataset.ruts=true"], {"dataset": {"name": "field", "ruts": True}}),
    ],
)
def test_the_same_names_are_the_same_cell_as_on_the_command_line(words, arguments):
    theirs, ours = job_of_words(*words), by_parts(**arguments)

    assert ours.labels == theirs.labels
    assert with_data(ours, "data").key == with_data(theirs, "data").key  # of all that the rows depend on


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"filter": "baseline_untund"}, "There is no filter 'baseline_untund'. Did you mean 'baseline_untuned'"),
        ({"attitude": "reel"}, "There is no attitude 'reel'. Did you mean 'real'"),
        ({"filter": {"accel_mps2": 1.0}}, "filter is .*, without the key 'name'"),
        ({"filter": {"name": "baseline_untuned", "acel_mps2": 1.0}}, "parameter of filter baseline 'acel_mps2'"),
        ({"noise": "tund"}, "There is no noise 'tund'. Did you mean 'tuned'"),
        ({"noise": {"acel_mps2": 1.0}}, "There is no parameter of noise 'acel_mps2'. Did you mean 'accel_mps2'"),
        (
            {"disturbance": {"name": "combined", "imu_bia": {}}},
            "in the preset combined 'imu_bia'. Did you mean 'imu_bias'",
        ),
        (
            {"disturbance": {"name": "combined", "imu_bias": 3}},
            "disturbance combined: 'imu_bias' is 3; give its parameters",
        ),
    ],
)
def test_what_is_wrong_is_a_sentence(arguments, said):
    with pytest.raises(PluginError, match=said):
        jerkbench.run(**arguments)


def test_defaults_are_those_of_the_command_line_and_the_attitude_is_what_the_data_set_prefers():
    drive = by_parts(dataset=DRIVE)
    assert (drive.labels.attitude, drive.scenario.attitude.sigma_accel_mps2, drive.scenario.attitude.propagation) == (
        "real",
        0.5,
        "exact",
    )
    assert by_parts(dataset=DRIVE, attitude="tilt").labels.attitude == "tilt"
    assert by_parts().labels.attitude == "field"
    defaults = {name: p.default for name, p in inspect.signature(jerkbench.run).parameters.items()}
    for name in ("seeds", "first_seed", "burn_in_s"):
        assert defaults[name] == getattr(Schema, name) == getattr(Protocol, name)
    entries = OmegaConf.load(config_folder() / "config.yaml").defaults
    chosen = {group: name for entry in entries if entry not in ("_self_", "schema") for group, name in entry.items()}
    assert {name: chosen[name] for name in default_names()} == dict(default_names())
    assert set(default_names()) >= {*GROUPS, "disturbance", "noise"}


SWEEP = """
from jerkbench import api
print("begun", flush=True)
short = {{"name": "field", "duration_s": 12}}
study = api.sweep("study", dataset=short, filter=[{filters}], seeds=1, workers={workers})
print(study.rows["status"].tolist())
"""

FILTER = """
import jerkbench
from dataclasses import dataclass
from jerkbench.filters.kinematic import Jerk

@jerkbench.register("filter", "mine")
@dataclass(frozen=True)
class Mine(Jerk):
    '''A filter of the user's.'''
"""


def script(folder, *parts):
    """Run a script; returns the finished process."""
    (folder / "script.py").write_text("\n".join(parts), encoding="utf-8")
    command = [sys.executable, "script.py"]
    return subprocess.run(
        command, cwd=folder, env=environment(), capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )


@pytest.mark.parametrize(
    ("before", "filters", "workers"),
    [
        ("import filters_of_mine", ("mine", "jerk"), 2),
        pytest.param(FILTER, ("mine", "jerk"), 1, marks=pytest.mark.slow),
    ],
    ids=["a filter of a module beside it", "a filter of its own, in one process"],
)
def test_a_script_without_a_guard_runs_once_and_its_report_is_drawn(tmp_path, before, filters, workers):
    (tmp_path / "filters_of_mine.py").write_text(FILTER, encoding="utf-8")
    done = script(
        tmp_path,
        before,
        SWEEP.format(filters=", ".join(map(repr, filters)), workers=workers),
        "print(api.report(study).is_file())",
    )

    assert (done.returncode, done.stdout.split("\n")) == (0, ["begun", "['ok', 'ok']", "True", ""]), done.stderr
    assert "no figures" not in done.stderr
    assert set(load_study(tmp_path / "study").rows["filter"]) == set(filters)


def test_more_workers_are_refused_for_a_filter_of_the_script_itself(tmp_path):
    done = script(tmp_path, FILTER, SWEEP.format(filters="'mine', 'jerk'", workers=2))

    assert done.returncode == 1
    assert done.stderr.endswith(
        "Mine is defined in the script itself, so other processes cannot import it; give workers=1, or move the "
        "class into a module that the script imports.\n"
    )
    assert not (tmp_path / "study").exists()
