"""Lags put into recordings of which everything is known, and those of the real drive."""

import dataclasses

import numpy as np
import pytest
from given import in_a_hand, kitti
from mistakes import of_imu

from jerkbench.datasets.field import FieldWhite
from jerkbench.datasets.rtklib import RtklibDrive
from jerkbench.inspection.diagnostics import diagnoses
from jerkbench.inspection.facts import findings_text
from jerkbench.inspection.lags import estimated_lags, late_imu
from jerkbench.recording import Imu, Position, Recording, Reference, Velocity


def speed(t):
    return 6.0 + 3.0 * np.sin(0.7 * t)


def moving(t):
    course = 0.8 * np.sin(0.3 * t)
    return speed(t)[:, None] * np.column_stack([np.cos(course), np.sin(course), 0.05 * np.sin(t)])


def driving(velocity_late_s=0.0, imu_late_s=0.0, frame="enu"):
    """A minute on a winding road at changing speed; closed forms for velocity and forward force."""
    t, fine, fix, stamps = (
        np.arange(*one) for one in ((0, 60, 0.005), (-1, 62, 0.005), (0.2, 60, 0.2), (0.5, 59, 0.1))
    )
    path = np.cumsum(moving(fine), axis=0) * 0.005
    enu = np.column_stack([np.interp(fix, fine + 0.0025, path[:, axis]) for axis in range(3)])
    true = stamps - velocity_late_s
    velocity = Velocity(stamps, moving(true), np.tile(0.01 * np.eye(3), (len(stamps), 1, 1)))
    if frame == "speed":
        velocity = Velocity.along_course(stamps, speed(true), 0.1)
    force = np.column_stack([2.1 * np.cos(0.7 * (t - imu_late_s)), 0 * t, 0 * t + 9.81])
    position = Position(fix, enu, np.tile(1e-4 * np.eye(3), (len(fix), 1, 1)))
    reference = Reference(fix, "made", independent=True, enu_m=enu)
    return Recording("road", Imu(t + 0.0025, force, 0 * force), reference, position, velocity)


def by_name(recording):
    return {lag.stream: lag.lag_s for lag in estimated_lags(recording)}


@pytest.mark.parametrize(("velocity_s", "imu_s"), [(0.0, 0.0), (0.125, 0.2), (-0.08, -0.31)])
def test_lags_that_were_put_in_are_found(velocity_s, imu_s):
    found = by_name(driving(velocity_s, imu_s))
    assert found == pytest.approx(
        {"velocity, horizontal": velocity_s, "velocity, up": velocity_s, "imu": imu_s}, abs=0.01
    )


def test_a_speed_has_a_lag_too():
    assert by_name(driving(0.1, 0.05, frame="speed")) == pytest.approx({"speed": 0.1, "imu": 0.05}, abs=0.012)


def test_what_cannot_be_told_is_not_a_number():
    recording = driving()
    imu = recording.imu
    resting = dataclasses.replace(recording, imu=Imu(imu.t_s, 0 * imu.accel_mps2, 0 * imu.gyro_radps))
    assert np.isnan(by_name(resting)["imu"])
    assert set(by_name(dataclasses.replace(recording, position=None))) == {"imu"}
    nothing = dataclasses.replace(
        recording, position=None, velocity=None, reference=Reference(np.array([0.0]), "none", independent=False)
    )
    assert estimated_lags(nothing) == []


@pytest.mark.parametrize("late_s", [0.9, -1.7, 2.6])
def test_a_clock_that_is_off_by_seconds_is_found(late_s):
    assert by_name(driving(velocity_late_s=late_s))["velocity, horizontal"] == pytest.approx(late_s, abs=0.01)
    assert by_name(driving(imu_late_s=late_s))["imu"] == pytest.approx(late_s, abs=0.02)


def test_a_lag_beyond_those_that_are_tried_is_said_to_be_at_the_edge():
    recording = driving(velocity_late_s=3.3)
    lag = estimated_lags(recording)[0]
    assert np.isnan(lag.lag_s)
    assert lag.edge_s == pytest.approx(3.0)
    assert "+3.00 s, the limit of the search" in findings_text(recording)


@pytest.mark.parametrize("known", ["velocity", "places", "fixes"])
def test_without_a_velocity_the_reference_or_the_fixes_tell_the_imus_lag(known):
    recording = driving(imu_late_s=1.1)
    t_s = np.arange(0.5, 59, 0.05)
    if known == "velocity":
        reference = Reference(t_s, "made", independent=True, velocity_mps=moving(t_s))
    else:
        reference = recording.reference
    changed = dataclasses.replace(recording, velocity=None, reference=reference)
    if known == "fixes":
        nothing = Reference(np.array([0.0]), "none", independent=False)
        changed = dataclasses.replace(changed, reference=nothing)
    assert by_name(changed) == pytest.approx({"imu": 1.1}, abs=0.02)


def test_fixes_late_against_a_reference_of_its_own_are_found():
    recording = driving()
    late = dataclasses.replace(recording.position, t_s=recording.position.t_s + 0.44)
    assert by_name(dataclasses.replace(recording, position=late, velocity=None))["position"] == pytest.approx(
        0.44, abs=0.01
    )


def test_the_latencies_of_the_real_drive_are_found(shared_folder):
    """Its data set corrects them; read without, they are there: .125 s, .275 s and .20 s."""
    folder = str(shared_folder / "data" / "rtklib_drive_0708")
    raw = by_name(RtklibDrive(folder, imu_shift_s=0.0, velocity_latency_s=(0.0, 0.0, 0.0)).load(0))
    assert raw == pytest.approx({"velocity, horizontal": 0.125, "velocity, up": 0.275, "imu": 0.20}, abs=0.01)
    corrected = by_name(RtklibDrive(folder).load(0))
    assert corrected == pytest.approx(dict.fromkeys(raw, 0.0), abs=0.01)


def test_how_well_a_lag_is_known_grows_with_the_noise():
    """Forces with noise of their own: the lag stays, and the interval about it covers the true one."""
    recording = driving(0.0, 0.2)
    imu, draw = recording.imu, np.random.default_rng(1)
    widths = []
    for sigma in (0.0, 1.0):
        noisy = imu.accel_mps2 + sigma * draw.normal(size=imu.accel_mps2.shape)
        lag = estimated_lags(dataclasses.replace(recording, imu=Imu(imu.t_s, noisy, imu.gyro_radps)))[-1]
        assert abs(lag.lag_s - 0.2) < lag.within_s
        widths.append(lag.within_s)
    assert widths[0] < widths[1] < 0.1


def test_a_lag_that_fits_many_is_none():
    """As comma2k19's: the wheel's stamps jitter, and a correlation of 0.8 stays over half a second."""
    recording = driving(0.0, 0.0, frame="speed")
    velocity, draw = recording.velocity, np.random.default_rng(0)
    few = slice(0, 120)
    jittered = velocity.mps[few] + 0.35 * draw.normal(size=(120, 1))
    short = Velocity(velocity.t_s[few], jittered, velocity.covariance_m2ps2[few], "speed")
    lag = estimated_lags(dataclasses.replace(recording, velocity=short))[-1]
    assert np.isnan(lag.lag_s)
    assert lag.within_s > 0.1
    text = findings_text(dataclasses.replace(recording, velocity=short))
    assert f"best {lag.best_s:+.2f} s" in text
    assert "to imu_shift_s" not in text  # no advice inside the interval


@pytest.mark.parametrize("late_s", [-0.45, 0.0, 0.3, 0.41, 0.45, 1.03])
def test_the_turning_tells_the_imus_lag_finer_than_the_fixes_step(late_s):
    """Fixes every .2 s of the simulated field; the lag was put in."""
    recording = FieldWhite().load(0)
    imu = recording.imu
    late = dataclasses.replace(recording, imu=Imu(imu.t_s + late_s, imu.accel_mps2, imu.gyro_radps))
    lag = late_imu(late)
    assert lag.lag_s == pytest.approx(late_s, abs=0.015)
    assert lag.within_s < 0.1
    assert ("imu_shift_s" in findings_text(late)) == (late_s != 0.0)
    told = [one.remedy for one in diagnoses(late)]
    assert told == ([f"Add {-lag.lag_s:+.2f} to imu_shift_s"] if abs(late_s) >= 0.4 else [])


SLALOM = tuple((float(k), 0.2 * (-1) ** k) for k in range(80))


@pytest.mark.parametrize("waypoints_m", [None, SLALOM])
@pytest.mark.parametrize("lead_s", [0.6, -0.6])
def test_a_hand_that_turns_before_its_walker_has_no_late_stamps_and_no_mirror(lead_s, waypoints_m):
    recording = in_a_hand(lead_s, waypoints_m)
    assert diagnoses(recording) == []
    assert late_imu(recording).lag_s == pytest.approx(-lead_s, abs=0.1)
    assert "not certain: either the stamps are wrong, or the sensor turns before or after it moves" in findings_text(
        recording
    )


@pytest.mark.parametrize("late_s", [-1.0, 1.0])
def test_late_stamps_are_sure_without_a_wheel_and_an_attitude_where_the_forces_are_late_too(late_s):
    """The course of a vehicle alone could be that of a hand."""
    field = FieldWhite().load(0)
    imu = Imu(field.imu.t_s + late_s, field.imu.accel_mps2, field.imu.gyro_radps)
    reference = dataclasses.replace(field.reference, euler_rad=None)
    recording = dataclasses.replace(field, imu=imu, reference=reference, heading=None)
    (diagnosis,) = diagnoses(recording)
    assert diagnosis.name == "clock of imu"
    assert late_imu(recording).lag_s == pytest.approx(late_s, abs=0.1)


@pytest.fixture(scope="module")
def car(shared_folder):
    """A drive of KITTI with white fixes at 1 Hz, with its attitude or without, its IMU so much later."""
    folder = shared_folder / "data"
    if not (folder / "kitti").exists():
        pytest.skip("kitti is not in ../shared/data")

    def late(late_s, *, attitude=True):
        drive = kitti(folder, "2011_09_30_drive_0018", attitude=attitude)
        return of_imu(drive, late_s=late_s)

    return late


@pytest.mark.parametrize("late_s", [0.0, 0.45])
def test_the_interval_has_room_for_the_filter_of_a_sensor(car, late_s):
    """OXTS' rates are .050 s behind its own attitude in all drives (phases from .2 to 3 Hz); its forces are not."""
    lag, as_it_is = late_imu(car(late_s)), late_imu(car(0.0))
    assert abs(lag.lag_s - late_s) <= lag.within_s < 0.1
    assert lag.lag_s - as_it_is.lag_s == pytest.approx(late_s, abs=0.005)
    assert as_it_is.lag_s == pytest.approx(0.050, abs=0.005)
    assert "to correct it" not in findings_text(car(0.0))
