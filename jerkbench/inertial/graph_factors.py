"""Factors that GTSAM's Python has not: a measurement with a switch, and a heading, each as its CustomFactor.

GTSAM's errors of a pose are those of the body, [w, s]: R Exp(w) and t + R s.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.geometry import wrap_angle
from jerkbench.inertial.measurement_models import yaw_of
from jerkbench.inertial.rotation import skew

Expected = Callable[[Any], tuple[FloatArray, FloatArray]]
"""From values: what a measurement (m,) is expected to be, and the Jacobian (m, d) of its state."""


def expected_antenna(pose: int, antenna_m: FloatArray) -> Expected:
    """Expect the antenna's place t + R l of the pose with this key."""
    arm = skew(antenna_m)

    def expected(values: Any) -> tuple[FloatArray, FloatArray]:  # noqa: ANN401 - GTSAM has no types
        """Return the place (3,) [m] and its Jacobian (3, 6)."""
        at = values.atPose3(pose)
        dcm = at.rotation().matrix()
        return at.translation() + dcm @ antenna_m, np.hstack([-dcm @ arm, dcm])

    return expected


def expected_velocity(velocity: int) -> Expected:
    """Expect the velocity with this key."""
    return lambda values: (values.atVector(velocity), np.eye(3))


def switched(gtsam: Any, state: int, switch: int, expected: Expected, z: FloatArray, noise: Any) -> Any:  # noqa: ANN401
    """Return the factor with the residual s (h(x) - z): ``switch`` is the key of s, ``state`` that of x."""

    def residual(_: Any, values: Any, jacobians: list[FloatArray] | None) -> FloatArray:  # noqa: ANN401
        """Return s (h(x) - z) (m,), and fill in the Jacobians in the state and in s."""
        s, (h, H) = float(values.atVector(switch)[0]), expected(values)
        if jacobians is not None:
            jacobians[0], jacobians[1] = s * H, (h - z)[:, None]
        return s * (h - z)

    return gtsam.CustomFactor(noise, [state, switch], residual)


def measured_heading(gtsam: Any, pose: int, yaw_rad: float, sigma_rad: float) -> Any:  # noqa: ANN401
    """Return the factor of a heading of the pose with this key."""

    def residual(_: Any, values: Any, jacobians: list[FloatArray] | None) -> FloatArray:  # noqa: ANN401
        """Return the difference (1,) [rad], and fill in the Jacobian in the pose."""
        dcm = values.atPose3(pose).rotation().matrix()
        h, H = yaw_of(dcm)
        if jacobians is not None:
            jacobians[0] = np.concatenate([H @ dcm, np.zeros(3)])[None, :]
        return np.array([wrap_angle(np.array(h - yaw_rad))])

    return gtsam.CustomFactor(gtsam.noiseModel.Isotropic.Sigma(1, sigma_rad), [pose], residual)
