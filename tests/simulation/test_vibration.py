import numpy as np
import pytest

from jerkbench.simulation.truth import draw_vibration

VIBRATION = draw_vibration(np.random.default_rng(1), 0.3, 5e-4)


def steady(rate_hz=1000, length_s=60.0):
    t = np.arange(round(length_s * rate_hz)) / rate_hz
    return t, VIBRATION.at(t, np.ones_like(t), np.zeros_like(t))


def test_acceleration_and_angles_have_the_rms_that_was_asked_for():
    t, shaking = steady()
    acceleration = np.gradient(shaking.velocity_mps, t, axis=0)[1:-1]
    np.testing.assert_allclose(acceleration.std(axis=0), [0.21, 0.21, 0.3], rtol=0.02)
    np.testing.assert_allclose(shaking.euler_rad.std(axis=0), 5e-4, rtol=0.02)


def test_all_of_it_lies_in_the_band_one_sine_in_each_fourteenth():
    _, shaking = steady(rate_hz=200)
    taper = np.hanning(12000)
    for signal in (shaking.velocity_mps[:, 2], shaking.euler_rad[:, 0]):
        power = np.abs(np.fft.rfft(signal * taper)) ** 2
        f = np.fft.rfftfreq(12000, 1 / 200)
        assert power[(f > 7.9) & (f < 35.1)].sum() > 0.999 * power.sum()
    bins, _ = np.histogram(VIBRATION.frequency_radps / (2 * np.pi), np.linspace(8.0, 35.0, 15))
    assert bins.tolist() == [1] * 14


def test_all_sines_have_the_same_acceleration():
    amplitude = np.hypot(VIBRATION.sine[2], VIBRATION.cosine[2]) * VIBRATION.frequency_radps**2
    np.testing.assert_allclose(amplitude, 0.3 * np.sqrt(2 / 14))


def test_velocity_is_the_derivative_of_displacement_while_the_envelope_grows():
    t = np.arange(20001) / 10000
    shaking = VIBRATION.at(t, t**2, 2 * t)
    slope = np.gradient(shaking.enu_m, t, axis=0, edge_order=2)
    np.testing.assert_allclose(shaking.velocity_mps[1:-1], slope[1:-1], atol=2e-6)
    assert np.abs(shaking.velocity_mps).max() == pytest.approx(0.01, rel=2)  # the tolerance above is a thousandth
    assert np.abs(shaking.velocity_mps).max() > 2e-3
