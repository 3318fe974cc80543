"""The topics of the Fixposition Vision-RTK 2 driver, versions 4 to 8."""

import numpy as np

from jerkbench.bags.cleaning import is_ecef
from jerkbench.bags.roles import FIX, IMU, ODOMETRY, Role, TopicPlan
from jerkbench.errors import RecordingError
from jerkbench.readers.ros.bag import Bag, Topic

ODOMETRIES = ("odometry_ecef", "odometry")
"""Last part of the topic with the fusion in ECEF: of drivers from 6.2 on, and before."""

IMUS = ("poiimu", "corrimu", "rawimu")
FUSED_FIX = "navsatfix"
"""Drivers before 6.1 publish no antenna, only the fusion's own position."""


def find_odometry(bag: Bag, namespace: str) -> Topic:
    """Return the topic with the fusion's solution in ECEF.

    Raises:
        RecordingError: there is none; says which topics there are.
    """
    odometries = [t for t in bag.topics if t.msgtype == ODOMETRY and t.count and _fits(t.name, namespace, ODOMETRIES)]
    odometries.sort(key=lambda topic: ODOMETRIES.index(_last(topic.name)))
    for topic in odometries:
        position = bag.read({topic.name: ["position"]})[topic.name]["position"]
        if is_ecef(position[np.abs(position).max(axis=1) > 0]):  # before the fusion starts it may write zeros
            return topic
    listing = ", ".join(f"{topic.name} ({topic.msgtype})" for topic in bag.topics)
    reason = (
        f"{odometries[0].name} is not in ECEF"
        if odometries
        else f"no nav_msgs/Odometry ends in {' or '.join(ODOMETRIES)}"
    )
    raise RecordingError(
        f"{bag.path} is no Fixposition recording: {reason}. There are: {listing}. Give namespace, or read it with"
        " dataset=rosbag."
    )


def plan_topics(bag: Bag, namespace: str, imu: str, gnss: str, *, velocity: bool, heading: bool) -> TopicPlan:
    """Return which topic has which role, with notes about the generation of the driver.

    Raises:
        RecordingError: odometry, IMU or positions are missing.
    """
    odometry = find_odometry(bag, namespace).name
    space = odometry.rsplit("/", 1)[0]
    topics: dict[Role, str] = {"imu": _require_topic(bag, space, imu, IMU, "imu")}
    notes = []
    if not _has(bag, f"{space}/{gnss}") and _has(bag, f"{space}/{FUSED_FIX}"):
        topics["position"] = f"{space}/{FUSED_FIX}"
        notes.append(
            f"The driver published no {space}/{gnss} (older than 6.1): positions are {space}/{FUSED_FIX}, the"
            " sensor's own fusion, the same as the reference."
        )
    else:
        topics["position"] = _require_topic(bag, space, gnss, FIX, "gnss")
    if velocity:
        topics["velocity"] = odometry
    if heading:
        topics["heading"] = odometry
    topics["reference"] = odometry
    return TopicPlan(topics, tuple(notes))


def _require_topic(bag: Bag, space: str, name: str, msgtype: str, parameter: str) -> str:
    """Return the topic ``space/name``; without one, raise an error that lists the topics of that type."""
    if _has(bag, f"{space}/{name}"):
        return f"{space}/{name}"
    suitable = [t.name for t in bag.topics if t.msgtype == msgtype and t.count]
    raise RecordingError(
        f"{bag.path} has no messages in {space}/{name}; of its type it has {', '.join(suitable) or 'no topic'}: give"
        f" {parameter}, the last part of the topic's name."
    )


def _has(bag: Bag, name: str) -> bool:
    return any(topic.name == name and topic.count for topic in bag.topics)


def _fits(name: str, namespace: str, last: tuple[str, ...]) -> bool:
    return _last(name) in last and (not namespace or name.startswith(f"/{namespace.strip('/')}/"))


def _last(name: str) -> str:
    return name.rsplit("/", 1)[-1]
