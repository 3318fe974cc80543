"""Any ROS bag: a map from topics to what they measure, or a guess that says what it chose."""

from dataclasses import dataclass, replace

from jerkbench.arrays import require_choices
from jerkbench.io.ros.assembly import BagDataset, Loaded, with_courses
from jerkbench.io.ros.bag import Bag
from jerkbench.io.ros.extract import Frames
from jerkbench.io.ros.roles import TopicPlan, complete_plan
from jerkbench.io.ros.streams import POSE_FRAMES, VELOCITY_FRAMES
from jerkbench.plugins import register


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

    def loaded(self) -> Loaded:
        """Return the drive with the sanitiser's report and the topics."""
        loaded = super().loaded()
        if not self.course_over_s:
            return loaded
        return replace(loaded, recording=with_courses(loaded.recording, self.course_over_s))

    def plan(self, bag: Bag) -> tuple[TopicPlan, Frames]:
        """Return the topics that are given, the others guessed, and their frames."""
        plan = complete_plan(
            bag,
            {
                "imu": self.imu_topic,
                "position": self.position_topic,
                "velocity": self.velocity_topic,
                "heading": self.heading_topic,
                "reference": self.reference_topic,
            },
        )
        frames = Frames(
            covariance_order=self.covariance_order,
            position=self.position_frame,
            velocity=self.velocity_frame,
            reference=self.reference_frame,
            heading="dual_antenna" if self.heading_source == "dual_antenna" else "odometry",
            reference_source=self.reference_source,
            reference_independent=self.reference_independent,
        )
        return plan, frames
