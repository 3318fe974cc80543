"""Recordings with a known attitude, and random recordings, for tests of the attitude filters."""

import numpy as np
from scipy.spatial.transform import Rotation

from jerkbench.geometry import dcm_from_euler
from jerkbench.recording import Imu, Recording, Reference

G = 9.81
RATE_HZ = 100.0


def recording(gyro, accel, static_start_s=0.0, rate_hz=RATE_HZ, t_s=None, **parts):
    t = np.arange(1, len(gyro) + 1) / rate_hz if t_s is None else t_s
    reference = Reference([t[-1]], "made up", independent=True)
    return Recording("moved", Imu(t, accel, gyro), reference, static_start_s=static_start_s, **parts)


def standing(euler=(0.0, 0.0, 0.0), n=300):
    """The specific force of a body at rest with these angles."""
    return np.tile(dcm_from_euler(np.array(euler)).T @ [0.0, 0.0, G], (n, 1))


def shaken(n=2000, seed=0, static_start_s=0.0):
    """Random samples of gyro and accelerometer."""
    noise = np.random.default_rng(seed)
    gyro = np.cumsum(noise.normal(size=(n, 3)), axis=0) * 0.05 + 0.01
    return recording(gyro, [0.0, 0.0, G] + 2.0 * noise.normal(size=(n, 3)), static_start_s)


def turning(rate_radps, seconds=60.0, rest_s=2.0, rate_hz=RATE_HZ, euler=(0.3, -0.2, 0.0)):
    """A rest, then a constant rate about the body axes without acceleration; the true x after each sample."""
    n, still = round(seconds * rate_hz), round(rest_s * rate_hz)
    gyro = np.tile(np.array(rate_radps, dtype=float), (n, 1))
    gyro[:still] = 0.0
    start = Rotation.from_euler("ZYX", np.array(euler)[::-1])
    rotation = start * Rotation.from_rotvec(np.cumsum(gyro, axis=0) / rate_hz)
    x = rotation.inv().apply([0.0, 0.0, 1.0])
    return recording(gyro, G * x, rest_s, rate_hz), x


def pushed(accel_mps2, seconds=200.0, rest_s=2.0, rate_hz=RATE_HZ):
    """A level rest, then a constant acceleration in the body frame without rotation."""
    force = np.tile([0.0, 0.0, G], (round(seconds * rate_hz), 1))
    force[round(rest_s * rate_hz) :] += accel_mps2
    return recording(np.zeros_like(force), force, rest_s, rate_hz)


def degrees_between(x, y):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(x, y), axis=-1), (x * y).sum(axis=-1)))
