"""The roles of topics, the fields that each role takes, and the guess of a role by type, content and rate."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from jerkbench.errors import RecordingError
from jerkbench.io.bag import Bag, Messages, Topic, Wanted
from jerkbench.io.limits import MAX_LOCAL_M, UNDATED, off_earth, undated
from jerkbench.io.sanitiser import (
    MOST_MPS,
    MOST_MPS2,
    MOST_RADPS,
    Ledger,
    frozen_rows,
    ordered,
    report_gaps,
    unit_quaternions,
    usual_delay_ns,
    with_late_enough_stamps,
    without_impossible,
    without_no_fix,
)

Role = Literal["imu", "position", "velocity", "heading", "reference"]
ROLES: tuple[Role, ...] = get_args(Role)
NONE = "none"
"""Given as a topic: use none for this role."""

IMU, FIX, ODOMETRY = "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix", "nav_msgs/msg/Odometry"
_POSE, TWIST = "geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/TwistWithCovarianceStamped"
_COORDINATES = ("status", "latitude", "longitude", "altitude", "position_covariance")
WHETHER_FUSED = ("position", "orientation")
"""Fields by which an odometry shows that it has not started yet."""

_PLACES, _TURN = (*WHETHER_FUSED, "position_covariance"), "orientation_covariance"
_LINEAR = ("linear", "linear_covariance")
_BARE = {f"geometry_msgs/msg/{name}": ("linear",) for name in ("TwistStamped", "Vector3Stamped")}
_FIELDS: dict[Role, dict[str, tuple[str, ...]]] = {
    "imu": {IMU: ("angular_velocity", "linear_acceleration")},
    "position": {FIX: _COORDINATES, ODOMETRY: _PLACES, _POSE: _PLACES},
    "velocity": {ODOMETRY: (*WHETHER_FUSED, *_LINEAR), TWIST: _LINEAR} | _BARE,
    "heading": {IMU: ("orientation", _TURN), ODOMETRY: (*WHETHER_FUSED, _TURN)},
    "reference": {ODOMETRY: (*WHETHER_FUSED, "linear"), FIX: _COORDINATES}
    | dict.fromkeys((_POSE, "geometry_msgs/msg/PoseStamped"), WHETHER_FUSED),
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
        return f"{', '.join(self.roles(topic))} ({topic})"

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
        topic, types = bag.topic(name), _FIELDS[role]
        if topic.msgtype not in types:
            suitable = ", ".join(other.name for other in bag.topics if other.msgtype in types) or "none of them"
            raise RecordingError(
                f"{bag.path}: the topic {name} is of type {topic.msgtype}, which gives no {role}; {role}_topic must be"
                f" one of the types {', '.join(types)}: the bag has {suitable}."
            )
        wanted.setdefault(name, {}).update(dict.fromkeys(types[topic.msgtype]))
    return {name: tuple(fields) for name, fields in wanted.items()}


# The role of each topic where the user named none: by type, content and rate.

_SAMPLE = 200
"""So many messages of a topic are looked at."""

GRAVITY_BETWEEN_MPS2 = (5.0, 15.0)
"""Median length of the specific force of an IMU that feels gravity."""

ONE_G_WITHIN = 0.1
"""So near to 1 is that length where a driver publishes g."""

OF_FIXPOSITION = ("/poiimu", "/odometry_ecef")
LIKE_FIXPOSITION = (
    "The topics are called like a Fixposition's: dataset=fixposition knows the order of their covariances, and what is"
    " not independent."
)


def complete_plan(bag: Bag, named: Mapping[Role, str]) -> TopicPlan:
    """Return the plan with the topics that are ``named`` (topic, `NONE`, or empty: to be guessed).

    Raises:
        RecordingError: there is no IMU with gravity in it, or nothing that gives positions.
    """
    topics: dict[Role, str] = {}
    notes: list[str] = []
    for role in ("imu", "position", "velocity"):
        name = named.get(role, "")
        if not name:
            name, why = {"imu": _imu, "position": _position, "velocity": _velocity}[role](bag)
            notes.append(why)
        if name != NONE:
            topics[role] = name
    for more in ("heading", "reference"):
        if named.get(more, NONE) not in ("", NONE):
            topics[more] = named[more]
    if notes and any(topic.name.endswith(OF_FIXPOSITION) for topic in bag.topics):
        notes.append(LIKE_FIXPOSITION)
    return TopicPlan(topics, tuple(notes))


def _imu(bag: Bag) -> tuple[str, str]:
    candidates, in_g = _most_first(bag, IMU), []
    for topic in candidates:
        force = bag.read({topic.name: ["linear_acceleration"]}, most=_SAMPLE)[topic.name]["linear_acceleration"]
        with np.errstate(over="ignore"):  # damage: the median does not mind
            length = float(np.median(np.linalg.norm(force, axis=1))) if len(force) else 0.0
        if GRAVITY_BETWEEN_MPS2[0] < length < GRAVITY_BETWEEN_MPS2[1]:
            return _chose("IMU", topic, f"it feels {length:.2f} m/s2", candidates)
        if abs(length - 1.0) < ONE_G_WITHIN:
            in_g.append(_chose("IMU", topic, f"it feels {length:.2f}, which is gravity in g", candidates))
    if in_g:
        return in_g[0]
    names = ", ".join(topic.name for topic in candidates)
    raise RecordingError(
        f"{bag.path} has no IMU topic that feels gravity ({names or 'none of type sensor_msgs/Imu'}); give imu_topic."
    )


def _position(bag: Bag) -> tuple[str, str]:
    candidates = _most_first(bag, FIX)
    for topic in candidates:
        status = bag.read({topic.name: ["status"]})[topic.name]["status"]
        if (status >= 0).any():
            return _chose("positions", topic, "it has fixes", candidates)
    raise RecordingError(
        f"{bag.path} has no topic with GNSS fixes (sensor_msgs/NavSatFix); give position_topic, an odometry in ECEF,"
        f" ENU or NED for example. There are: {', '.join(f'{t.name} ({t.msgtype})' for t in bag.topics)}."
    )


def _velocity(bag: Bag) -> tuple[str, str]:
    for msgtype in (TWIST, ODOMETRY):
        candidates = _most_first(bag, msgtype)
        if candidates:
            return _chose("velocities", candidates[0], "the most messages", candidates)
    return NONE, "No topic gives velocities (an odometry or a twist with covariance)."


def _most_first(bag: Bag, msgtype: str) -> list[Topic]:
    topics = [topic for topic in bag.topics if topic.msgtype == msgtype and topic.count]
    return sorted(topics, key=lambda topic: -topic.count)


def _chose(quantity: str, topic: Topic, why: str, candidates: list[Topic]) -> tuple[str, str]:
    rejected = [candidate.name for candidate in candidates if candidate is not topic]
    more = f"; not {', '.join(rejected)}" if rejected else ""
    return topic.name, f"Topic of the {quantity}, guessed: {topic.name} ({topic.count} messages; {why}{more})."


# Every topic through the sanitiser: stamps first, then the values that its roles use.

EARTH_RADIUS_M = (6.3e6, 6.4e6)
"""Distances [m] of the Earth's surface from its centre; positions between them are in ECEF."""


def clean_topics(
    raw: dict[str, Messages], plan: TopicPlan, ledger: Ledger, earliest_ns: int, *, bag_time: bool
) -> dict[str, Messages]:
    """Return the messages of each topic with good stamps and possible values; takes them out of ``raw``.

    Raises:
        RecordingError: nothing of a topic is left, or the mode is "refuse" and something is wrong.
    """
    delays = [usual_delay_ns(messages, earliest_ns) for messages in raw.values()]
    usual = [delay for delay in delays if delay is not None]
    offset_ns = int(np.median(usual)) if usual else None
    clean = {}
    for topic in list(raw):
        messages, label = raw.pop(topic), plan.label(topic)
        if bag_time:
            messages = messages.stamped(messages.bag_ns)
        else:
            messages = with_late_enough_stamps(label, messages, ledger, earliest_ns, offset_ns)
        messages = ledger.drop(label, messages, UNDATED, undated(messages.stamp_ns))
        messages = ordered(label, _possible(label, messages, plan, ledger), ledger)
        report_gaps(label, messages, ledger)
        if len(messages) < 2:
            findings = " ".join(str(f) for f in ledger.findings if f.stream == label) or "It has no more messages."
            raise RecordingError(
                f"{label}: {len(messages)} usable messages are left; at least 2 are needed. {findings}"
            )
        clean[topic] = messages
    return clean


def is_ecef(position_m: np.ndarray) -> bool:
    """Whether positions (n, 3) [m] are in ECEF, by their distance from the Earth's centre."""
    with np.errstate(over="ignore"):
        radius_m = np.median(np.linalg.norm(position_m, axis=1)) if len(position_m) else 0.0
    return bool(EARTH_RADIUS_M[0] < radius_m < EARTH_RADIUS_M[1])


def _possible(label: str, messages: Messages, plan: TopicPlan, ledger: Ledger) -> Messages:
    if messages.msgtype == IMU and "imu" in plan.roles(messages.topic):
        limits = [("linear_acceleration", MOST_MPS2), ("angular_velocity", MOST_RADPS)]
        messages = without_impossible(label, messages, ledger, limits)
        return ledger.drop(label, messages, "a frozen angular rate", frozen_rows(messages["angular_velocity"]))
    if "latitude" in messages.values:
        return without_no_fix(label, messages, ledger)
    if "position" in messages.values:
        messages = without_impossible(label, messages, ledger, [("position", MAX_LOCAL_M)])
        unit = unit_quaternions(messages["orientation"])
        if unit.any():  # else it never gives any
            messages = ledger.drop(label, messages, "an orientation that is no unit quaternion", ~unit)
        if is_ecef(messages["position"]):
            off = off_earth(messages["position"], "ecef")
            messages = ledger.drop(label, messages, "an ECEF position that is not on Earth", off)
    if "linear" in messages.values:
        messages = without_impossible(label, messages, ledger, [("linear", MOST_MPS)])
    return messages
