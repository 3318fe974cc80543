"""Positions in their frames: geodetic, ECEF, a local plane."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError, RecordingError, unknown
from jerkbench.geometry import ecef_to_enu, ecef_to_origin, enu_axes, geodetic_to_enu
from jerkbench.io.ros.bag import Messages
from jerkbench.io.ros.cleaning import is_ecef
from jerkbench.recording import Origin

Frame = Literal["geodetic", "ecef", "enu", "ned"]
POSE_FRAMES = ("auto", "ecef", "enu", "ned")
FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""East, north, up from north, east, down."""
FROM_FRD = np.diag([1.0, -1.0, -1.0])
"""Forward, left, up from forward, right, down: the body of orientations and velocities in NED."""
FROM_NEU: FloatArray = np.abs(FROM_NED)
"""East, north, up from north, east, up."""


@dataclass(frozen=True)
class Place:
    """The origin of ENU.

    Attributes:
        origin: on the Earth; None for local coordinates.
        local_m: (3,) what is subtracted from local coordinates (in ENU order).
    """

    origin: Origin | None
    local_m: FloatArray = field(default_factory=lambda: np.zeros(3))


def frame_of(messages: Messages, stated: str) -> Frame:
    """Return the frame of the positions; of a pose "auto" is ECEF where it is as far from the Earth's centre, else ENU.

    Raises:
        PluginError: no such frame.
    """
    if "latitude" in messages.values:
        return "geodetic"
    if stated not in POSE_FRAMES:
        raise PluginError(unknown("position_frame", stated, POSE_FRAMES))
    if stated == "auto":
        return "ecef" if is_ecef(messages["position"]) else "enu"
    return stated  # type: ignore[return-value]  # checked above


def first_place(messages: Messages, frame: Frame, origin: tuple[float, ...]) -> Place:
    """Return where ENU begins: the given origin, or the first position."""
    if frame in ("enu", "ned"):
        first = messages["position"][0]
        return Place(None, first if frame == "enu" else FROM_NED @ first)
    if origin:
        return Place(Origin(*origin))
    if frame == "ecef":
        return Place(ecef_to_origin(messages["position"][0]))
    return Place(Origin(*(float(messages[name][0, 0]) for name in ("latitude", "longitude", "altitude"))))


def fixes_in_enu(messages: Messages, frame: Frame, place: Place) -> FloatArray:
    """Return the positions (n, 3) in ENU at ``place``.

    Raises:
        RecordingError: one of the two is on the Earth and the other is local.
    """
    if (frame in ("enu", "ned")) != (place.origin is None):
        raise RecordingError(
            f"The topic {messages.topic} is in the frame {frame}, and the fixes are not; they cannot be compared:"
            " choose topics of one kind."
        )
    if place.origin is None:
        position = messages["position"]
        return np.asarray((position if frame == "enu" else position @ FROM_NED.T) - place.local_m)
    if frame == "ecef":
        return ecef_to_enu(messages["position"], place.origin)
    lat, lon, height = (messages[name][:, 0] for name in ("latitude", "longitude", "altitude"))
    return geodetic_to_enu(lat, lon, height, place.origin)


def axes_to_enu(frame: Frame, place: Place, covariance_order: str = "enu") -> FloatArray:
    """Return the matrix (3, 3) that turns vectors of the frame into ENU; of "geodetic" the covariance's."""
    if frame == "ecef" and place.origin is not None:
        return enu_axes(place.origin)
    if frame == "geodetic" and covariance_order == "neu":
        return FROM_NEU
    matrix: FloatArray = FROM_NED if frame == "ned" else np.eye(3)
    return matrix


def body_axes(frame: Frame) -> FloatArray:
    """Return the matrix (3, 3) that turns FLU into the body of orientations in ``frame``: FRD in NED, else FLU."""
    matrix: FloatArray = FROM_FRD if frame == "ned" else np.eye(3)
    return matrix


def swapped(matrix: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return M v of vectors (n, 3) where M only swaps and mirrors axes; one that is NaN stays the only one."""
    axes = np.abs(matrix).argmax(axis=1)
    mirrored: FloatArray = vectors[:, axes] * matrix[np.arange(3), axes]
    return mirrored


def turned(matrix: FloatArray, covariance: FloatArray) -> FloatArray:
    """M C M' of covariances (n, 3, 3), symmetric to the bit."""
    product = np.asarray(matrix @ covariance @ matrix.T)
    return 0.5 * (product + product.transpose(0, 2, 1))
