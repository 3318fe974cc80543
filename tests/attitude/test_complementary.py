"""The filters of Madgwick and Mahony against the package ahrs and against closed forms."""

import numpy as np
import pytest
from moved import RATE_HZ, G, degrees_between, pushed, recording, shaken, turning

from jerkbench.attitude import common
from jerkbench.attitude.common import quaternion_of
from jerkbench.attitude.mahony import Madgwick, Mahony, run_madgwick, run_mahony

PLUGINS = [Madgwick(0.1), Mahony(0.5, 0.02), Mahony(0.3, 0.0)]


def ahrs_quaternions(plugin, imu, q0):
    """The quaternions of the package after each sample except the first."""
    filters = pytest.importorskip("ahrs").filters
    if isinstance(plugin, Madgwick):
        return filters.Madgwick(imu.gyro_radps, imu.accel_mps2, Dt=1 / RATE_HZ, gain=plugin.gain_per_s, q0=q0).Q[1:]
    gains = {"k_P": plugin.proportional_per_s, "k_I": plugin.integral_per_s2}
    return filters.Mahony(imu.gyro_radps, imu.accel_mps2, frequency=RATE_HZ, **gains, q0=q0).Q[1:]


@pytest.mark.parametrize("plugin", PLUGINS[:2])  # ahrs does not support an integral gain of 0
@pytest.mark.parametrize("compiled", [True, False])
def test_it_equals_ahrs(plugin, compiled):
    imu = shaken().imu
    plain = run_madgwick if isinstance(plugin, Madgwick) else run_mahony
    loop = common._compiled(plain, plain.__name__) if compiled else plain
    q0 = quaternion_of(np.array([0.1, -0.3, 0.9]))
    q, x = q0.copy(), np.empty((len(imu.t_s) - 1, 3))
    if isinstance(plugin, Madgwick):
        state = q, plugin.gain_per_s
    else:
        state = q, np.zeros(3), plugin.proportional_per_s, plugin.integral_per_s2
    loop(*state, imu.gyro_radps[1:].copy(), imu.accel_mps2[1:].copy(), np.full(len(x), 1 / RATE_HZ), x)
    w, a, b, c = ahrs_quaternions(plugin, imu, q0).T
    theirs = np.column_stack([2 * (a * c - w * b), 2 * (w * a + b * c), w * w - a * a - b * b + c * c])
    np.testing.assert_allclose(x, theirs, rtol=0, atol=1e-9)
    np.testing.assert_allclose(q, [w[-1], a[-1], b[-1], c[-1]], rtol=0, atol=1e-9)


@pytest.mark.parametrize("plugin", PLUGINS)
@pytest.mark.parametrize("rate_hz", [100.0, 800.0])
def test_a_constant_rate_is_followed_within_a_sample(plugin, rate_hz):
    """Both correct the attitude before a sample by the force after it, so the error is up to one rotation step."""
    rate = np.array([0.3, -0.2, 0.5])
    drive, truth = turning(rate, rate_hz=rate_hz)
    x, triggered = plugin.verticals(drive)
    assert triggered is None
    assert degrees_between(x, truth).max() < np.degrees(np.linalg.norm(rate) / rate_hz)


@pytest.mark.parametrize(("integral", "settled"), [(0.0, 0.01 / 0.5), (0.05, 0.0)])
def test_a_bias_tilts_mahony_by_the_ratio_to_the_gain(integral, settled):
    """At rest with a bias b about x, k_P sin(tilt) = b without an integral gain; with it the error decays to 0."""
    gyro = np.tile([0.01, 0.0, 0.0], (30000, 1))
    x, _ = Mahony(0.5, integral).verticals(recording(gyro, np.tile([0.0, 0.0, G], (30000, 1)), 2.0))
    np.testing.assert_allclose(np.abs(x[-1, 1]), settled, atol=1e-6)


def test_a_constant_acceleration_tilts_mahony_with_its_time_constant():
    """theta' = -k_P sin(theta - beta), so that tan((beta - theta)/2) falls as exp(-k_P t)."""
    beta, gain = np.arctan2(1.0, G), 0.05
    x, _ = Mahony(gain, 0.0).verticals(pushed([1.0, 0.0, 0.0], 40.0))
    after_s = np.arange(1, 3801) / RATE_HZ
    theta = beta - 2 * np.arctan(np.tan(beta / 2) * np.exp(-gain * after_s))
    np.testing.assert_allclose(np.arctan2(x[200:, 0], x[200:, 2]), theta, atol=1e-4)


def test_a_constant_acceleration_tilts_madgwick_with_a_constant_rate():
    """The length of J'f has no effect: the tilt grows with the rate 2 beta until it has converged."""
    x, _ = Madgwick(0.001).verticals(pushed([1.0, 0.0, 0.0], 22.0))
    theta = np.arctan2(x[200:, 0], x[200:, 2])
    np.testing.assert_allclose(theta, 0.002 * np.arange(1, 2001) / RATE_HZ, atol=1e-4)
