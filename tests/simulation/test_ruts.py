import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from jerkbench.datasets.field import FieldRuts, FieldWhite
from jerkbench.simulation.truth import drive_course

RUTS = FieldRuts()._ruts()
T = np.arange(15001) / 100


def test_speed_dips_and_distance_is_still_its_integral():
    course = drive_course(T, FieldWhite()._path(), RUTS)
    assert course.speed_mps[4500] == pytest.approx(1.2, abs=1e-6)
    fine = np.arange(60001) / 1000
    speed = drive_course(fine, FieldWhite()._path(), RUTS).speed_mps
    driven = cumulative_simpson(speed, x=fine, initial=0)[::10]
    np.testing.assert_allclose(course.distance_m[:6001], driven, atol=1e-8)


def test_each_rut_lowers_the_robot_by_its_depth_and_tips_it():
    smooth = {"roughness": 0.0, "hill_height_m": 0.0, "vibration_mps2": 0.0, "vibration_rad": 0.0}
    truth = FieldRuts(**smooth).truth(0)
    np.testing.assert_allclose(truth.enu_m[[4000, 6000, 12000], 2], [0.0, -0.05, -0.1], atol=1e-9)
    np.testing.assert_allclose(truth.euler_rad[4500, :2], [0.07, 0.06], atol=1e-9)
    np.testing.assert_allclose(truth.euler_rad[6000, :2], 0.0, atol=1e-9)
