import numpy as np
import pytest
from scipy.integrate import quad

from jerkbench.simulation.truth import draw_terrain

RATIO = (1.2 / 0.03) ** (1 / 35)  # from wave to wave


def psd(n, roughness):
    """ISO 8608 displacement spectrum, 1024e-6 m3 at .1 cycles/m, after the track has bridged the short waves."""
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


def test_slopes_are_the_derivatives_of_height():
    terrain = draw_terrain(np.random.default_rng(3), 1.5, 0.6, 0.4, 60.0)
    s, x, h = np.linspace(5.0, 90.0, 200), np.linspace(-30.0, 40.0, 200), 1e-5
    slope = terrain.at(s, x).slope
    along = (terrain.at(s + h, x).height_m - terrain.at(s - h, x).height_m) / (2 * h)
    east = (terrain.at(s, x + h).height_m - terrain.at(s, x - h).height_m) / (2 * h)
    np.testing.assert_allclose(slope, np.column_stack([along, east]), atol=1e-9)


def test_the_hill_is_a_sine_of_x():
    terrain = draw_terrain(np.random.default_rng(4), 0.0, 0.6, 0.4, 60.0)
    height = terrain.at(np.zeros(4), np.array([0.0, 15.0, 30.0, 45.0])).height_m
    np.testing.assert_allclose(height, [0.0, 0.4, 0.0, -0.4], atol=1e-12)
