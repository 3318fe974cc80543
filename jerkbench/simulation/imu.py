"""The measurements of a perfect IMU on a true motion, limited by the accelerometer's range."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.geometry import dcm_from_euler
from jerkbench.recording import GRAVITY_MPS2
from jerkbench.simulation.truth import Truth


def perfect_imu(truth: Truth) -> tuple[FloatArray, FloatArray]:
    """Return specific force and angular rate (n, 3) in the body, over each of the n intervals of ``truth``.

    The gyro is the mean rate of the rotation from one end of the interval to the other, and the accelerometer is
    the specific force that carries the velocity from one to the other under the mean of the two attitudes::

        w_k = Log(Omega_{k-1}' Omega_k)/dt
        f_k = [(Omega_{k-1} + Omega_k)/2]^-1 ((v_k - v_{k-1})/dt + (0, 0, g))

    so that integrating it with the true attitude returns the true velocity exactly. It differs from the mean of
    the body's specific force only in the second order of dt, as sculling and coning do.
    """
    from scipy.spatial.transform import Rotation

    dcm = dcm_from_euler(truth.euler_rad)
    dt = np.diff(truth.t_s)[:, None]
    gyro = Rotation.from_matrix(dcm[:-1].transpose(0, 2, 1) @ dcm[1:]).as_rotvec() / dt
    accel = np.diff(truth.velocity_mps, axis=0) / dt + np.array([0.0, 0.0, GRAVITY_MPS2])
    force = np.linalg.solve(0.5 * (dcm[:-1] + dcm[1:]), accel[:, :, None])[:, :, 0]
    return np.asarray(force), np.asarray(gyro)


def saturate(force_mps2: FloatArray, false_mps2: FloatArray | None, range_g: float | None) -> FloatArray:
    """Return (n, 3): true and false specific force, cut off at +-``range_g`` and then averaged over the sample.

    Args:
        force_mps2: (n, 3) constant over a sample.
        false_mps2: (n, m, 3) within a sample; None: there is none.
        range_g: of each axis, in units of g; None: no limit.
    """
    inner = force_mps2[:, None, :] if false_mps2 is None else force_mps2[:, None, :] + false_mps2
    if range_g is not None:
        limit = range_g * GRAVITY_MPS2
        inner = np.clip(inner, -limit, limit)
    return np.asarray(inner.mean(axis=1))
