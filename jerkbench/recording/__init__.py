"""The recording: IMU, position, velocity, heading and the reference, validated when made and never changed.

Frames: positions and velocities are in the local tangent plane ENU at ``Recording.origin`` (WGS-84), the body is
FLU (forward, left, up). The attitude Omega = Rz(yaw) Ry(pitch) Rx(roll) turns body into ENU; positive pitch is nose
down. Specific force at rest and level is (0, 0, +g). Times are seconds from the recording's start, and each is the
time at which the value was true (the stamp less the latency). A value that is NaN is not there.

`streams` has IMU, position, velocity and heading, `reference`, `origin` and `drawn` the parts of these names, and
`recording` the whole. All names are there to be imported from here: ``from jerkbench.recording import Recording``.
"""

from jerkbench.recording.drawn import Drawn
from jerkbench.recording.gravity import GRAVITY_MPS2
from jerkbench.recording.origin import Origin
from jerkbench.recording.recording import LEAST_FIXES, Recording
from jerkbench.recording.reference import Reference
from jerkbench.recording.streams import HEADING_SOURCES, VELOCITY_FRAMES, Heading, Imu, Position, Velocity

