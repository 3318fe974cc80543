"""The checks of an attitude filter."""

from typing import Any

import numpy as np

from jerkbench.conformance.matrices import require_finite, require_shape
from jerkbench.conformance.methods import require_methods
from jerkbench.conformance.recordings import small_recording
from jerkbench.conformance.require import require
from jerkbench.conformance.same import pure_result
from jerkbench.estimate import Attitude
from jerkbench.geometry import dcm_from_euler
from jerkbench.recording import Recording

SHAPES = {"dcm": (3, 3), "euler_rad": (3,), "accel_enu_mps2": (3,)}
"""Of the arrays of an attitude, at each stamp."""


def check_attitude(plugin: Any) -> None:  # noqa: ANN401 - the plugin under test
    """Check an attitude filter on a small recording.

    Raises:
        AssertionError: stamps, shapes or types are wrong, a matrix is no rotation or does not belong to its angles.
    """
    subject = type(plugin).__name__
    require_methods("attitude", plugin)
    attitude = checked_attitude(subject, plugin, small_recording())
    for name in SHAPES:
        require_finite(f"{subject}: {name}", getattr(attitude, name))
    triggered = np.asarray(attitude.triggered)
    require(triggered.dtype == np.bool_, f"{subject}: triggered is of {triggered.dtype}; it must be of bool.")
    _check_rotations(subject, attitude)


def checked_attitude(subject: str, plugin: Any, recording: Recording) -> Attitude:  # noqa: ANN401 - as above
    """Return the attitude, checked for stamps and shapes, and for being the same the second time."""
    attitude = pure_result(f"{subject}.estimate()", plugin.estimate, recording)
    require(isinstance(attitude, Attitude), f"{subject}.estimate() gives a {type(attitude).__name__}, not an Attitude.")
    n = len(recording.inertial.t_s)
    require(np.array_equal(attitude.t_s, recording.inertial.t_s), f"{subject}: t_s must be the stamps of the IMU.")
    for name, shape in SHAPES.items():
        require_shape(f"{subject}: {name}", getattr(attitude, name), (n, *shape))
    triggered = np.shape(attitude.triggered)
    require(triggered == (n,), f"{subject}: triggered has shape {triggered}; it must be ({n},).")
    return attitude  # type: ignore[no-any-return]  # it was asked


def _check_rotations(subject: str, attitude: Attitude) -> None:
    dcm = attitude.dcm
    product = dcm @ dcm.transpose(0, 2, 1)
    proper = np.allclose(product, np.eye(3), rtol=0.0, atol=1e-6) and (np.linalg.det(dcm) > 0).all()
    require(proper, f"{subject}: dcm holds matrices that are no rotations.")
    require(
        np.allclose(dcm, dcm_from_euler(attitude.euler_rad), rtol=0.0, atol=1e-6),
        f"{subject}: dcm is not Rz(yaw) Ry(pitch) Rx(roll) of euler_rad (roll, pitch, yaw; body FLU to ENU).",
    )
