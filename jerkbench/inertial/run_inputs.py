"""One run of the inertial navigation before it begins."""

from typing import NamedTuple

from jerkbench.arrays import FloatArray
from jerkbench.inertial.events import Events
from jerkbench.inertial.run import Settings
from jerkbench.inertial.state import NavigationState
from jerkbench.recording import Heading, Imu
from jerkbench.timeline.timeline import Timeline


class Journey(NamedTuple):
    """Everything that a run needs besides its adaptation; `jerkbench.inertial.run.InertialRun` takes the same.

    Attributes:
        imu: the samples.
        timeline: the measurements.
        headings: measured headings, or None.
        events: the steps.
        start: state and covariance (n, n) at the begin.
        settings: what is not measured.
    """

    imu: Imu
    timeline: Timeline
    headings: Heading | None
    events: Events
    start: tuple[NavigationState, FloatArray]
    settings: Settings
