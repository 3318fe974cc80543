"""What stands under the table about a recording."""

from dataclasses import replace

from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.rows import notes_of
from jerkbench.recording import Imu


def told(without_s):
    """The notes on a simulated drive whose IMU is silent from 3 s on for ``without_s``."""
    names = {"attitude": "tilt", "filter": "baseline", "adaptation": "none", "engine": "compiled"}
    parts = {part: {"name": name} for part, name in names.items()}
    cell = build({"dataset": {"name": "field", "duration_s": 8.0}, "disturbance": [], **parts}, Protocol(seeds=1))
    recording = cell.scenario.dataset.load(0)
    imu = recording.imu
    kept = (imu.t_s <= 3.0) | (imu.t_s > 3.0 + without_s)
    silent = replace(recording, imu=Imu(imu.t_s[kept], imu.accel_mps2[kept], imu.gyro_radps[kept]))
    return [note for note in notes_of(cell, silent) if "gap" in note]


def test_gaps_of_the_imu_are_told_and_a_few_lost_samples_are_not():
    (note,) = told(1.5)

    assert "the IMU has 1 gap of up to 1.51 s" in note
    assert told(0.1) == []
