"""A topic of a ROS bag -> the trajectory that a node has published."""

from datetime import timedelta
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.external.trajectory import Trajectory
from jerkbench.geometry import dcm_from_quaternion, euler_from_dcm
from jerkbench.readers.gpst import UNIX_EPOCH
from jerkbench.readers.ros.bag import Bag, open_bag
from jerkbench.readers.ros.messages import Messages
from jerkbench.recording import Recording
from jerkbench.writers.ros_bag import SOMETIME

BAGS = (".bag", ".db3", ".mcap")
"""Endings of bags."""

ODOMETRY = "nav_msgs/msg/Odometry"
POSES = ("geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/PoseStamped")
POSE = ("position", "orientation")
FIELDS = {
    ODOMETRY: (*POSE, "linear", "position_covariance", "linear_covariance"),
    POSES[0]: (*POSE, "position_covariance"),
    POSES[1]: POSE,
}
"""What is read of each type."""


def read_odometry(path: Path, topic: str, recording: Recording) -> Trajectory:
    """Read what a node has published: poses in the recording's ENU, the twist in the body, with their covariances.

    Args:
        path: the bag.
        topic: its name; empty: the only odometry of the bag.
        recording: what the node has run over; where nobody knows when it began, an exported bag begins in 2020.

    Raises:
        RecordingError: there is no such topic, it has no poses, or its stamps do not increase.
    """
    with open_bag(path) as bag:
        name = topic or _only_odometry(bag)
        msgtype = bag.topic(name).msgtype
        if msgtype not in FIELDS:
            raise RecordingError(
                f"{path}: {name} is a {msgtype}; name a topic of Odometry or of poses: filter.topic=..."
            )
        messages = bag.read({name: FIELDS[msgtype]})[name]
    where = f"{path}, {name}"
    t_s = _seconds(where, messages, recording)
    dcm = dcm_from_quaternion(messages["orientation"])
    velocity = np.einsum("nij,nj->ni", dcm, messages["linear"]) if msgtype == ODOMETRY else None
    return Trajectory(where, t_s, messages["position"], velocity, euler_from_dcm(dcm), _covariance(messages, dcm))


def _only_odometry(bag: Bag) -> str:
    names = [topic.name for topic in bag.topics if topic.msgtype == ODOMETRY]
    if len(names) != 1:
        raise RecordingError(
            f"{bag.path} has {len(names)} topics of {ODOMETRY}{': ' if names else ''}{', '.join(names)}; name the one "
            "to score: filter.topic=..."
        )
    return names[0]


def _seconds(where: str, messages: Messages, recording: Recording) -> FloatArray:
    since = (recording.start_utc or SOMETIME) - UNIX_EPOCH
    start_ns = since // timedelta(microseconds=1) * 1000
    steps = np.diff(messages.stamp_ns)
    if (steps <= 0).any():
        count = int((steps <= 0).sum())
        raise RecordingError(
            f"{where}: {count} of {len(messages)} messages are not later than the one before; publish each stamp once."
        )
    return np.asarray((messages.stamp_ns - start_ns) * 1e-9)


def _covariance(messages: Messages, dcm: FloatArray) -> FloatArray | None:
    """(n, 6, 6) in ENU; between position and velocity a message has none: zero; all zeros mean that it has nothing."""
    if not np.any(messages.values.get("position_covariance", np.zeros(1))):
        return None
    n = len(messages)
    covariance = np.full((n, 6, 6), np.nan)
    covariance[:, :3, :3] = messages["position_covariance"].reshape(n, 3, 3)
    if np.any(messages.values.get("linear_covariance", np.zeros(1))):
        covariance[:, :3, 3:] = covariance[:, 3:, :3] = 0.0
        covariance[:, 3:, 3:] = dcm @ messages["linear_covariance"].reshape(n, 3, 3) @ np.swapaxes(dcm, 1, 2)
    return covariance
