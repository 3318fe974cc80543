"""Recordings of a Fixposition Vision-RTK 2 in ROS bags."""

from dataclasses import dataclass
from typing import ClassVar

from jerkbench.bags.assembly import Loaded, load_bag
from jerkbench.bags.extract import Frames
from jerkbench.bags.fixposition import plan_topics
from jerkbench.bags.options import BagOptions
from jerkbench.bags.roles import TopicPlan
from jerkbench.errors import PluginError, unknown
from jerkbench.plugins import register
from jerkbench.readers.files import fingerprint
from jerkbench.readers.ros.bag import Bag
from jerkbench.readers.ros.files import content_files
from jerkbench.recording import Recording

VELOCITIES = ("none", "odometry")
HEADINGS = ("none", "odometry")


@register("dataset", "fixposition")
@dataclass(frozen=True)
class Fixposition(BagOptions):
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

    seeded: ClassVar[bool] = False
    default_attitude: ClassVar[str] = "real"

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
        for name, available in (("velocity", VELOCITIES), ("heading", HEADINGS)):
            if getattr(self, name) not in available:
                raise PluginError(unknown(f"{name} of fixposition", getattr(self, name), available))

    def load(self, seed: int = 0) -> Recording:
        """Return the drive; ``seed`` changes nothing.

        Raises:
            RecordingError: the bag is damaged, a topic is missing, or nothing usable is left.
        """
        return self.loaded().recording

    def loaded(self) -> Loaded:
        """Return the drive with the sanitiser's report and the topics."""
        return load_bag(self, self._plan)

    def fingerprint(self) -> str:
        """Return the SHA-256 over the bytes of the bag's files."""
        return fingerprint(content_files(self.path))

    def _plan(self, bag: Bag) -> tuple[TopicPlan, Frames]:
        velocity, heading = self.velocity == "odometry", self.heading == "odometry"
        plan = plan_topics(bag, self.namespace, self.imu, self.gnss, velocity=velocity, heading=heading)
        source = f"the sensor's own fusion ({plan.topics['reference']})"
        return plan, Frames(covariance_order=self.covariance_order, reference="ecef", reference_source=source)
