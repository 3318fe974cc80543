"""The parameters that every data set made from a bag has."""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray, require_choices, require_lengths, require_not_negative
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import dcm_from_euler
from jerkbench.io.files import fetched_folder
from jerkbench.io.frames import ACCEL_UNITS, GYRO_UNITS, axes_matrix
from jerkbench.io.sanitiser import MODES

FETCHED = "fetched:"
CHOICES = {
    "sanitise": MODES,
    "time_source": ("bag", "header"),
    "covariance_order": ("enu", "neu"),
    "accel_unit": tuple(ACCEL_UNITS),
    "gyro_unit": tuple(GYRO_UNITS),
}
LENGTHS = {
    "mounting_deg": (3,),
    "lever_arm_m": (3,),
    "velocity_latency_s": (3,),
    "origin": (0, 3),
    "position_sigma_m": (0, 3),
    "velocity_sigma_mps": (0, 3),
}


@dataclass(frozen=True)
class BagOptions:
    """The parameters of every recording from a ROS bag.

    Everything stands at the time when it was true: the stamp less its latency. The IMU is turned into the body::

        f_body = (Rz(yaw) Ry(pitch) Rx(roll))' A f_sensor,  A from imu_axes          and the same for the gyro

    Whatever is wrong with the messages is counted, and each kind of trouble is a note of the recording: stamps before
    ``earliest_utc``, repeated, backwards or far from the time of recording; gaps; values that are NaN or impossible;
    quaternions not of length 1; an angular rate that stays the same for ten samples; fixes of status -1, off the Earth
    or leaping; covariances that are zero, NaN or not positive definite; jumps where the kind of fix changes.

    Attributes:
        file: a .bag, .db3 or .mcap file, a ROS 2 bag's folder, or a folder with the parts of a split .bag;
            "fetched:NAME/FILE" is what `jerkbench data fetch NAME` has fetched.
        sanitise: repair (mend what can be mended, drop the rest), drop, or refuse (the first trouble is an error).
        earliest_utc: a stamp before this day is none.
        time_source: header (the stamps), or bag (when each message was recorded).
        accel_unit: g or m/s2: ROS says m/s2, and some drivers of laser scanners publish g.
        gyro_unit: deg/s or rad/s.
        imu_axes: which axes of the IMU point forward, left and up: [x, y, z], [-z, -x, y], ...
        mounting_deg: small rotation roll, pitch, yaw from the body to the IMU's axes as named above.
        lever_arm_m: from the body's reference point to the antenna: forward, left, up. Needs the reference's attitude.
        covariance_order: of a NavSatFix: enu (as the message is defined), or neu (as Fixposition writes it).
        position_sigma_m: east, north, up, for fixes without covariance; empty: the median of the others.
        velocity_sigma_mps: the same for velocities, in their frame.
        imu_shift_s: added to the IMU's stamps.
        position_latency_s: how old the position is at its stamp.
        velocity_latency_s: the same for the three axes of the velocity.
        origin: latitude [deg], longitude [deg] and height [m] of ENU; empty: the first fix that is used.
        rest_s: how long it stands still from time 0; null: found in the velocity.
        remove_gyro_bias: subtract the gyro's mean over the rest.
        scale_accel_to_gravity: scale the accelerometer so that its mean over the rest has the magnitude 9.81 m/s2.
        remarks: sentences that belong under every table of this recording.
        outage_s: a gap between fixes that is longer is an outage, which the outage metrics score against the reference;
            0: none is.
    """

    file: str
    sanitise: str = "repair"
    earliest_utc: str = "2000-01-01"
    time_source: str = "header"
    accel_unit: str = "m/s2"
    gyro_unit: str = "rad/s"
    imu_axes: tuple[str, ...] = ("x", "y", "z")
    mounting_deg: tuple[float, ...] = (0.0, 0.0, 0.0)
    lever_arm_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    covariance_order: str = "enu"
    position_sigma_m: tuple[float, ...] = ()
    velocity_sigma_mps: tuple[float, ...] = ()
    imu_shift_s: float = 0.0
    position_latency_s: float = 0.0
    velocity_latency_s: tuple[float, ...] = (0.0, 0.0, 0.0)
    origin: tuple[float, ...] = ()
    rest_s: float | None = None
    remove_gyro_bias: bool = False
    scale_accel_to_gravity: bool = False
    remarks: tuple[str, ...] = ()
    outage_s: float = 0.0

    def check_options(self) -> None:
        """Check that every choice exists and every list has its length.

        Raises:
            PluginError: names the parameter.
        """
        require_choices(self, CHOICES)
        require_not_negative("dataset", self, ("outage_s",))
        require_lengths(self, LENGTHS)
        _ = self.earliest_ns, self.body_from_imu

    @property
    def path(self) -> Path:
        """Return the path of ``file``.

        Raises:
            RecordingError: it is one to be fetched, and was not.
        """
        if not self.file.startswith(FETCHED):
            return Path(self.file).expanduser()
        name, _, file = self.file.removeprefix(FETCHED).partition("/")
        folder = fetched_folder(name)
        if not folder.is_dir():
            raise RecordingError(
                f"The recording {name} was not fetched: run `jerkbench data fetch {name}`, or give dataset.file=FILE."
            )
        return folder / file

    @property
    def earliest_ns(self) -> int:
        """Nanoseconds from 1970 to ``earliest_utc``."""
        try:
            day = datetime.fromisoformat(self.earliest_utc).replace(tzinfo=UTC)
        except ValueError as error:
            raise PluginError(f"earliest_utc is '{self.earliest_utc}'; give a day: 2017-01-01.") from error
        return int(day.timestamp()) * 1_000_000_000

    @property
    def body_from_imu(self) -> FloatArray:
        """The matrix (3, 3) that turns the IMU's axes into the body's."""
        turn = dcm_from_euler(np.radians(self.mounting_deg))
        return np.asarray(turn.T @ axes_matrix(self.imu_axes))
