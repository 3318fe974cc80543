"""Terrain, ruts, impacts, vibration and path of the simulated field."""

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson, quad

from jerkbench.datasets.field import FieldHeadland, FieldRuts, FieldWhite
from jerkbench.simulation.truth import (
    draw_impacts,
    draw_terrain,
    draw_vibration,
    drive_course,
    impact_force,
    inner_times,
    rut_force,
)

RATIO = (1.2 / 0.03) ** (1 / 35)  # ratio of successive wavenumbers


def psd(n, roughness):
    """Displacement spectrum of ISO 8608, 1024e-6 m3 at 0.1 cycles/m, without short waves that the track bridges."""
    return roughness**2 * 1024e-6 * (0.1 / n) ** 2 / (1 + (n / 0.6) ** 2) ** 2


def variance(low, high, roughness):
    return quad(psd, low, high, args=(roughness,))[0]


def flat(seed, roughness=1.5):
    return draw_terrain(np.random.default_rng(seed), roughness, 0.6, 0.0, 60.0)


def drive(terrain, length=5000.0, step=0.2):
    s = np.arange(0.0, length, step)
    return terrain.at(s, np.zeros_like(s))


@pytest.mark.parametrize("roughness", [1.5, 2.5])
def test_height_and_roll_have_the_rms_of_the_spectrum(roughness):
    ground = drive(flat(1, roughness))
    rms = np.sqrt(variance(0.03 / RATIO**0.5, 1.2 * RATIO**0.5, roughness))
    assert ground.height_m.std() == pytest.approx(rms, rel=0.01)
    assert ground.roll_rad.std() == pytest.approx(0.6 * rms, rel=0.01)


@pytest.mark.parametrize("first", [0, 9, 18, 27])
def test_each_quarter_of_the_waves_has_the_power_of_the_spectrum(first):
    low, high = 0.03 * RATIO ** (first - 0.5), 0.03 * RATIO ** (first + 8.5)
    height = drive(flat(2)).height_m
    spectrum = 2 * np.abs(np.fft.rfft(height) / len(height)) ** 2
    n = np.fft.rfftfreq(len(height), 0.2)
    assert spectrum[(n >= low) & (n < high)].sum() == pytest.approx(variance(low, high, 1.5), rel=0.02)


def test_slopes_are_the_derivatives_of_height_and_the_hill_is_a_sine_of_x():
    terrain = draw_terrain(np.random.default_rng(3), 1.5, 0.6, 0.4, 60.0)
    s, x, h = np.linspace(5.0, 90.0, 200), np.linspace(-30.0, 40.0, 200), 1e-5
    slope = terrain.at(s, x).slope
    along = (terrain.at(s + h, x).height_m - terrain.at(s - h, x).height_m) / (2 * h)
    east = (terrain.at(s, x + h).height_m - terrain.at(s, x - h).height_m) / (2 * h)
    np.testing.assert_allclose(slope, np.column_stack([along, east]), atol=1e-9)
    terrain = draw_terrain(np.random.default_rng(4), 0.0, 0.6, 0.4, 60.0)
    height = terrain.at(np.zeros(4), np.array([0.0, 15.0, 30.0, 45.0])).height_m
    np.testing.assert_allclose(height, [0.0, 0.4, 0.0, -0.4], atol=1e-12)


RUTS = FieldRuts()._ruts()
T = np.arange(15001) / 100


def test_speed_dips_and_distance_is_still_its_integral():
    course = drive_course(T, FieldWhite()._path(), RUTS)
    assert course.speed_mps[4500] == pytest.approx(1.2, abs=1e-6)
    fine = np.arange(60001) / 1000
    speed = drive_course(fine, FieldWhite()._path(), RUTS).speed_mps
    driven = cumulative_simpson(speed, x=fine, initial=0)[::10]
    np.testing.assert_allclose(course.distance_m[:6001], driven, atol=1e-8)


def test_each_rut_lowers_the_robot_by_its_depth_and_tilts_it():
    smooth = {"roughness": 0.0, "hill_height_m": 0.0, "vibration_mps2": 0.0, "vibration_rad": 0.0}
    truth = FieldRuts(**smooth).truth(0)
    np.testing.assert_allclose(truth.enu_m[[4000, 6000, 12000], 2], [0.0, -0.05, -0.1], atol=1e-9)
    np.testing.assert_allclose(truth.euler_rad[4500, :2], [0.07, 0.06], atol=1e-9)
    np.testing.assert_allclose(truth.euler_rad[6000, :2], 0.0, atol=1e-9)


TIMES_S = np.arange(1001) / 100
INNER = inner_times(TIMES_S, 10)


def test_samples_are_the_mean_of_the_decaying_force():
    sample = rut_force(INNER, (5.0,), (0.7, 0.4, 1.0), 0.3).mean(axis=1)
    decay = np.exp(-np.maximum(TIMES_S - 5.0, 0) / 0.3)
    mean = 0.3 * (decay[:-1] - decay[1:]) / 0.01 * (TIMES_S[1:] > 5.0)
    np.testing.assert_allclose(sample, np.outer(mean, [0.7, 0.4, 1.0]), atol=1e-5)


@pytest.mark.parametrize("start", [2.0, 2.0037])
def test_an_impact_is_a_half_sine_upwards(start):
    force = impact_force(INNER, np.array([start]), 45.0)
    impulse = force.sum(axis=(0, 1)) * 0.001
    np.testing.assert_allclose(impulse, [0.0, 0.0, 45.0 * 0.02 * 2 / np.pi], rtol=0.01)
    assert force.max() == pytest.approx(45.0, rel=0.01)
    assert not force[np.abs(INNER - (start + 0.01)) > 0.01].any()


def test_impacts_are_a_poisson_process():
    counts, times = [], []
    for seed in range(400):
        hits = draw_impacts(np.random.default_rng(seed), 0.3, 6.0, 106.0)
        counts.append(len(hits))
        times.extend(hits)
    assert np.mean(counts) == pytest.approx(30.0, abs=4 * np.sqrt(30 / 400))
    assert np.var(counts) == pytest.approx(30.0, rel=0.3)
    assert (min(times), max(times)) == (pytest.approx(6.0, abs=0.1), pytest.approx(106.0, abs=0.1))
    assert (np.diff(hits) > 0).all()


VIBRATION = draw_vibration(np.random.default_rng(1), 0.3, 5e-4)


def steady(rate_hz=1000, length_s=60.0):
    t = np.arange(round(length_s * rate_hz)) / rate_hz
    return t, VIBRATION.at(t, np.ones_like(t), np.zeros_like(t))


def test_vibration_has_the_requested_rms_and_one_sine_in_each_fourteenth_of_the_band():
    t, shaking = steady()
    acceleration = np.gradient(shaking.velocity_mps, t, axis=0)[1:-1]
    np.testing.assert_allclose(acceleration.std(axis=0), [0.21, 0.21, 0.3], rtol=0.02)
    np.testing.assert_allclose(shaking.euler_rad.std(axis=0), 5e-4, rtol=0.02)
    _, shaking = steady(rate_hz=200)
    taper = np.hanning(12000)
    for signal in (shaking.velocity_mps[:, 2], shaking.euler_rad[:, 0]):
        power = np.abs(np.fft.rfft(signal * taper)) ** 2
        f = np.fft.rfftfreq(12000, 1 / 200)
        assert power[(f > 7.9) & (f < 35.1)].sum() > 0.999 * power.sum()
    bins, _ = np.histogram(VIBRATION.frequency_radps / (2 * np.pi), np.linspace(8.0, 35.0, 15))
    assert bins.tolist() == [1] * 14
    amplitude = np.hypot(VIBRATION.sine[2], VIBRATION.cosine[2]) * VIBRATION.frequency_radps**2
    np.testing.assert_allclose(amplitude, 0.3 * np.sqrt(2 / 14))


def test_velocity_is_the_derivative_of_displacement_while_the_envelope_grows():
    t = np.arange(20001) / 10000
    shaking = VIBRATION.at(t, t**2, 2 * t)
    slope = np.gradient(shaking.enu_m, t, axis=0, edge_order=2)
    np.testing.assert_allclose(shaking.velocity_mps[1:-1], slope[1:-1], atol=2e-6)
    assert np.abs(shaking.velocity_mps).max() == pytest.approx(0.01, rel=2)  # the tolerance above is a thousandth
    assert np.abs(shaking.velocity_mps).max() > 2e-3


FIELD = FieldWhite()._path()
HEADLAND = FieldHeadland()._path()


def one(function, t):
    """Return a value of a function that needs increasing times of the complete drive."""
    return float(function(np.array([0.0, t, 150.0]))[1])


@pytest.mark.parametrize(("path", "starts"), [(FIELD, [26, 52, 78, 104, 130]), (HEADLAND, 16.0 + 13.5 * np.arange(10))])
def test_turns_start_after_each_pass(path, starts):
    np.testing.assert_allclose(path.turn_starts_s(150.0), starts)


@pytest.mark.parametrize("path", [FIELD, HEADLAND])
def test_a_turn_is_half_a_circle_to_alternating_sides_and_yaw_is_the_integral_of_its_rate(path):
    for number, start in enumerate(path.turn_starts_s(140.0)):
        angle = one(path.yaw_rad_at, start + path.turn_s) - one(path.yaw_rad_at, start)
        assert angle == pytest.approx(np.pi * (-1) ** number, abs=1e-12)
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
