"""Data sets that read ROS bags: any bag, with specified or guessed topics, and bags of a Fixposition Vision-RTK 2."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from jerkbench.arrays import require_choices
from jerkbench.errors import RecordingError, require_known
from jerkbench.io.bag import FIX, IMU, ODOMETRY, TWIST_COVARIANCE, Bag, Topic
from jerkbench.io.bag_dataset import POSE_FRAMES, VELOCITY_FRAMES, BagDataset
from jerkbench.io.bag_topics import ROLE_FIELDS, ROLES, Role, TopicPlan, is_ecef
from jerkbench.plugins import register


@register("dataset", "rosbag")
@dataclass(frozen=True)
class RosBag(BagDataset):
    """A ROS 1 or ROS 2 bag with an IMU and positions, whose topics are guessed or given by parameters.

    Topics that are not specified are guessed. The guessed IMU topic is the topic with the most messages among the IMU
    topics that measure gravity. The guessed position topic has the type NavSatFix and contains valid fixes. The guessed
    velocity topic is the twist with covariance that has the most messages, or the odometry with the most messages if
    such a twist does not exist. The notes of the recording list the guessed topics. The topics of heading and reference
    are never guessed. The supported types are Imu, NavSatFix, Odometry, Pose(WithCovariance)Stamped,
    Twist(WithCovariance)Stamped and Vector3Stamped.

    Attributes:
        imu_topic: topic of angular rate and specific force, or empty to guess the topic.
        position_topic: topic of fixes, or of poses in ``position_frame``; empty to guess the topic, "none" for no
            positions.
        velocity_topic: topic of velocities in ``velocity_frame``; empty to guess the topic, "none" for no velocities.
        heading_topic: topic of orientations, of which only the yaw is used, or empty for no heading. The orientations
            of an IMU must be in ENU, and the orientations of an odometry must be in the frame of its poses.
        reference_topic: topic of the reference, or empty for no reference.
        position_frame: frame of the positions in a topic of poses: auto (ECEF if the positions are on the Earth,
            otherwise ENU), ecef, enu, or ned (local or UTM, with FRD body axes).
        velocity_frame: frame of the velocities: body (forward, left, up), frd (forward, right, down), enu, ned, speed
            (a wheel speed along the course: only the x axis is used) or course (along and across the course).
        reference_frame: frame of the reference positions in a topic of poses: auto, ecef, enu or ned.
        heading_source: sensor that measured the headings: odometry or dual_antenna.
        reference_source: source of the reference as a phrase, or empty to use the name of the topic.
        reference_independent: whether the reference is independent of the measurements.
    """

    imu_topic: str = ""
    position_topic: str = ""
    velocity_topic: str = ""
    heading_topic: str = ""
    reference_topic: str = ""
    position_frame: str = "auto"
    velocity_frame: str = "body"
    reference_frame: str = "auto"
    heading_source: str = "odometry"
    reference_source: str = ""
    reference_independent: bool = False

    def __post_init__(self) -> None:
        self.check_options()
        choices = {
            "position_frame": POSE_FRAMES,
            "reference_frame": POSE_FRAMES,
            "velocity_frame": VELOCITY_FRAMES,
            "heading_source": ("odometry", "dual_antenna"),
        }
        require_choices(self, choices)

    def plan(self, bag: Bag) -> TopicPlan:
        """Return the specified and the guessed topics, and their frames."""
        topics, notes = guessed_topics(bag, {role: getattr(self, f"{role}_topic") for role in ROLES})
        stated = {f.name: getattr(self, f.name) for f in fields(TopicPlan) if f.name not in ("topics", "notes")}
        return TopicPlan(topics, notes, **stated)


# Guesses of the topic of each role of any bag.

NONE = "none"
"""Value of a topic parameter if no topic has the role."""

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
    truths = [t.name for t in bag.topics if _TRUTH.search(t.name) and t.msgtype in ROLE_FIELDS["reference"]]
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
        if (bag.read({topic.name: ROLE_FIELDS["position"][FIX]})[topic.name]["status"] >= 0).any():
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


# The topics of the driver of a Fixposition Vision-RTK 2, versions 4 to 8.

ODOMETRIES = ("odometry_ecef", "odometry")
"""Last part of the name of the topic with the fusion in ECEF: for drivers from 6.2 on, and for older drivers."""

FUSED_FIX = "navsatfix"
"""Last part of the name of the topic with positions for drivers before 6.1, which publish only the fused position."""


def find_odometry(bag: Bag, namespace: str) -> Topic:
    """Return the topic with the solution of the sensor fusion in ECEF.

    Raises:
        RecordingError: the topic does not exist. The error message lists all topics.
    """
    inside = f"/{namespace.strip('/')}/" if namespace else ""
    found = [t for t in bag.topics if t.msgtype == ODOMETRY and t.count and t.name.startswith(inside)]
    odometries = [topic for last in ODOMETRIES for topic in found if topic.name.rsplit("/", 1)[-1] == last]
    for topic in odometries:
        position = bag.read({topic.name: ("position",)})[topic.name]["position"]
        if is_ecef(position[np.abs(position).max(axis=1) > 0]):  # before the first solution, the fusion publishes zeros
            return topic
    listing = ", ".join(f"{topic.name} ({topic.msgtype})" for topic in bag.topics)
    reason = f"no nav_msgs/Odometry ends in {' or '.join(ODOMETRIES)}"
    if odometries:
        reason = f"{odometries[0].name} is not in ECEF"
    raise RecordingError(
        f"{bag.path} is not a Fixposition recording: {reason}. Topics: {listing}. Set namespace, or read the"
        " bag with dataset=rosbag."
    )


def _require_topic(bag: Bag, space: str, name: str, msgtype: str, parameter: str) -> str:
    """Return the name ``space/name`` of a topic that has messages.

    Raises:
        RecordingError: the topic has no messages. The error message lists the topics of the type ``msgtype``.
    """
    if _has(bag, f"{space}/{name}"):
        return f"{space}/{name}"
    suitable = [t.name for t in bag.topics if t.msgtype == msgtype and t.count]
    raise RecordingError(
        f"{bag.path} has no messages in the topic {space}/{name}. Topics of the type {msgtype}:"
        f" {', '.join(suitable) or 'none'}. Set {parameter} to the last part of a topic's name."
    )


def _has(bag: Bag, name: str) -> bool:
    return any(topic.name == name and topic.count for topic in bag.topics)


@register("dataset", "fixposition")
@dataclass(frozen=True)
class Fixposition(BagDataset):
    """A recording of a Fixposition Vision-RTK 2 (ROS driver versions 4 to 8).

    The topics are found by the last parts of their names, in any namespace::

        odometry_ecef or odometry   the sensor's fusion, ECEF: the reference, and velocities in the body
        poiimu                      bias-corrected specific force and angular rate at the point of interest
        gnss1                       fixes of antenna 1; drivers before 6.1 have navsatfix of the fusion instead

    The sensor's fusion uses the same antennas and the same IMU as the measurements, and also cameras. The fusion is
    **not an independent reference**, and the velocities also come from the fusion. Fixes state their covariance in the
    order north, east, up. Drivers 6.1.0 and 6.1.1 never set the stamps of fixes. For these drivers, the stamp of a fix
    is the recording time minus a median delay.

    Source: the driver's public code and documentation (github.com/fixposition/fixposition_driver).

    Attributes:
        namespace: namespace of the topics, or empty for the namespace of the first odometry in ECEF.
        imu: last part of the name of the IMU's topic: poiimu, corrimu or rawimu.
        gnss: last part of the name of the topic of fixes: gnss1 or gnss2.
        velocity: source of the velocities: odometry or none.
        heading: source of the headings: odometry or none.
    """

    covariance_order: str = "neu"
    namespace: str = ""
    imu: str = "poiimu"
    gnss: str = "gnss1"
    velocity: str = "odometry"
    heading: str = "none"

    def __post_init__(self) -> None:
        self.check_options()
        for name in ("velocity", "heading"):
            require_known(f"{name} of fixposition", getattr(self, name), ("none", "odometry"))

    def plan(self, bag: Bag) -> TopicPlan:
        """Return the topics of the Fixposition driver, their frames, and a note if the driver is old.

        Raises:
            RecordingError: the topic of the odometry, of the IMU or of the positions is missing.
        """
        odometry, gnss = find_odometry(bag, self.namespace).name, self.gnss
        space, notes = odometry.rsplit("/", 1)[0], []
        topics: dict[Role, str] = {"imu": _require_topic(bag, space, self.imu, IMU, "imu")}
        if not _has(bag, f"{space}/{gnss}") and _has(bag, f"{space}/{FUSED_FIX}"):
            fused = f"positions are {space}/{FUSED_FIX}, the sensor's fusion, the same as the reference."
            notes, gnss = [f"The driver published no {space}/{gnss} (older than 6.1): {fused}"], FUSED_FIX
        topics["position"] = _require_topic(bag, space, gnss, FIX, "gnss")
        sources: dict[Role, str] = {"velocity": self.velocity, "heading": self.heading, "reference": "odometry"}
        topics |= {role: odometry for role, source in sources.items() if source == "odometry"}
        source, order = f"the sensor's own fusion ({odometry})", self.covariance_order
        return TopicPlan(topics, tuple(notes), order, reference_frame="ecef", reference_source=source)
