"""The reference of a recording from a bag, and the lever arm, which needs its attitude."""

import dataclasses

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, nearest_rows
from jerkbench.bags.positions import Place, axes_to_enu, body_axes, fixes_in_enu, frame_of
from jerkbench.bags.streams import seconds
from jerkbench.errors import RecordingError
from jerkbench.geometry import dcm_from_euler, dcm_from_quaternion, euler_from_dcm
from jerkbench.readers.ros.messages import Messages
from jerkbench.recording import Position, Reference
from jerkbench.sanitiser.values import unit_quaternions

NO_REFERENCE = "none was named in the bag, so that errors are n/a and only the innovations (NIS) can judge"


def no_reference(t_s: FloatArray) -> Reference:
    """Return a reference that knows nothing, at the stamps ``t_s``."""
    return Reference(t_s, NO_REFERENCE, independent=False)


def reference_of(
    messages: Messages, stated_frame: str, place: Place, zero_ns: int, source: str, *, independent: bool
) -> Reference:
    """Return positions, and, where the messages have them, attitudes and velocities (twists are in the body)."""
    frame = frame_of(messages, stated_frame)
    t_s, enu_m = seconds(messages.stamp_ns, zero_ns), fixes_in_enu(messages, frame, place)
    if "orientation" not in messages.values:
        return Reference(t_s, source, independent, enu_m=enu_m)
    known = unit_quaternions(messages["orientation"])
    if not known.any():
        return Reference(t_s, source, independent, enu_m=enu_m)
    xyzw = np.where(known[:, None], messages["orientation"], [0.0, 0.0, 0.0, 1.0])
    dcm = axes_to_enu(frame, place) @ dcm_from_quaternion(xyzw) @ body_axes(frame)
    euler_rad = _where(known, euler_from_dcm(dcm))
    if "linear" not in messages.values:
        return Reference(t_s, source, independent, enu_m=enu_m, euler_rad=euler_rad)
    velocity_mps = _where(known, np.einsum("nij,nj->ni", dcm, messages["linear"] @ body_axes(frame)))
    return Reference(t_s, source, independent, enu_m=enu_m, velocity_mps=velocity_mps, euler_rad=euler_rad)


def at_body(position: Position, reference: Reference, lever_arm_m: tuple[float, ...]) -> Position:
    """Move fixes from the antenna to the body's reference point with the reference's nearest attitude.

    p_body = p_antenna - Omega l.

    Raises:
        RecordingError: the reference has no attitude.
    """
    if not any(lever_arm_m):
        return position
    if reference.euler_rad is None:
        raise RecordingError(
            "lever_arm_m needs the attitude of a reference, and the bag has none; leave it at zero, and give it to a"
            " filter that takes one (filter=eskf15)."
        )
    known = np.isfinite(reference.euler_rad).all(axis=1)
    nearest = nearest_rows(reference.t_s[known], position.t_s)
    omega = dcm_from_euler(reference.euler_rad[known][nearest])
    return dataclasses.replace(position, enu_m=position.enu_m - omega @ np.array(lever_arm_m))


def _where(known: BoolArray, values: FloatArray) -> FloatArray:
    return np.where(known[:, None], values, np.nan)
