"""Nobody gets a yaw that nothing measured without being told."""

from dataclasses import replace

import numpy as np
import pytest

from jerkbench.attitude.gyro_only import GyroOnly
from jerkbench.attitude.tilt import Tilt
from jerkbench.contracts import Remarking
from jerkbench.datasets.field import FieldWhite
from jerkbench.inspection.facts import yaw_line
from jerkbench.recording import Heading, Position
from synthetic import recording_at_rest


def driven(speed_mps, sigma_m):
    """Straight on for two minutes, one fix a second and nothing else."""
    rest = recording_at_rest(duration_s=120.0, imu_rate_hz=20, velocity=None)
    t_s = np.arange(1.0, 120.0)
    enu_m = np.column_stack([speed_mps * t_s, 0.0 * t_s, 0.0 * t_s])
    return replace(rest, position=Position(t_s, enu_m, np.tile(sigma_m**2 * np.eye(3), (len(t_s), 1, 1))))


@pytest.mark.parametrize("attitude", [Tilt(), GyroOnly(), Tilt(yaw_source="track")])
@pytest.mark.parametrize(
    ("speed_mps", "sigma_m", "remark"),
    [
        (0.0, 1.0, "nothing shows yaw"),
        (0.3, 2.0, "nothing shows yaw"),
        (1.4, 3.0, "hardly observable"),
        (10.0, 0.4, "track of the fixes"),
    ],
)
def test_what_is_not_measured_is_said(attitude, speed_mps, sigma_m, remark):
    recording = driven(speed_mps, sigma_m)

    assert isinstance(attitude, Remarking)
    assert remark in yaw_line(recording)
    if attitude == Tilt(yaw_source="track") and remark == "nothing shows yaw":
        return  # asked for, it is an error
    (sentence,) = attitude.remarks(recording)
    assert remark in sentence


def test_what_is_measured_or_asked_for_is_not_remarked_on():
    field, rest = FieldWhite(duration_s=10.0).load(0), driven(0.0, 1.0)

    for recording in (field, replace(field, heading=None), replace(field, position=None, heading=None, velocity=None)):
        assert Tilt().remarks(recording) == ()
    assert Tilt(yaw_source="gyro_only").remarks(rest) == ()
    assert "headings of source dual_antenna" in yaw_line(field)
    assert "course of" in yaw_line(replace(field, heading=None))
    headed = replace(rest, heading=Heading([1.0], [0.5], [0.1]))
    assert Tilt().remarks(headed) == ()
