"""The doctor: mistakes made in recordings are found, and none where there is none."""

from dataclasses import replace

import numpy as np
import pytest
from given import kitti
from mistakes import G_MPS2, MISTAKES, OTHERS, in_axes, is_found, ned, of_imu, of_sigmas

from jerkbench.datasets.field import FieldWhite
from jerkbench.inspection.diagnostics import IDENTITY, PLANE, diagnoses, first_diagnoses
from jerkbench.inspection.facts import findings_text
from jerkbench.io.conversions import axes_matrix

CLOCK = "IMU's clock off by 1 s"


@pytest.fixture(scope="module")
def field():
    return FieldWhite().load(0)


def found_in(recording, mistake):
    judge = diagnoses if mistake == CLOCK else first_diagnoses
    return is_found(mistake, judge({**MISTAKES, **OTHERS}[mistake](recording)))


@pytest.mark.parametrize("mistake", [*MISTAKES, *OTHERS])
def test_each_mistake_is_found_in_the_field(field, mistake):
    assert found_in(field, mistake)


@pytest.mark.parametrize("seed", [0, 1])
def test_none_is_found_where_there_is_none(seed):
    assert diagnoses(FieldWhite().load(seed)) == []


def test_a_remedy_mends(field):
    turned = MISTAKES["IMU turned by 90 degrees"](field)
    (diagnosis,) = [one for one in first_diagnoses(turned) if "about z" in one.name]
    assert "[y,-x,z]" in diagnosis.remedy
    axes = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # x is what was y, y is what was -x
    mended = of_imu(turned, lambda w: w @ axes.T, lambda f: f @ axes.T)
    assert np.allclose(mended.imu.accel_mps2, field.imu.accel_mps2)


@pytest.mark.parametrize("way", [way for way in PLANE if way != IDENTITY])
def test_no_axes_are_advised_that_the_reader_refuses(field, way):
    given = np.eye(3)
    given[:2, :2] = np.array(PLANE[way]).T
    (diagnosis,) = [one for one in first_diagnoses(in_axes(field, given)) if one.name.startswith("IMU")]
    if np.linalg.det(given) < 0:
        assert diagnosis.name == "IMU mirrored"
        assert "imu_axes=" not in diagnosis.remedy
    else:
        np.testing.assert_array_equal(advised_axes(diagnosis), given.T)


def test_mirrored_axes_without_a_track_are_mended_in_the_columns(field):
    mirrored = replace(MISTAKES["IMU mirrored"](field), velocity=None, position=None)
    (diagnosis,) = [one for one in first_diagnoses(mirrored) if one.name == "IMU mirrored"]
    assert "columns" in diagnosis.remedy


def test_the_factor_of_sigmas_is_told(field):
    (diagnosis,) = first_diagnoses(of_sigmas(field, 0.1))
    assert "Multiply them by 10" in diagnosis.remedy or "Multiply them by 11" in diagnosis.remedy


@pytest.mark.parametrize("rms", [0.1, 1.0])
def test_a_force_without_gravity_is_not_taken_for_a_force_in_g(field, rms):
    """With an rms of 1 m/s2, the median norm is that of gravity in g."""
    calm = of_imu(field, accel=lambda f: (f - f.mean(axis=0)) / np.std(f - f.mean(axis=0)) * rms / np.sqrt(3.0))
    assert "accelerometer without gravity" in [one.name for one in first_diagnoses(calm)]
    assert "accelerometer in g" not in [one.name for one in first_diagnoses(calm)]


def test_vibration_and_rows_of_zeros_do_not_hide_gravity(field):
    shaken = of_imu(field, accel=lambda f: f / G_MPS2 + np.random.default_rng(0).normal(0.0, 0.5, f.shape))
    lost = of_imu(field, accel=lambda f: np.where(np.arange(len(f))[:, None] % 12 == 0, 0.0, f) / G_MPS2)
    for one in (shaken, lost):
        names = [found.name for found in first_diagnoses(one)]
        assert "accelerometer in g" in names
        assert "accelerometer without gravity" not in names


def test_a_gyro_whose_z_is_reversed(field):
    reversed_z = of_imu(field, gyro=lambda w: w * np.array([1.0, 1.0, -1.0]))
    assert "gyro z reversed" in [one.name for one in first_diagnoses(reversed_z)]


def test_the_mistake_stands_among_the_findings(field):
    text = findings_text(MISTAKES["accelerometer in g"](field))
    assert "mistake: The accelerometer is in g" in text
    assert "accel_unit=g" in text


FRD = [[1, 0, 0], [0, -1, 0], [0, 0, -1]]


def advised_axes(diagnosis):
    return axes_matrix(tuple(diagnosis.remedy.split("imu_axes=[")[1].split("]")[0].split(",")))


@pytest.mark.parametrize("late_s", [0.0, 1.0])
@pytest.mark.parametrize("axes", [FRD, [[0, 0, 1], [1, 0, 0], [0, 1, 0]]])
def test_gravity_is_asked_before_all_else(field, axes, late_s):
    (diagnosis,) = diagnoses(of_imu(in_axes(field, axes), late_s=late_s))
    assert diagnosis.name == "IMU not upright"
    mended = in_axes(in_axes(field, axes), advised_axes(diagnosis))
    assert np.median(mended.imu.accel_mps2[:, 2]) == pytest.approx(9.81, abs=0.1)


def test_a_log_in_frd_and_ned_is_mended_in_two_steps(field):
    both = in_axes(ned(field), FRD)
    first = first_diagnoses(both)[0]
    assert first.name == "IMU not upright"
    assert not any("mirrored" in one.name for one in first_diagnoses(both))
    assert first_diagnoses(in_axes(both, advised_axes(first)))[0].name == "track mirrored"


def test_an_accelerometer_that_feels_all_forces_the_other_way(field):
    (diagnosis,) = first_diagnoses(of_imu(field, accel=lambda f: -f))
    assert diagnosis.name == "accelerometer reversed"


@pytest.mark.parametrize("until_s", [20.0, 60.0, 1000.0])
def test_a_cars_frd_imu_left_as_flu_is_not_called_a_mirrored_track(shared_folder, until_s):
    """With white fixes at 1 Hz and its attitude; also a drive so short that nothing else is sure."""
    if not (shared_folder / "data" / "kitti").exists():
        pytest.skip("kitti is not in ../shared/data")
    recording = in_axes(kitti(shared_folder / "data", "2011_09_30_drive_0018", until_s), FRD)
    (diagnosis,) = diagnoses(recording)
    assert diagnosis.name == "IMU not upright"
    assert "imu_axes=[x,-y,-z]" in diagnosis.remedy
    assert diagnoses(in_axes(recording, FRD)) == []


def test_a_sensor_in_a_hand_may_lie_on_any_side(field):
    assert diagnoses(replace(in_axes(field, FRD), position=None, velocity=None)) == []


def test_increments_are_told_and_nothing_else_of_the_units(field):
    step_s = field.imu.nominal_interval_s
    summed = of_imu(field, lambda w: w * step_s, lambda f: f * step_s)
    names = [one.name for one in first_diagnoses(summed)]
    assert "increments instead of rates" in names
    assert not any("gyro" in name or "accelerometer" in name for name in names)


def test_a_velocity_of_the_world_that_is_taken_for_the_bodys(field):
    world = replace(field, velocity=replace(field.velocity, frame="body"))
    assert "velocity in the world frame" in [one.name for one in first_diagnoses(world)]
    assert "velocity_frame=enu" in findings_text(world)


def test_late_fixes_are_blamed_and_not_the_sensors_that_agree():
    drive = FieldWhite(duration_s=200.0).load(0)
    late = replace(drive, position=replace(drive.position, t_s=drive.position.t_s + 0.6))
    clocks = [one for one in diagnoses(late) if one.name.startswith("clock")]
    assert [one.name for one in clocks] == ["clock of position"]
    assert "position_latency_s=0.6" in clocks[0].remedy


def turned_heading(recording, convention):
    return replace(recording, heading=replace(recording.heading, yaw_rad=convention(recording.heading.yaw_rad)))


@pytest.mark.parametrize(
    ("convention", "name", "told"),
    [
        (lambda yaw: yaw - np.pi / 2, "heading rotated", "0 in the north instead of the east"),
        (lambda yaw: yaw + np.pi, "heading rotated", "180 deg"),
        (lambda yaw: np.pi / 2 - yaw, "heading clockwise", "is 90 deg"),
    ],
)
def test_a_heading_of_another_convention_is_told_by_the_course(field, convention, name, told):
    (found,) = [one for one in first_diagnoses(turned_heading(field, convention)) if one.name.startswith("heading")]
    assert (found.name, told in found.measured) == (name, True), found.measured
    assert not [one for one in first_diagnoses(field) if one.name.startswith("heading")]


def test_stamps_of_arrival_in_bunches_are_told_with_the_rate_of_the_sensor(field):
    t_s = field.imu.t_s
    bunch = np.arange(len(t_s)) // 5
    arrived = t_s[np.minimum(5 * bunch + 4, len(t_s) - 1)] + 1e-4 * (np.arange(len(t_s)) % 5)
    bunched = replace(field, imu=replace(field.imu, t_s=arrived))
    (found,) = [one for one in first_diagnoses(bunched) if one.name == "stamps in bunches"]
    assert "about 5 stamps at once" in found.measured
    assert "at 100 Hz" in found.remedy
