"""The role of each topic of a bag: named by the user, stored by our own writer, or guessed."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Self, get_args

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.io.bag import (
    FIX,
    IMU,
    ODOMETRY,
    POSE,
    POSE_COVARIANCE,
    STRING,
    TWIST,
    TWIST_COVARIANCE,
    VECTOR,
    Bag,
    BagError,
    Topic,
)
from jerkbench.io.sanitiser import UNDATED, require_origin, undated

Role = Literal["imu", "position", "velocity", "heading", "reference"]
ROLES: tuple[Role, ...] = get_args(Role)
HeadingSource = Literal["dual_antenna", "odometry"]
NONE = "none"
"""Given as a topic: no topic has this role."""

_COORDINATES = ("status", "latitude", "longitude", "altitude", "position_covariance")
_POSE = ("position", "orientation")
"""An odometry that has not started yet shows it in these fields."""

_PLACES, _LINEAR = (*_POSE, "position_covariance"), ("linear", "linear_covariance")
_FIELDS: dict[Role, dict[str, tuple[str, ...]]] = {
    "imu": {IMU: ("angular_velocity", "linear_acceleration")},
    "position": {FIX: _COORDINATES, ODOMETRY: _PLACES, POSE_COVARIANCE: _PLACES},
    "velocity": {ODOMETRY: (*_POSE, *_LINEAR), TWIST_COVARIANCE: _LINEAR, TWIST: ("linear",), VECTOR: ("linear",)},
    "heading": {IMU: ("orientation", "orientation_covariance"), ODOMETRY: (*_POSE, "orientation_covariance")},
    "reference": {ODOMETRY: (*_POSE, "linear"), FIX: _COORDINATES, POSE_COVARIANCE: _POSE, POSE: _POSE},
}
"""The fields that each role reads of each type."""


@dataclass(frozen=True)
class TopicPlan:
    """The topic of each role, and how the topics are to be understood.

    Attributes:
        topics: the topic of each role.
        notes: which topics were guessed, and why.
        covariance_order: of the position's covariances: enu or neu.
        position_frame: frame of the position's poses: auto, ecef, enu or ned.
        velocity_frame: body, course, frd, enu, ned or speed.
        reference_frame: frame of the reference's poses.
        heading_source: the sensor that measured the headings.
        reference_source: where the reference comes from; empty: its topic.
        reference_independent: whether the reference shares nothing with the measurements.
    """

    topics: Mapping[Role, str]
    notes: tuple[str, ...] = ()
    covariance_order: str = "enu"
    position_frame: str = "auto"
    velocity_frame: str = "body"
    reference_frame: str = "auto"
    heading_source: HeadingSource = "odometry"
    reference_source: str = ""
    reference_independent: bool = False

    def label(self, topic: str) -> str:
        """Return the roles and the name of a topic."""
        return f"{', '.join(self.roles(topic))} ({topic})"

    def roles(self, topic: str) -> tuple[Role, ...]:
        """Return the roles of a topic."""
        return tuple(role for role, name in self.topics.items() if name == topic)

    def fields(self, bag: Bag) -> dict[str, tuple[str, ...]]:
        """Return which fields of which topics are read.

        Raises:
            RecordingError: there is no such topic, or its type cannot have the role.
        """
        wanted: dict[str, dict[str, None]] = {}
        for role, name in self.topics.items():
            topic, types = bag.topic(name), _FIELDS[role]
            if topic.msgtype not in types:
                suitable = ", ".join(other.name for other in bag.topics if other.msgtype in types) or "none of them"
                raise RecordingError(
                    f"{bag.path}: the topic {name} is of type {topic.msgtype}, which gives no {role}; {role}_topic must"
                    f" be one of the types {', '.join(types)}: the bag has {suitable}."
                )
            wanted.setdefault(name, {}).update(dict.fromkeys(types[topic.msgtype]))
        return {name: tuple(fields) for name, fields in wanted.items()}


# The metadata that our own writer adds as JSON, since no ROS message holds them.

METADATA_TOPIC = "/jerkbench/about"


@dataclass(frozen=True)
class Metadata:
    """The metadata that `jerkbench data convert` writes with the measurements.

    Attributes:
        name: of the recording.
        start_ns: time 0, nanoseconds since 1970.
        static_start_s: how long the vehicle is stationary at the start.
        origin: latitude [deg], longitude [deg], height [m]; empty where unknown.
        reference_source: where the reference comes from.
        reference_independent: whether it shares nothing with the measurements.
        outages_s: intervals without aiding.
        topics: role -> topic.
        velocity_frame: frame of the velocity.
        heading_source: the sensor that measured the headings.
        covariance_order: of the fixes: neu or enu.
    """

    name: str
    start_ns: int
    static_start_s: float
    origin: tuple[float, ...]
    reference_source: str
    reference_independent: bool
    outages_s: tuple[tuple[float, float], ...]
    topics: dict[str, str]
    velocity_frame: str
    heading_source: str
    covariance_order: str

    @classmethod
    def of(cls, bag: Bag) -> Self | None:
        """Return the metadata in a bag, or None if it has none.

        Raises:
            BagError: the topic exists and is damaged.
        """
        if not any(topic.name == METADATA_TOPIC and topic.msgtype == STRING and topic.count for topic in bag.topics):
            return None
        text = bag.text(METADATA_TOPIC)
        try:
            return cls.from_plain(json.loads(text))
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise BagError(
                f"{bag.path}, topic {METADATA_TOPIC} is damaged ({type(error).__name__}); convert the recording once"
                " more."
            ) from error

    @classmethod
    def from_plain(cls, values: dict[str, Any]) -> Self:
        """Return the metadata from parsed JSON.

        Raises:
            ValueError, TypeError, KeyError, AttributeError: something is missing or of another type.
        """
        topics = {str(role): str(topic) for role, topic in values["topics"].items()}
        origin = tuple(float(value) for value in values["origin"])
        require_origin(METADATA_TOPIC, origin)
        times = {"start_ns": int(values["start_ns"]), "static_start_s": float(values["static_start_s"])}
        if undated(times["start_ns"]):
            raise ValueError(UNDATED)
        outages_s = tuple((float(start), float(end)) for start, end in values["outages_s"])
        return cls(**{**values, **times, "topics": topics, "origin": origin, "outages_s": outages_s})

    def to_json(self) -> str:
        """Return the content of the message."""
        return json.dumps(vars(self), sort_keys=True)

    @property
    def plan(self) -> TopicPlan:
        """The plan that reads the bag as it was written."""
        return TopicPlan(
            topics=self.topics,  # type: ignore[arg-type]  # unknown roles and types are errors of `fields`
            covariance_order=self.covariance_order,
            velocity_frame=self.velocity_frame,
            heading_source=self.heading_source,  # type: ignore[arg-type]  # checked by Heading
            reference_source=self.reference_source,
            reference_independent=self.reference_independent,
        )


# The guess.

_SAMPLE = 200
"""Number of messages that are read to guess a role."""

GRAVITY_BETWEEN_MPS2 = (5.0, 15.0)
"""Median length of the specific force of an IMU that feels gravity."""

ONE_G_WITHIN = 0.1
"""Tolerance of that length around 1, where a driver publishes g."""

OF_FIXPOSITION = ("/poiimu", "/odometry_ecef")
LIKE_FIXPOSITION = (
    "The topics are called like a Fixposition's: dataset=fixposition knows the order of their covariances, and what is"
    " not independent."
)

EARTH_RADIUS_M = (6.3e6, 6.4e6)
"""Distances [m] of the Earth's surface from its centre; positions between them are in ECEF."""


def is_ecef(position_m: FloatArray) -> bool:
    """Whether positions (n, 3) [m] are in ECEF, by their distance from the Earth's centre."""
    with np.errstate(over="ignore"):
        radius_m = np.median(np.linalg.norm(position_m, axis=1)) if len(position_m) else 0.0
    return bool(EARTH_RADIUS_M[0] < radius_m < EARTH_RADIUS_M[1])


def guessed_topics(bag: Bag, named: Mapping[Role, str]) -> tuple[dict[Role, str], tuple[str, ...]]:
    """Return the topic of each role, and notes on those that were guessed.

    A topic with the role of the reference is never guessed as a measurement.

    Args:
        bag: the bag.
        named: the topic of each role, `NONE`, or empty if it is to be guessed (heading and reference never are).

    Raises:
        RecordingError: there is no IMU that feels gravity, or no topic with positions.
    """
    topics: dict[Role, str] = {}
    notes: list[str] = []
    guesses = {"imu": _imu, "position": _position, "velocity": _velocity}
    for role in ROLES:
        name = named.get(role, "")
        if not name and role in guesses:
            name, why = guesses[role](bag, named.get("reference", ""))
            notes.append(why)
        if name not in ("", NONE):
            topics[role] = name
    if notes and any(topic.name.endswith(OF_FIXPOSITION) for topic in bag.topics):
        notes.append(LIKE_FIXPOSITION)
    return topics, tuple(notes)


def _imu(bag: Bag, _: str) -> tuple[str, str]:
    candidates, in_g = _by_count(bag, IMU, ""), []
    for topic in candidates:
        force = bag.first(topic.name, "linear_acceleration", _SAMPLE)
        with np.errstate(over="ignore"):  # damaged values do not change the median
            length = float(np.median(np.linalg.norm(force, axis=1))) if len(force) else 0.0
        if GRAVITY_BETWEEN_MPS2[0] < length < GRAVITY_BETWEEN_MPS2[1]:
            return _chosen("IMU", topic, f"it feels {length:.2f} m/s2", candidates)
        if abs(length - 1.0) < ONE_G_WITHIN:
            in_g.append(_chosen("IMU", topic, f"it feels {length:.2f}, which is gravity in g", candidates))
    if in_g:
        return in_g[0]
    names = ", ".join(topic.name for topic in candidates)
    raise RecordingError(
        f"{bag.path} has no IMU topic that feels gravity ({names or 'none of type sensor_msgs/Imu'}); give imu_topic."
    )


def _position(bag: Bag, reference: str) -> tuple[str, str]:
    candidates = _by_count(bag, FIX, reference)
    for topic in candidates:
        if (bag.read({topic.name: _COORDINATES})[topic.name]["status"] >= 0).any():
            return _chosen("positions", topic, "it has fixes", candidates)
    raise RecordingError(
        f"{bag.path} has no topic with GNSS fixes (sensor_msgs/NavSatFix); give position_topic, an odometry in ECEF,"
        f" ENU or NED for example. There are: {', '.join(f'{t.name} ({t.msgtype})' for t in bag.topics)}."
    )


def _velocity(bag: Bag, reference: str) -> tuple[str, str]:
    for msgtype in (TWIST_COVARIANCE, ODOMETRY):
        if candidates := _by_count(bag, msgtype, reference):
            return _chosen("velocities", candidates[0], "the most messages", candidates)
    return NONE, "No topic gives velocities (an odometry or a twist with covariance)."


def _by_count(bag: Bag, msgtype: str, reference: str) -> list[Topic]:
    topics = [topic for topic in bag.topics if topic.msgtype == msgtype and topic.count and topic.name != reference]
    return sorted(topics, key=lambda topic: -topic.count)


def _chosen(quantity: str, topic: Topic, why: str, candidates: list[Topic]) -> tuple[str, str]:
    rejected = [candidate.name for candidate in candidates if candidate is not topic]
    more = f"; not {', '.join(rejected)}" if rejected else ""
    return topic.name, f"Topic of the {quantity}, guessed: {topic.name} ({topic.count} messages; {why}{more})."
