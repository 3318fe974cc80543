"""ROS bags: any, by a map from topics to what they measure or a guess, and those of a Fixposition Vision-RTK 2."""

from dataclasses import dataclass, replace

import numpy as np

from jerkbench.arrays import require_choices
from jerkbench.errors import RecordingError, require_known
from jerkbench.io.bag import FIX, IMU, ODOMETRY, Bag, Topic
from jerkbench.io.bag_dataset import POSE_FRAMES, VELOCITY_FRAMES, BagDataset
from jerkbench.io.bag_topics import ROLES, Role, TopicPlan, guessed_topics, is_ecef
from jerkbench.plugins import register
from jerkbench.recording import Heading, Position, Recording


@register("dataset", "rosbag")
@dataclass(frozen=True)
class RosBag(BagDataset):
    """Any ROS 1 or ROS 2 bag with an IMU and positions, by a map from topics to their roles.

    A topic that is not given is guessed: the IMU that feels gravity and has the most messages; the NavSatFix that has
    fixes; the twist with covariance or the odometry with the most messages. What was chosen is a note of the recording.
    Heading and reference are never guessed. Types: Imu, NavSatFix, Odometry, Pose(WithCovariance)Stamped,
    Twist(WithCovariance)Stamped, Vector3Stamped.

    With a velocity along the body alone nothing says where the vehicle heads. ``course_over_s`` takes the direction
    from fix to fix, that long apart, as a heading in the middle between them (it looks half of that ahead):

        yaw = atan2(dn, de), sigma = sqrt(2 c)/|d|, c the larger horizontal variance, where |d| > 4 sqrt(2 c)

    Attributes:
        imu_topic: angular rate and specific force; empty: guessed.
        position_topic: fixes, or poses in ``position_frame``; empty: guessed; none: without.
        velocity_topic: velocities in ``velocity_frame``; empty: guessed; none: without.
        heading_topic: orientations, of which the yaw is used: an IMU's in ENU, an odometry's in its own frame; empty:
            none.
        reference_topic: what is compared with; empty: none.
        position_frame: of poses: auto (ECEF by its size, else ENU), ecef, enu or ned (local or UTM; its body is FRD).
        velocity_frame: body (forward, left, up), frd, enu, ned, speed (a wheel's: the x axis alone,
            along the course), or course (all that was measured along and across it).
        reference_frame: of the reference's poses.
        heading_source: what measured the headings: odometry or dual_antenna.
        reference_source: where the reference comes from, in words; empty: its topic.
        reference_independent: whether it shares nothing with the measurements.
        course_over_s: time between the fixes of a course; 0: no courses.
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
    course_over_s: float = 0.0

    def __post_init__(self) -> None:
        """Check that every choice exists."""
        self.check_options()
        choices = {
            "position_frame": POSE_FRAMES,
            "reference_frame": POSE_FRAMES,
            "velocity_frame": VELOCITY_FRAMES,
            "heading_source": ("odometry", "dual_antenna"),
        }
        require_choices(self, choices)

    def load(self, seed: int = 0) -> Recording:
        """Return the drive; ``seed`` changes nothing.

        Raises:
            RecordingError: the bag is damaged, a topic is missing, nothing usable is left, or ``sanitise`` refuses.
        """
        recording = super().load(seed)
        return with_courses(recording, self.course_over_s) if self.course_over_s else recording

    def plan(self, bag: Bag) -> TopicPlan:
        """Return the topics that are given, the others guessed, and their frames."""
        topics, notes = guessed_topics(bag, {role: getattr(self, f"{role}_topic") for role in ROLES})
        return TopicPlan(
            topics,
            notes,
            covariance_order=self.covariance_order,
            position_frame=self.position_frame,
            velocity_frame=self.velocity_frame,
            reference_frame=self.reference_frame,
            heading_source="dual_antenna" if self.heading_source == "dual_antenna" else "odometry",
            reference_source=self.reference_source,
            reference_independent=self.reference_independent,
        )


MIN_STEP_SIGMAS = 4.0
"""A step between fixes of so many sigmas has a course whose error is Gaussian and not reversed."""


def with_courses(recording: Recording, over_s: float) -> Recording:
    """Return the recording with a heading every ``over_s`` seconds, and a note that says so.

    Raises:
        RecordingError: it has no positions, has headings already, or never moves far enough.
    """
    if recording.heading is not None or recording.position is None:
        obstacle = "has headings already" if recording.heading is not None else "has no positions"
        raise RecordingError(f"{recording.name} {obstacle}; leave course_over_s at 0.")
    heading = courses(recording.position, over_s)
    if not len(heading.t_s):
        raise RecordingError(
            f"{recording.name}: within {over_s:g} s no two fixes are further apart than {MIN_STEP_SIGMAS:g} of their"
            " sigmas; make course_over_s longer."
        )
    ahead = f"they look {over_s / 2:g} s ahead, and share the fixes' errors."
    note = f"Headings are courses between fixes {over_s:g} s apart, placed in the middle: {ahead}"
    return replace(recording, heading=heading, notes=(*recording.notes, note))


def courses(position: Position, over_s: float) -> Heading:
    """Return the direction between fixes that are ``over_s`` apart, one after the other without overlap."""
    usual_s = float(np.median(np.diff(position.t_s)))
    rows = np.arange(0, len(position.t_s), max(round(over_s / usual_s), 1))
    t_s = position.t_s[rows]
    step_m, duration_s = np.diff(position.enu_m[rows, :2], axis=0), np.diff(t_s)
    variance = np.diagonal(position.covariance_m2[rows], axis1=1, axis2=2)[:, :2].max(axis=1)
    sigma_m = np.sqrt(variance[1:] + variance[:-1])
    distance_m = np.linalg.norm(step_m, axis=1)
    with np.errstate(invalid="ignore"):  # a step with NaN or over a gap has no course
        sure = (distance_m > MIN_STEP_SIGMAS * sigma_m) & (duration_s < 1.5 * over_s + usual_s)
    yaw_rad = np.arctan2(step_m[sure, 1], step_m[sure, 0])
    return Heading(0.5 * (t_s[1:] + t_s[:-1])[sure], yaw_rad, sigma_m[sure] / distance_m[sure], "course")


# The topics of the Fixposition Vision-RTK 2 driver, versions 4 to 8.

ODOMETRIES = ("odometry_ecef", "odometry")
"""Last part of the topic with the fusion in ECEF: of drivers from 6.2 on, and before."""

_IMUS = ("poiimu", "corrimu", "rawimu")
FUSED_FIX = "navsatfix"
"""Drivers before 6.1 publish no antenna, only the fusion's own position."""


def find_odometry(bag: Bag, namespace: str) -> Topic:
    """Return the topic with the fusion's solution in ECEF.

    Raises:
        RecordingError: there is none; says which topics there are.
    """
    inside = f"/{namespace.strip('/')}/" if namespace else ""
    found = [t for t in bag.topics if t.msgtype == ODOMETRY and t.count and t.name.startswith(inside)]
    odometries = [topic for last in ODOMETRIES for topic in found if topic.name.rsplit("/", 1)[-1] == last]
    for topic in odometries:
        position = bag.read({topic.name: ("position",)})[topic.name]["position"]
        if is_ecef(position[np.abs(position).max(axis=1) > 0]):  # before the fusion starts it may write zeros
            return topic
    listing = ", ".join(f"{topic.name} ({topic.msgtype})" for topic in bag.topics)
    reason = f"no nav_msgs/Odometry ends in {' or '.join(ODOMETRIES)}"
    if odometries:
        reason = f"{odometries[0].name} is not in ECEF"
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
    notes: tuple[str, ...] = ()
    if not _has(bag, f"{space}/{gnss}") and _has(bag, f"{space}/{FUSED_FIX}"):
        fused = f"positions are {space}/{FUSED_FIX}, the sensor's own fusion, the same as the reference."
        notes, gnss = (f"The driver published no {space}/{gnss} (older than 6.1): {fused}",), FUSED_FIX
    topics["position"] = _require_topic(bag, space, gnss, FIX, "gnss")
    fused_roles: dict[Role, bool] = {"velocity": velocity, "heading": heading, "reference": True}
    topics |= {role: odometry for role, wanted in fused_roles.items() if wanted}
    return TopicPlan(topics, notes)


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


_VELOCITIES = ("none", "odometry")
HEADINGS = ("none", "odometry")


@register("dataset", "fixposition")
@dataclass(frozen=True)
class Fixposition(BagDataset):
    """A recording of a Fixposition Vision-RTK 2 (ROS driver versions 4 to 8).

    The topics are found by their last parts, in whatever namespace::

        odometry_ecef or odometry   the sensor's own fusion, ECEF: the reference, and velocities in the body
        poiimu                      bias-corrected specific force and angular rate at the point of interest
        gnss1                       fixes of antenna 1; drivers before 6.1 have navsatfix instead, which is the fusion's

    The fusion uses the same antennas and the same IMU, and cameras: it is **not an independent reference**, and the
    velocities come from it too. Fixes state their covariance in the order north, east, up. Stamps of drivers 6.1.0 and
    6.1.1, which never fill in the fixes' stamps, are replaced by the time of recording less its usual delay.

    Source: the driver's public code and documentation (github.com/fixposition/fixposition_driver).

    Attributes:
        namespace: of the topics, if there are several; empty: found.
        imu: last part of the IMU's topic: poiimu, corrimu or rawimu.
        gnss: last part of the fixes' topic: gnss1 or gnss2.
        velocity: odometry, or none.
        heading: odometry, or none.
    """

    earliest_utc: str = "2017-01-01"
    covariance_order: str = "neu"
    namespace: str = ""
    imu: str = "poiimu"
    gnss: str = "gnss1"
    velocity: str = "odometry"
    heading: str = "none"

    def __post_init__(self) -> None:
        """Check that every choice exists."""
        self.check_options()
        for name, available in (("velocity", _VELOCITIES), ("heading", HEADINGS)):
            require_known(f"{name} of fixposition", getattr(self, name), available)

    def plan(self, bag: Bag) -> TopicPlan:
        """Return the topics of the driver, and their frames."""
        velocity, heading = self.velocity == "odometry", self.heading == "odometry"
        plan = plan_topics(bag, self.namespace, self.imu, self.gnss, velocity=velocity, heading=heading)
        source = f"the sensor's own fusion ({plan.topics['reference']})"
        return replace(plan, covariance_order=self.covariance_order, reference_frame="ecef", reference_source=source)
