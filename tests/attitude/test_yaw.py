import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jerkbench.attitude.yaw import estimate_yaw, yaw_rate
from jerkbench.geometry import dcm_from_euler, euler_from_dcm
from jerkbench.recording import Heading, Imu

WALK = 0.05


def level_yaw(t, rate, source, walk):
    """Yaw of a level body that turns at ``rate``."""
    zero = np.zeros(len(t))
    imu = Imu(t, np.zeros((len(t), 3)), np.column_stack([zero, zero, rate]))
    return estimate_yaw(imu, zero, zero, source, walk).rad


def wrap(angle):
    return np.arctan2(np.sin(angle), np.cos(angle))


def drive(seed=0, n=400):
    """Uneven samples, a quick turn, and headings between the stamps with noise and a jump over pi."""
    rng = np.random.default_rng(seed)
    dt = rng.uniform(0.005, 0.02, n)
    t = np.cumsum(dt)
    rate = 1.5 + rng.normal(size=n)
    t_z = np.sort(rng.uniform(t[20], t[-1], 25))
    t_z[3] = t[np.searchsorted(t, t_z[3])]  # one of them exactly at a stamp
    truth = np.interp(t_z, np.concatenate([[0], t]), np.concatenate([[0], np.cumsum(dt * rate)]))
    z = wrap(truth + 2.9 + 0.1 * rng.normal(size=25))
    return t, dt, rate, Heading(t_z, z, rng.uniform(0.05, 0.2, 25))


def naive_yaw(t, dt, rate, headings, walk):
    """Yaw itself as the state, predicted sample by sample, split where a heading lies."""
    pending = list(zip(headings.t_s, headings.yaw_rad, headings.sigma_rad, strict=True))
    yaw = P = None
    out = np.full(len(t), np.nan)
    for k in range(len(t)):
        now = t[k] - dt[k]
        while pending and pending[0][0] <= t[k]:
            t_z, z, sigma = pending.pop(0)
            if yaw is None:
                yaw, P = z, sigma**2
            else:
                yaw += (t_z - now) * rate[k]
                P += (t_z - now) * walk**2
                K = P / (P + sigma**2)
                yaw += K * wrap(z - yaw)
                P -= K * P
            now = t_z
        if yaw is not None:
            yaw += (t[k] - now) * rate[k]
            P += (t[k] - now) * walk**2
            out[k] = wrap(yaw)
    return out


@pytest.mark.parametrize("seed", range(3))
def test_the_offset_filter_equals_the_naive_filter(seed):
    t, dt, rate, headings = drive(seed)
    yaw = level_yaw(t, rate, headings, WALK)
    wanted = naive_yaw(t, dt, rate, headings, WALK)
    after = t >= headings.t_s[0]
    assert np.isfinite(wanted).sum() == after.sum()
    np.testing.assert_allclose(wrap(yaw - wanted)[after], 0, atol=1e-11)
    assert (np.abs(np.diff(yaw)) > 6).any()  # it did go over pi


def test_before_the_first_heading_the_gyro_is_run_backwards():
    t, dt, rate, headings = drive()
    yaw = level_yaw(t, rate, headings, WALK)
    first = int(np.searchsorted(t, headings.t_s[0]))
    back = headings.yaw_rad[0] - (headings.t_s[0] - t[first - 1]) * rate[first]
    for k in range(first - 1, -1, -1):
        assert wrap(yaw[k] - back) == pytest.approx(0, abs=1e-12)
        back -= dt[k] * rate[k]


def test_a_heading_changes_nothing_before_its_own_time():
    t, _, rate, headings = drive()
    changed = headings.yaw_rad.copy()
    changed[10] += 0.3
    before = level_yaw(t, rate, headings, WALK)
    after = level_yaw(t, rate, Heading(headings.t_s, changed, headings.sigma_rad), WALK)
    same = t < headings.t_s[10]
    np.testing.assert_array_equal(before[same], after[same])
    assert (before[~same] != after[~same]).all()


def test_without_headings_yaw_starts_at_zero():
    yaw = level_yaw(np.array([1.0, 2.0]), np.array([2.0, 2.0]), None, WALK)
    np.testing.assert_allclose(yaw, [2.0, 4.0 - 2 * np.pi], atol=1e-12)


def test_yaw_rate_is_the_derivative_of_the_euler_angle():
    euler, gyro, h = np.array([0.3, -0.4, 1.0]), np.array([0.5, -0.7, 0.9]), 1e-6
    turned = Rotation.from_matrix(dcm_from_euler(euler)) * Rotation.from_rotvec(h * gyro)
    numeric = (euler_from_dcm(turned.as_matrix()[None])[0, 2] - euler[2]) / h
    assert yaw_rate(gyro[None], euler[:1], euler[1:2])[0] == pytest.approx(numeric, abs=1e-5)
