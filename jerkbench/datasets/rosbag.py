"""The data set `rosbag`: any ROS bag, with specified or guessed topics."""

from dataclasses import dataclass, fields

from jerkbench.arrays import require_choices
from jerkbench.io.bag import Bag
from jerkbench.io.bag_dataset import POSE_FRAMES, VELOCITY_FRAMES, BagDataset
from jerkbench.io.bag_topics import ROLES, TopicPlan, guessed_topics
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
