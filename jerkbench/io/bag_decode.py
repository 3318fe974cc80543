"""Serialised messages -> arrays: by their fixed layout where they have one, else one after the other.

After its strings a message has the same bytes at the same places, so that equal strings make equal layouts. Whatever
does not fit (strings that change, another byte order) is left to the deserialiser of rosbags, which
`jerkbench.io.bag_decode` falls back on, and which the tests compare with.
"""

import re
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import FloatArray, IntArray

# Messages of a known type as arrays, by their fixed layout: numpy reads all of them at once.

_STRING = "string"


@dataclass(frozen=True)
class MessagePart:
    """A run of equal numbers in a message, or a string.

    Attributes:
        name: of the field in `Messages`.
        path: where the number is in the deserialised message.
        code: numpy's code of one number, or `STRING`.
        count: how many numbers.
    """

    name: str
    path: str
    code: str = "f8"
    count: int = 1


def _parts(text: str) -> tuple[MessagePart, ...]:
    """The parts of a message, each as ``path:code*count``, the name being the path's end, or ``name=path*count``."""
    found = [re.fullmatch(r"(?:(\w+)=)?([\w.]+)(?::(\w+))?(?:\*(\d+))?", part) for part in text.split()]
    return tuple(
        MessagePart(part[1] or part[2].rpartition(".")[2], part[2], part[3] or "f8", int(part[4] or 1))
        for part in found
        if part
    )


_POSE = "pose.pose.position*3 pose.pose.orientation*4 pose_covariance=pose.covariance*36"
_TWIST = "twist.twist.linear*3 twist.twist.angular*3 twist_covariance=twist.covariance*36"

LAYOUTS: dict[str, tuple[MessagePart, ...]] = {
    "sensor_msgs/msg/Imu": _parts(
        "orientation*4 orientation_covariance*9 angular_velocity*3 angular_velocity_covariance*9"
        " linear_acceleration*3 linear_acceleration_covariance*9"
    ),
    "sensor_msgs/msg/NavSatFix": _parts(
        "status.status:i1 status.service:u2 latitude longitude altitude position_covariance*9"
        " position_covariance_type:u1"
    ),
    "nav_msgs/msg/Odometry": _parts(f"child_frame_id:{_STRING} {_POSE} {_TWIST}"),
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
    parts = {part.name: part for part in LAYOUTS[msgtype] if part.code != _STRING}
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


def decode_grid(grid: npt.NDArray[np.uint8], msgtype: str, fields: Sequence[str], *, cdr: bool) -> MessageBlock | None:
    """Return the ``fields`` of messages (n, size) of equal length, n at least one; None where their layouts differ.

    Args:
        grid: the serialised messages.
        msgtype: one of `LAYOUTS`.
        fields: which are wanted.
        cdr: ROS 2's serialisation; else ROS 1's.
    """
    first, size = bytes(grid[0]), grid.shape[1]
    if cdr and first[:2] != b"\x00\x01":
        return None
    try:
        layout, strings, fixed = _layout(first, msgtype, cdr=cdr)
    except (struct.error, UnicodeDecodeError):
        return None
    if size - layout.itemsize not in range(4 if cdr else 1):  # CDR may pad the end
        return None
    if any((grid[:, begin:end] != grid[0, begin:end]).any() for begin, end in fixed):
        return None
    rows = np.ascontiguousarray(grid[:, : layout.itemsize]).view(layout)[:, 0]
    sources = {name: source_of(msgtype, name) for name in fields}
    values = {
        name: _block(rows[part.name].reshape(len(rows), -1), begins).astype(np.float64)
        for name, (part, begins) in sources.items()
    }
    stamp_ns = rows["sec"].astype(np.int64) * 1_000_000_000 + rows["nanosec"]
    return MessageBlock((strings[0], strings[1] if strings[1:] else ""), stamp_ns, values)


def _layout(first: bytes, msgtype: str, *, cdr: bool) -> tuple[np.dtype[Any], list[str], list[tuple[int, int]]]:
    """The places of the numbers, the strings, and the places of bytes that all messages must have in common."""
    base = 4 if cdr else 0  # the encapsulation; alignment counts from behind it
    at = base + (0 if cdr else 4)  # ROS 1 begins with a running number
    names, formats, offsets = ["sec", "nanosec"], ["<u4" if not cdr else "<i4", "<u4"], [at, at + 4]
    strings: list[str] = []
    fixed: list[tuple[int, int]] = [(0, base)] if cdr else []
    at += 8
    for part in (MessagePart("frame_id", "", _STRING), *LAYOUTS[msgtype]):
        width = 4 if part.code == _STRING else np.dtype(part.code).itemsize
        begin = base + -(-(at - base) // width) * width if cdr else at
        if part.code == _STRING:
            at = begin + 4 + int(struct.unpack_from("<I", first, begin)[0])
            if at > len(first):
                raise struct.error
            strings.append(first[begin + 4 : at].decode().rstrip("\0"))
            fixed.append((begin, at))
        else:
            names.append(part.name)
            formats.append(f"({part.count},)<{part.code}" if part.count > 1 else f"<{part.code}")
            offsets.append(begin)
            at = begin + part.count * width
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": at}), strings, fixed


Deserialise = Callable[[bytes, str], Any]
"""The deserialiser of rosbags: a message and its type -> an instance of a class made at run time."""


def decode(
    raw: Sequence[bytes], msgtype: str, fields: Sequence[str], deserialise: Deserialise, *, cdr: bool
) -> MessageBlock:
    """Return the ``fields`` of the messages, at least one, fast where their layout is fixed."""
    size, joined = len(raw[0]), b"".join(raw)
    block = None
    if size and len(joined) == size * len(raw):
        grid = np.frombuffer(joined, dtype=np.uint8).reshape(len(raw), size)
        block = decode_grid(grid, msgtype, fields, cdr=cdr)
    return block or decode_each(raw, msgtype, fields, deserialise)


def decode_each(raw: Sequence[bytes], msgtype: str, fields: Sequence[str], deserialise: Deserialise) -> MessageBlock:
    """Return the same with the ordinary deserialiser, message by message."""
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
