"""What stands under the table about a recording."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

from jerkbench.datasets.field import Field
from jerkbench.filters.gnss_only import GnssOnly
from jerkbench.filters.kinematic import Jerk
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.rows import Task, job_rows, notes_of, task_rows
from jerkbench.recording import Imu
from made_jobs import with_method, with_scenario


def cell_of():
    names = {"attitude": "tilt", "filter": "baseline", "adaptation": "none", "engine": "compiled"}
    parts = {part: {"name": name} for part, name in names.items()}
    return build({"dataset": {"name": "field", "duration_s": 8.0}, "disturbance": [], **parts}, Protocol(seeds=2))


def told(without_s):
    """The notes on a simulated drive whose IMU is silent from 3 s on for ``without_s``."""
    cell = cell_of()
    recording = cell.scenario.dataset.load(0)
    imu = recording.imu
    kept = (imu.t_s <= 3.0) | (imu.t_s > 3.0 + without_s)
    silent = replace(recording, imu=Imu(imu.t_s[kept], imu.accel_mps2[kept], imu.gyro_radps[kept]))
    return [note for note in notes_of(cell, silent) if "gap" in note]


def test_gaps_of_the_imu_are_told_and_a_few_lost_samples_are_not():
    (note,) = told(1.5)

    assert "the IMU has 1 gap of up to 1.51 s" in note
    assert told(0.1) == []


@dataclass(frozen=True)
class Telling(Field):
    def load(self, seed):
        return replace(super().load(seed), notes=(f"seed {seed}",))


@dataclass(frozen=True)
class Talking(Jerk):
    def remarks(self, recording):
        return (f"sigma is {self.accel_mps2}",)


def test_settings_that_run_side_by_side_have_the_notes_that_each_has_alone():
    job = with_scenario(cell_of(), dataset=Telling(duration_s=8.0))
    for model in (Jerk, Talking):
        cells = tuple(with_method(job, filter=model(accel_mps2=sigma)) for sigma in (0.2, 0.4))
        notes = [of_job for _, of_job in task_rows(Task(cells, (0, 1)))]
        for own, cell in zip(notes, cells, strict=True):
            each = [note for seed in (0, 1) for note in notes_of(cell, cell.scenario.dataset.load(seed))]
            assert own == list(dict.fromkeys(each))
            assert {f"field: seed {seed}" for seed in (0, 1)} <= {*own}
    assert [[note for note in own if "sigma" in note] for own in notes] == [["sigma is 0.2"], ["sigma is 0.4"]]


@dataclass(frozen=True)
class Indefinite:
    """An estimator whose error is finite, with this variance on the diagonal of its covariance."""

    variance: float = -1.0
    adaptations: ClassVar[tuple[str, ...]] = ("none",)

    def estimate(self, recording, attitude, adaptation):
        estimate = GnssOnly().estimate(recording, attitude, adaptation)
        return replace(estimate, covariance=np.tile(self.variance * np.eye(6), (len(estimate.index), 1, 1)))


@pytest.mark.parametrize(("variance", "noted"), [(-1.0, True), (0.0, True), (np.nan, False), (1.0, False)])
def test_a_covariance_that_is_not_positive_definite_is_noted(variance, noted):
    job = with_method(cell_of(), filter=Indefinite(variance))
    (row,), notes = job_rows(replace(job, draws=[0]))

    assert row["status"] == "ok"
    assert any("Its covariance is not always positive definite" in note for note in notes) == noted
    assert np.isfinite(row["position_rmse_m"])
