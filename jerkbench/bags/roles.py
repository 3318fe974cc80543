"""The roles of topics, and the fields of their messages that each role takes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from jerkbench.errors import RecordingError
from jerkbench.readers.ros.bag import Bag, Wanted

Role = Literal["imu", "position", "velocity", "heading", "reference"]
NONE = "none"
"""Given as a topic: use none for this role."""

IMU, FIX, ODOMETRY = "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix", "nav_msgs/msg/Odometry"
POSE, TWIST = "geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/TwistWithCovarianceStamped"
COORDINATES = ("status", "latitude", "longitude", "altitude", "position_covariance")
WHETHER_FUSED = ("position", "orientation")
"""Fields by which an odometry shows that it has not started yet."""

FIELDS: dict[Role, dict[str, tuple[str, ...]]] = {
    "imu": {IMU: ("angular_velocity", "linear_acceleration")},
    "position": {
        FIX: COORDINATES,
        ODOMETRY: (*WHETHER_FUSED, "position_covariance"),
        POSE: (*WHETHER_FUSED, "position_covariance"),
    },
    "velocity": {
        ODOMETRY: (*WHETHER_FUSED, "linear", "linear_covariance"),
        TWIST: ("linear", "linear_covariance"),
        "geometry_msgs/msg/TwistStamped": ("linear",),
        "geometry_msgs/msg/Vector3Stamped": ("linear",),
    },
    "heading": {
        IMU: ("orientation", "orientation_covariance"),
        ODOMETRY: (*WHETHER_FUSED, "orientation_covariance"),
    },
    "reference": {
        ODOMETRY: (*WHETHER_FUSED, "linear"),
        FIX: COORDINATES,
        POSE: WHETHER_FUSED,
        "geometry_msgs/msg/PoseStamped": WHETHER_FUSED,
    },
}
"""The fields that each role reads of each type."""


@dataclass(frozen=True)
class TopicPlan:
    """The topic of each role.

    Attributes:
        topics: role -> topic.
        notes: what was chosen, in sentences, where it was not given.
    """

    topics: Mapping[Role, str]
    notes: tuple[str, ...] = field(default=())

    def label(self, topic: str) -> str:
        """Return how the report calls a topic: its roles and its name."""
        return f"{', '.join(role for role, name in self.topics.items() if name == topic)} ({topic})"

    def roles(self, topic: str) -> tuple[Role, ...]:
        """Return the roles of a topic."""
        return tuple(role for role, name in self.topics.items() if name == topic)


def wanted_fields(plan: TopicPlan, bag: Bag) -> Wanted:
    """Return which fields of which topics the plan takes.

    Raises:
        RecordingError: there is no such topic, or its type cannot have the role.
    """
    wanted: dict[str, dict[str, None]] = {}
    for role, name in plan.topics.items():
        topic, types = bag.topic(name), FIELDS[role]
        if topic.msgtype not in types:
            raise RecordingError(
                f"{bag.path}: the topic {name} is of type {topic.msgtype}, which gives no {role}; {role}_topic must be"
                f" one of the types {', '.join(types)}: {_suitable(bag, tuple(types))}."
            )
        wanted.setdefault(name, {}).update(dict.fromkeys(types[topic.msgtype]))
    return {name: tuple(fields) for name, fields in wanted.items()}


def _suitable(bag: Bag, types: tuple[str, ...]) -> str:
    names = [topic.name for topic in bag.topics if topic.msgtype in types]
    return f"the bag has {', '.join(names)}" if names else "the bag has none of them"
