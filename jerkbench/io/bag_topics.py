"""The role of each topic of a bag, which is set by the user, stored by jerkbench's writer, or guessed."""

import json
import re
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
    Topic,
)
from jerkbench.io.sanitiser import UNDATED, require_origin, undated

Role = Literal["imu", "position", "velocity", "heading", "reference"]
ROLES: tuple[Role, ...] = get_args(Role)
HeadingSource = Literal["dual_antenna", "odometry", "course"]
NONE = "none"
"""Value of a topic parameter if no topic has the role."""

_COORDINATES = ("status", "latitude", "longitude", "altitude", "position_covariance")
_POSE = ("position", "orientation")
"""Fields that are zero in the messages of an odometry that has not started."""

_PLACES, _LINEAR = (*_POSE, "position_covariance"), ("linear", "linear_covariance")
_FIELDS: dict[Role, dict[str, tuple[str, ...]]] = {
    "imu": {IMU: ("angular_velocity", "linear_acceleration")},
    "position": {FIX: _COORDINATES, ODOMETRY: _PLACES, POSE_COVARIANCE: _PLACES},
    "velocity": {ODOMETRY: (*_POSE, *_LINEAR), TWIST_COVARIANCE: _LINEAR, TWIST: ("linear",), VECTOR: ("linear",)},
    "heading": {IMU: ("orientation", "orientation_covariance"), ODOMETRY: (*_POSE, "orientation_covariance")},
    "reference": {ODOMETRY: (*_POSE, "linear"), FIX: _COORDINATES, POSE_COVARIANCE: _POSE, POSE: _POSE},
}
"""Fields that are read for each role from each message type."""


@dataclass(frozen=True)
class TopicPlan:
    """The topic of each role, and the frames and sources of the topics.

    Attributes:
        topics: name of the topic of each role.
        notes: notes about guessed topics, with the reason for each guess.
        covariance_order: order of the axes in the covariances of fixes, either enu or neu.
        position_frame: frame of positions that are poses: auto, ecef, enu or ned.
        velocity_frame: frame of the velocities: body, course, frd, enu, ned or speed.
        reference_frame: frame of reference positions that are poses: auto, ecef, enu or ned.
        heading_source: the sensor that measured the headings.
        reference_source: source of the reference as a phrase, or an empty string to use the name of the topic.
        reference_independent: whether the reference is independent of the measurements.
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
        """Return the roles and the name of a topic as text, for messages."""
        return f"{', '.join(self.roles(topic))} ({topic})"

    def roles(self, topic: str) -> tuple[Role, ...]:
        """Return all roles to which a topic is assigned."""
        return tuple(role for role, name in self.topics.items() if name == topic)

    def fields(self, bag: Bag) -> dict[str, tuple[str, ...]]:
        """Return the names of the message fields that are read from each topic.

        Raises:
            RecordingError: a topic does not exist, or the message type of the topic does not support its role.
        """
        wanted: dict[str, dict[str, None]] = {}
        for role, name in self.topics.items():
            topic, types = bag.topic(name), _FIELDS[role]
            if topic.msgtype not in types:
                suitable = ", ".join(other.name for other in bag.topics if other.msgtype in types) or "none"
                raise RecordingError(
                    f"{bag.path}: the topic {name} has the type {topic.msgtype}, which contains no {role}. Set"
                    f" {role}_topic to a topic of the type {' or '.join(types)}. Topics of these types: {suitable}."
                )
            wanted.setdefault(name, {}).update(dict.fromkeys(types[topic.msgtype]))
        return {name: tuple(fields) for name, fields in wanted.items()}


# The metadata of a recording, which jerkbench writes as JSON, because no ROS message has fields for such metadata.

METADATA_TOPIC = "/jerkbench/about"
_OF_PLAN = ("covariance_order", "heading_source", "reference_independent", "reference_source", "velocity_frame")


@dataclass(frozen=True)
class Metadata:
    """The metadata that `jerkbench data convert` writes with the measurements.

    Attributes:
        name: name of the recording.
        start_ns: UTC at t_s = 0, in nanoseconds since 1970.
        static_start_s: duration for which the vehicle is stationary at the start [s].
        origin: latitude [deg], longitude [deg] and height [m] of the origin of ENU, or empty if unknown.
        outages_s: start and end of each interval without position fixes [s].
        plan: roles, frames and sources of the written topics.
    """

    name: str
    start_ns: int
    static_start_s: float
    origin: tuple[float, ...]
    outages_s: tuple[tuple[float, float], ...]
    plan: TopicPlan

    @classmethod
    def of(cls, bag: Bag) -> Self | None:
        """Return the metadata in a bag, or None if the bag has no metadata.

        Raises:
            RecordingError: the topic with the metadata is damaged.
        """
        if not any(topic.name == METADATA_TOPIC and topic.msgtype == STRING and topic.count for topic in bag.topics):
            return None
        text = bag.text(METADATA_TOPIC)
        try:
            return cls.from_plain(json.loads(text))
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise RecordingError(
                f"{bag.path}: the topic {METADATA_TOPIC} is damaged ({type(error).__name__}); create the bag again."
            ) from error

    @classmethod
    def from_plain(cls, values: dict[str, Any]) -> Self:
        """Return the metadata from parsed JSON.

        Raises:
            ValueError, TypeError, KeyError, AttributeError: an entry is missing or has a wrong type.
        """
        topics = {str(role): str(topic) for role, topic in values["topics"].items()}
        origin = tuple(float(value) for value in values["origin"])
        require_origin(METADATA_TOPIC, origin)
        start_ns = int(values["start_ns"])
        if undated(start_ns):
            raise ValueError(UNDATED)
        outages_s = tuple((float(start), float(end)) for start, end in values["outages_s"])
        plan = TopicPlan(topics, **{name: values[name] for name in _OF_PLAN})  # type: ignore[arg-type]  # see `fields`
        return cls(values["name"], start_ns, float(values["static_start_s"]), origin, outages_s, plan)

    def to_json(self) -> str:
        """Return the metadata as JSON, which is the content of the message."""
        values = vars(self) | {name: getattr(self.plan, name) for name in ("topics", *_OF_PLAN)}
        return json.dumps({name: value for name, value in values.items() if name != "plan"}, sort_keys=True)


# Functions that guess the topic of a role.

_SAMPLE = 200
"""Number of messages that are read to guess a role."""

GRAVITY_BETWEEN_MPS2 = (5.0, 15.0)
"""Range of the median norm of the specific force of an IMU that measures gravity."""

ONE_G_WITHIN = 0.1
"""Maximum difference between the median norm of the specific force and 1 for an IMU that measures in g."""

OF_FIXPOSITION = ("/poiimu", "/odometry_ecef")
LIKE_FIXPOSITION = (
    "The topics have the names of a Fixposition: use dataset=fixposition, which uses the correct order of covariances"
    " and marks the topics that are not independent."
)

EARTH_RADIUS_M = (6.3e6, 6.4e6)
"""Range of the median distance from the centre of the Earth [m] in which positions are regarded as ECEF."""


def is_ecef(position_m: FloatArray) -> bool:
    """Return whether positions (n, 3) [m] are in ECEF: their median norm is close to the Earth's radius."""
    with np.errstate(over="ignore"):
        radius_m = np.median(np.linalg.norm(position_m, axis=1)) if len(position_m) else 0.0
    return bool(EARTH_RADIUS_M[0] < radius_m < EARTH_RADIUS_M[1])


_TRUTH = re.compile(r"(?:^|[/_])(?:gt|truth|ground_?truth)(?:[/_]|$)")
"""Names of topics with a reference. Such a topic is guessed as a measurement only if there is no other topic."""


def guessed_topics(bag: Bag, named: Mapping[Role, str]) -> tuple[dict[Role, str], tuple[str, ...]]:
    """Return the topic of each role, and a note for each guessed topic.

    The topic of the reference is never guessed as the topic of a measurement.

    Args:
        bag: the open bag.
        named: for each role, the name of its topic, `NONE` for no topic, or an empty string to guess the topic. The
            topics of heading and reference are never guessed.

    Raises:
        RecordingError: no IMU measures gravity, or no topic has positions.
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
    truths = [topic.name for topic in bag.topics if _TRUTH.search(topic.name) and topic.msgtype in _FIELDS["reference"]]
    if truths and "reference" not in topics:
        notes.append(f"The name of {truths[0]} suggests a reference; if it is one, set reference_topic={truths[0]}.")
    if notes and any(topic.name.endswith(OF_FIXPOSITION) for topic in bag.topics):
        notes.append(LIKE_FIXPOSITION)
    return topics, tuple(notes)


def _imu(bag: Bag, _: str) -> tuple[str, str]:
    candidates, in_g = _by_count(bag, IMU, ""), []
    for topic in candidates:
        force = bag.first(topic.name, "linear_acceleration", _SAMPLE)
        with np.errstate(over="ignore"):  # damaged values may cause an overflow
            length = float(np.median(np.linalg.norm(force, axis=1))) if len(force) else 0.0
        if GRAVITY_BETWEEN_MPS2[0] < length < GRAVITY_BETWEEN_MPS2[1]:
            return _guessed_topic("IMU", topic, f"it measures {length:.2f} m/s2", candidates)
        if abs(length - 1.0) < ONE_G_WITHIN:
            in_g.append(_guessed_topic("IMU", topic, f"it measures {length:.2f}, which is gravity in g", candidates))
    if in_g:
        return in_g[0]
    names = ", ".join(topic.name for topic in candidates)
    raise RecordingError(
        f"{bag.path} has no IMU topic that measures gravity (IMU topics: {names or 'none'}); set imu_topic."
    )


def _position(bag: Bag, reference: str) -> tuple[str, str]:
    candidates = _by_count(bag, FIX, reference)
    for topic in candidates:
        if (bag.read({topic.name: _COORDINATES})[topic.name]["status"] >= 0).any():
            return _guessed_topic("positions", topic, "it has fixes", candidates)
    raise RecordingError(
        f"{bag.path} has no topic with GNSS fixes (sensor_msgs/NavSatFix); set position_topic, for example to an"
        f" odometry in ECEF, ENU or NED. Topics: {', '.join(f'{t.name} ({t.msgtype})' for t in bag.topics)}."
    )


def _velocity(bag: Bag, reference: str) -> tuple[str, str]:
    for msgtype in (TWIST_COVARIANCE, ODOMETRY):
        candidates = _by_count(bag, msgtype, reference)
        for topic in candidates:
            if bag.read({topic.name: ("linear",)})[topic.name]["linear"].any():  # some nodes leave this field at 0
                return _guessed_topic("velocities", topic, "the most messages", candidates)
    return NONE, "No topic gives velocities (an odometry or a twist with covariance)."


def _by_count(bag: Bag, msgtype: str, reference: str) -> list[Topic]:
    topics = [topic for topic in bag.topics if topic.msgtype == msgtype and topic.count and topic.name != reference]
    return sorted(topics, key=lambda topic: (bool(_TRUTH.search(topic.name)), -topic.count))


def _guessed_topic(quantity: str, topic: Topic, why: str, candidates: list[Topic]) -> tuple[str, str]:
    rejected = [candidate.name for candidate in candidates if candidate is not topic]
    more = f"; not {', '.join(rejected)}" if rejected else ""
    return topic.name, f"Topic of the {quantity}, guessed: {topic.name} ({topic.count} messages; {why}{more})."
