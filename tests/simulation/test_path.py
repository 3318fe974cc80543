import numpy as np
import pytest
from scipy.integrate import quad

from jerkbench.datasets.field import FieldHeadland, FieldWhite

FIELD = FieldWhite()._path()
HEADLAND = FieldHeadland()._path()


def one(function, t):
    """A value in the middle of the drive; the functions want increasing times that cover it."""
    return float(function(np.array([0.0, t, 150.0]))[1])


@pytest.mark.parametrize(("path", "starts"), [(FIELD, [26, 52, 78, 104, 130]), (HEADLAND, 16.0 + 13.5 * np.arange(10))])
def test_turns_begin_after_each_pass(path, starts):
    np.testing.assert_allclose(path.turn_starts_s(150.0), starts)


@pytest.mark.parametrize("path", [FIELD, HEADLAND])
def test_a_turn_is_half_a_circle_to_alternating_sides(path):
    for number, start in enumerate(path.turn_starts_s(140.0)):
        turned = one(path.yaw_rad_at, start + path.turn_s) - one(path.yaw_rad_at, start)
        assert turned == pytest.approx(np.pi * (-1) ** number, abs=1e-12)


@pytest.mark.parametrize("path", [FIELD, HEADLAND])
def test_yaw_is_the_integral_of_the_yaw_rate(path):
    T, start = path.turn_s, path.turn_starts_s(150.0)[0]
    for part in (0.1, 0.35, 0.8):
        angle, _ = quad(lambda t: np.pi / T * (1 - np.cos(2 * np.pi * t / T)), 0.0, part * T)
        assert one(path.yaw_rad_at, start + part * T) - path.heading_rad == pytest.approx(angle, abs=1e-10)


@pytest.mark.parametrize(("path", "straight", "turn"), [(FIELD, 1.5, 0.8), (HEADLAND, 2.0, 1.6)])
def test_speeds_on_passes_and_in_turns(path, straight, turn):
    t = np.arange(15001) / 100
    speed = path.speed_mps_at(t)
    assert np.abs(speed[t <= path.stand_s]).max() == 0
    for start in path.turn_starts_s(140.0):
        np.testing.assert_allclose(speed[(t >= start) & (t <= start + path.turn_s)], turn, atol=1e-12)
        on_pass = (t >= start + path.turn_s + 2.0) & (t <= min(start + path.turn_s + path.pass_s - 2.0, 150.0))
        np.testing.assert_allclose(speed[on_pass], straight, atol=1e-12)


def test_distance_is_the_integral_of_speed():
    for end in (4.5, 25.0, 60.0):
        corners = [t for t in (3, 6, 24, 26, 32, 34, 50, 52, 58) if t < end]
        length, _ = quad(lambda t: one(FIELD.speed_mps_at, t), 0.0, end, points=corners, limit=200)
        assert one(FIELD.distance_m_at, end) == pytest.approx(length, abs=1e-8)
