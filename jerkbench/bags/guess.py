"""The role of each topic where the user named none: by type, content and rate."""

from collections.abc import Mapping

import numpy as np

from jerkbench.bags.roles import FIX, IMU, NONE, ODOMETRY, TWIST, Role, TopicPlan
from jerkbench.errors import RecordingError
from jerkbench.readers.ros.bag import Bag, Topic

SAMPLE = 200
"""So many messages of a topic are looked at."""

GRAVITY_BETWEEN_MPS2 = (5.0, 15.0)
"""Median length of the specific force of an IMU that feels gravity."""

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
    candidates = _most_first(bag, IMU)
    for topic in candidates:
        force = bag.read({topic.name: ["linear_acceleration"]}, most=SAMPLE)[topic.name]["linear_acceleration"]
        with np.errstate(over="ignore"):  # damage: the median does not mind
            length = float(np.median(np.linalg.norm(force, axis=1))) if len(force) else 0.0
        if GRAVITY_BETWEEN_MPS2[0] < length < GRAVITY_BETWEEN_MPS2[1]:
            return topic.name, _chose("IMU", topic, f"it feels {length:.2f} m/s2", candidates)
    names = ", ".join(topic.name for topic in candidates)
    raise RecordingError(
        f"{bag.path} has no IMU topic that feels gravity ({names or 'none of type sensor_msgs/Imu'}); give imu_topic."
    )


def _position(bag: Bag) -> tuple[str, str]:
    candidates = _most_first(bag, FIX)
    for topic in candidates:
        status = bag.read({topic.name: ["status"]})[topic.name]["status"]
        if (status >= 0).any():
            return topic.name, _chose("positions", topic, "it has fixes", candidates)
    raise RecordingError(
        f"{bag.path} has no topic with GNSS fixes (sensor_msgs/NavSatFix); give position_topic, an odometry in ECEF,"
        f" ENU or NED for example. There are: {', '.join(f'{t.name} ({t.msgtype})' for t in bag.topics)}."
    )


def _velocity(bag: Bag) -> tuple[str, str]:
    for msgtype in (TWIST, ODOMETRY):
        candidates = _most_first(bag, msgtype)
        if candidates:
            return candidates[0].name, _chose("velocities", candidates[0], "the most messages", candidates)
    return NONE, "No topic gives velocities (an odometry or a twist with covariance)."


def _most_first(bag: Bag, msgtype: str) -> list[Topic]:
    topics = [topic for topic in bag.topics if topic.msgtype == msgtype and topic.count]
    return sorted(topics, key=lambda topic: -topic.count)


def _chose(quantity: str, topic: Topic, why: str, candidates: list[Topic]) -> str:
    rejected = [candidate.name for candidate in candidates if candidate is not topic]
    more = f"; not {', '.join(rejected)}" if rejected else ""
    return f"Topic of the {quantity}, guessed: {topic.name} ({topic.count} messages; {why}{more})."
