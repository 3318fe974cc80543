"""Serialised messages -> arrays, by the deserialiser of rosbags."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class MessagePart:
    """Numbers of a message.

    Attributes:
        name: of the field in `Messages`.
        path: where the numbers are in the deserialised message.
        count: how many numbers.
    """

    name: str
    path: str
    count: int = 1


def _parts(text: str) -> tuple[MessagePart, ...]:
    """The parts of a message, each as ``path*count``, the name being the path's end, or as ``name=path*count``."""
    found = [re.fullmatch(r"(?:(\w+)=)?([\w.]+)(?:\*(\d+))?", part) for part in text.split()]
    return tuple(
        MessagePart(part[1] or part[2].rpartition(".")[2], part[2], int(part[3] or 1)) for part in found if part
    )


_POSE = "pose.pose.position*3 pose.pose.orientation*4 pose_covariance=pose.covariance*36"
_TWIST = "twist.twist.linear*3 twist.twist.angular*3 twist_covariance=twist.covariance*36"

LAYOUTS: dict[str, tuple[MessagePart, ...]] = {
    "sensor_msgs/msg/Imu": _parts(
        "orientation*4 orientation_covariance*9 angular_velocity*3 angular_velocity_covariance*9"
        " linear_acceleration*3 linear_acceleration_covariance*9"
    ),
    "sensor_msgs/msg/NavSatFix": _parts(
        "status.status status.service latitude longitude altitude position_covariance*9 position_covariance_type"
    ),
    "nav_msgs/msg/Odometry": _parts(f"{_POSE} {_TWIST}"),
    "geometry_msgs/msg/PoseStamped": _parts("pose.position*3 pose.orientation*4"),
    "geometry_msgs/msg/PoseWithCovarianceStamped": _parts(_POSE),
    "geometry_msgs/msg/TwistStamped": _parts("twist.linear*3 twist.angular*3"),
    "geometry_msgs/msg/TwistWithCovarianceStamped": _parts(_TWIST),
    "geometry_msgs/msg/Vector3Stamped": _parts("linear=vector*3"),
}
"""The content behind the header of each type that is read."""


BLOCKS = {
    "position_covariance": ("pose_covariance", 0),
    "orientation_covariance": ("pose_covariance", 3),
    "linear_covariance": ("twist_covariance", 0),
}
"""3 x 3 blocks of the 6 x 6 covariances, and the row where they begin: the rest need not be kept."""


def source_of(msgtype: str, name: str) -> tuple[MessagePart, int | None]:
    """Return the part of a message that holds the field ``name``, and, of a block, the row where it begins.

    Raises:
        KeyError: messages of this type have no such field.
    """
    parts = {part.name: part for part in LAYOUTS[msgtype]}
    whole, first = (name, None) if name in parts else BLOCKS[name]
    return parts[whole], first


class MessageBlock(NamedTuple):
    """Some messages of one topic.

    Attributes:
        strings: frame_id and child_frame_id of the first.
        stamp_ns: (n,) stamps of the headers.
        values: the wanted fields, (n, k) each.
    """

    strings: tuple[str, str]
    stamp_ns: IntArray
    values: dict[str, FloatArray]


Deserialise = Callable[[bytes, str], Any]
"""The deserialiser of rosbags: a message and its type -> an instance of a class made at run time."""


def decode(raw: Sequence[bytes], msgtype: str, fields: Sequence[str], deserialise: Deserialise) -> MessageBlock:
    """Return the ``fields`` of the messages, at least one."""
    sources = {name: source_of(msgtype, name) for name in fields}
    messages = [deserialise(serialised, msgtype) for serialised in raw]
    values = {
        name: _block(np.array([_numbers(message, part) for message in messages], dtype=np.float64), begins)
        for name, (part, begins) in sources.items()
    }
    stamps = [message.header.stamp for message in messages]
    stamp_ns = np.array([stamp.sec * 1_000_000_000 + stamp.nanosec for stamp in stamps], dtype=np.int64)
    strings = messages[0].header.frame_id, getattr(messages[0], "child_frame_id", "")
    return MessageBlock(strings, stamp_ns, values)


def _block(whole: FloatArray, first: int | None) -> FloatArray:
    """Return (n, 9), the 3 x 3 block of (n, 36) that begins at row ``first``; None: the whole."""
    if first is None:
        return whole
    square = whole.reshape(len(whole), 6, 6)[:, first : first + 3, first : first + 3]
    return np.ascontiguousarray(square).reshape(len(whole), 9)


def _numbers(message: Any, part: MessagePart) -> Any:  # noqa: ANN401 - numbers
    value = attrgetter(part.path)(message)
    if part.count == 1 or isinstance(value, np.ndarray):
        return np.atleast_1d(value)
    return [getattr(value, axis) for axis in "xyzw"[: part.count]]
