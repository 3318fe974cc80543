"""The doctor: mistakes made in recordings are found, and none where there is none."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from mistakes import MISTAKES, OTHERS, in_axes, is_found, ned, of_imu, of_sigmas

from jerkbench.datasets.field_v1 import FieldV1
from jerkbench.inspection.diagnosis.doctor import diagnoses, first_diagnoses
from jerkbench.inspection.diagnosis.plane import IDENTITY, PLANE
from jerkbench.inspection.remarks import findings_text
from jerkbench.io.frames import axes_matrix
from jerkbench.recording import Imu, Position, Recording, Reference
from jerkbench.verbs.source import dataset_of

CLOCK = "IMU's clock off by 1 s"


@pytest.fixture(scope="module")
def field():
    return FieldV1().load(0)


def found_in(recording, mistake):
    judge = diagnoses if mistake == CLOCK else first_diagnoses
    return is_found(mistake, judge({**MISTAKES, **OTHERS}[mistake](recording)))


@pytest.mark.parametrize("mistake", [*MISTAKES, *OTHERS])
def test_each_mistake_is_found_in_the_field(field, mistake):
    assert found_in(field, mistake)


@pytest.mark.parametrize("seed", [0, 1])
def test_none_is_found_where_there_is_none(seed):
    assert diagnoses(FieldV1().load(seed)) == []


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
    assert "Scale them by 10" in diagnosis.remedy or "Scale them by 11" in diagnosis.remedy


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
    path = shared_folder / "data" / "kitti" / "2011_09_30_drive_0018.parquet"
    if not path.exists():
        pytest.skip("the drive is not in ../shared/data")
    rows = pd.read_parquet(path).astype(float)
    rows = rows[rows.t - rows.t.iloc[0] < until_s]
    t_s, enu = (rows.t - rows.t.iloc[0]).to_numpy(), rows[["e", "n", "u"]].to_numpy()
    flip = np.array([1.0, -1.0, -1.0])
    imu = Imu(t_s, rows[["ax", "ay", "az"]].to_numpy() * flip, rows[["gx", "gy", "gz"]].to_numpy() * flip)
    fix = np.arange(50, len(rows), 100)
    noise = np.random.default_rng(0).normal(0.0, [0.3, 0.3, 0.6], (len(fix), 3))
    position = Position(t_s[fix], enu[fix] + noise, np.tile(np.diag([0.09, 0.09, 0.36]), (len(fix), 1, 1)))
    euler = rows[["roll", "pitch", "yaw"]].to_numpy()
    recording = Recording("kitti", imu, Reference(t_s, "RTK", independent=True, euler_rad=euler), position)
    (diagnosis,) = diagnoses(recording)
    assert diagnosis.name == "IMU not upright"
    assert "imu_axes=[x,-y,-z]" in diagnosis.remedy
    assert diagnoses(in_axes(recording, FRD)) == []


def test_a_sensor_in_a_hand_may_lie_on_any_side(field):
    assert diagnoses(replace(in_axes(field, FRD), position=None, velocity=None)) == []


LOADED = {
    "drive": ("rtklib_drive_0708", None),
    "comma2k19": ("comma2k19", None),
    "xsens": ("robot_localization/xsens.bag", "xsens_bag"),
    "husky": ("robot_localization/test1.bag", "husky_bag"),
    "zurich_mav": ("degraded/zurich_mav_1", None),
    "broad": ("broad", None),
    "tokyo_1105": ("degraded/tokyo_1105", None),
    "hamburg": ("degraded/hamburg", "hamburg"),
    "beijing_car": ("degraded/beijing_car", None),
    "pixel4": ("degraded/pixel4", None),
}

SD = "sd of the fixes 10 times too small"

NOT_FOUND = {
    "drive": set(),
    "comma2k19": set(),
    "xsens": {SD},
    "husky": {SD},
    "zurich_mav": {CLOCK, "IMU turned by 90 degrees", "IMU turned by 180 degrees"},
}
"""Of the ten, with why: xsens and husky state placeholders, 10 to 100 times too large, and have no reference; a
quadrotor feels no force of its own acceleration, and flies sideways, so that its course says nothing of its IMU."""


def test_at_least_45_of_50_are_found():
    assert sum(len(MISTAKES) - len(missed) for missed in NOT_FOUND.values()) >= 45


@pytest.fixture(scope="module")
def real(shared_folder):
    """Loads a recording of those that may not be here, once."""
    loaded = {}

    def load(name):
        path, dataset = LOADED[name]
        if not (shared_folder / "data" / path).exists():
            pytest.skip(f"{path} is not in ../shared/data")
        if name not in loaded:
            loaded[name] = dataset_of(str(shared_folder / "data" / path), dataset, []).load(0)
        return loaded[name]

    return load


@pytest.mark.parametrize("name", LOADED)
def test_nothing_is_found_in_real_recordings_as_they_are(real, name):
    assert diagnoses(real(name)) == []


@pytest.mark.parametrize("name", NOT_FOUND)
def test_mistakes_in_real_recordings_are_found(real, name):
    recording = real(name)
    assert {mistake for mistake in MISTAKES if not found_in(recording, mistake)} == NOT_FOUND[name]
