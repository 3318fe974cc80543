"""The parameters that every data set made from a bag has, and the streams that they make of cleaned messages."""

from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray, require_choices, require_lengths, require_not_negative
from jerkbench.errors import PluginError, RecordingError, require_known
from jerkbench.geometry import (
    dcm_from_euler,
    dcm_from_quaternion,
    ecef_to_enu,
    ecef_to_origin,
    enu_axes,
    euler_from_dcm,
    geodetic_to_enu,
)
from jerkbench.io.bag import Messages
from jerkbench.io.bag_roles import is_ecef
from jerkbench.io.clocks import velocity_when_true
from jerkbench.io.files import FETCHED, named_folder
from jerkbench.io.frames import (
    ACCEL_UNITS,
    ENU_FROM_NED,
    FLU_FROM_FRD,
    GYRO_UNITS,
    axes_matrix,
    enu_from,
    swapped,
    turned_covariance,
)
from jerkbench.io.limits import require_origin
from jerkbench.io.sanitiser import MODES, Ledger, leaping_rows, report_jumps, sound_covariances, unit_quaternions
from jerkbench.recording import Heading, Imu, Origin, Position, Velocity

_CHOICES = {
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
        require_choices(self, _CHOICES)
        require_not_negative("dataset", self, ("outage_s",))
        require_lengths(self, LENGTHS)
        require_origin("dataset", self.origin)
        _ = self.earliest_ns, self.body_from_imu

    @property
    def path(self) -> Path:
        """Return the path of ``file``.

        Raises:
            RecordingError: it is one to be fetched, and was not.
        """
        if not self.file.startswith(FETCHED):
            return Path(self.file).expanduser()
        folder, _, file = self.file.partition("/")
        return named_folder(folder, "dataset.file=FILE") / file

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


# Positions in their frames: geodetic, ECEF, a local plane.

BagFrame = Literal["geodetic", "ecef", "enu", "ned"]
_COORDINATES = ("latitude", "longitude", "altitude")
POSE_FRAMES = ("auto", "ecef", "enu", "ned")


@dataclass(frozen=True)
class Place:
    """The origin of ENU.

    Attributes:
        origin: on the Earth; None for local coordinates.
        local_m: (3,) what is subtracted from local coordinates (in ENU order).
    """

    origin: Origin | None
    local_m: FloatArray = field(default_factory=lambda: np.zeros(3))


def frame_of(messages: Messages, stated: str) -> BagFrame:
    """Return the frame of the positions; of a pose "auto" is ECEF where it is as far from the Earth's centre, else ENU.

    Raises:
        PluginError: no such frame.
    """
    if "latitude" in messages.values:
        return "geodetic"
    require_known("position_frame", stated, POSE_FRAMES)
    if stated == "auto":
        return "ecef" if is_ecef(messages["position"]) else "enu"
    return stated  # type: ignore[return-value]  # checked above


def first_place(messages: Messages, frame: BagFrame, origin: tuple[float, ...]) -> Place:
    """Return where ENU begins: the given origin, or the first position."""
    if frame in ("enu", "ned"):
        return Place(None, enu_from(frame) @ messages["position"][0])
    if origin:
        return Place(Origin(*origin))
    if frame == "ecef":
        return Place(ecef_to_origin(messages["position"][0]))
    return Place(Origin(*(float(messages[name][0, 0]) for name in _COORDINATES)))


def fixes_in_enu(messages: Messages, frame: BagFrame, place: Place) -> FloatArray:
    """Return the positions (n, 3) in ENU at ``place``.

    Raises:
        RecordingError: one of the two is on the Earth and the other is local.
    """
    if (frame in ("enu", "ned")) != (place.origin is None):
        raise RecordingError(
            f"The topic {messages.topic} is in the frame {frame}, and the fixes are not; they cannot be compared:"
            " choose topics of one kind."
        )
    if place.origin is None:
        return np.asarray(messages["position"] @ enu_from(frame).T - place.local_m)
    if frame == "ecef":
        return ecef_to_enu(messages["position"], place.origin)
    latitude, longitude, height = (messages[name][:, 0] for name in _COORDINATES)
    return geodetic_to_enu(latitude, longitude, height, place.origin)


def axes_to_enu(frame: BagFrame, place: Place, covariance_order: str = "enu") -> FloatArray:
    """Return the matrix (3, 3) that turns vectors of the frame into ENU; of "geodetic" the covariance's."""
    if frame == "ecef" and place.origin is not None:
        return enu_axes(place.origin)
    north_first = frame == "geodetic" and covariance_order == "neu"
    return np.asarray(np.abs(ENU_FROM_NED)) if north_first else enu_from(frame)


def body_axes(frame: BagFrame) -> FloatArray:
    """Return the matrix (3, 3) that turns FLU into the body of orientations in ``frame``: FRD in NED, else FLU."""
    return FLU_FROM_FRD if frame == "ned" else np.eye(3)


# The parts of a recording from cleaned messages, one role each.

VELOCITY_FRAMES = ("body", "course", "enu", "frd", "ned", "speed")
FROM = {"ned": ENU_FROM_NED, "frd": FLU_FROM_FRD}
"""The rotation of a velocity into ENU, or into the body's axes."""

WORST_HEADING_RAD = float(np.pi)
"""A heading with a larger sigma says nothing."""


def seconds(stamp_ns: IntArray, zero_ns: int) -> FloatArray:
    """Return stamps as seconds since ``zero_ns``."""
    return np.asarray((stamp_ns - zero_ns) * 1e-9)


def imu_of(messages: Messages, options: BagOptions, zero_ns: int) -> Imu:
    """Return the samples, in the body's axes."""
    turn = options.body_from_imu.T
    t_s = seconds(messages.stamp_ns + round(options.imu_shift_s * 1e9), zero_ns)
    return Imu(t_s, messages["linear_acceleration"] @ turn, messages["angular_velocity"] @ turn)


def usable_fixes(messages: Messages, label: str, stated_frame: str, options: BagOptions, ledger: Ledger) -> Messages:
    """Return the positions that can be used, with ``enu_m`` about the first of them and a 3 x 3 covariance."""
    sigma = options.position_sigma_m
    messages = sound_covariances(label, messages, ledger, "position_covariance", sigma, "position_sigma_m")
    frame = frame_of(messages, stated_frame)
    middle = messages.rows(np.array([len(messages) // 2]))  # the first may be the one that leaps
    messages = messages.with_values(enu_m=fixes_in_enu(messages, frame, first_place(middle, frame, ())))
    leaps = leaping_rows(np.asarray(messages.stamp_ns * 1e-9), messages["enu_m"])
    messages = ledger.drop(label, messages, "a position that leaps out of its neighbours", leaps)
    report_jumps(label, messages, ledger, "enu_m", messages["status"][:, 0] if "status" in messages.values else None)
    if len(messages) < 2:
        raise RecordingError(f"{label}: {len(messages)} usable positions are left; at least 2 are needed.")
    return messages


def position_of(
    messages: Messages, stated_frame: str, covariance_order: str, latency_s: float, place: Place, zero_ns: int
) -> Position:
    """Return the fixes in ENU with their covariances."""
    frame = frame_of(messages, stated_frame)
    turn = axes_to_enu(frame, place, covariance_order)
    covariance = turned_covariance(turn, messages["position_covariance"].reshape(-1, 3, 3))
    return Position(seconds(messages.stamp_ns, zero_ns) - latency_s, fixes_in_enu(messages, frame, place), covariance)


def velocity_of(
    messages: Messages, label: str, frame: str, options: BagOptions, ledger: Ledger, zero_ns: int
) -> Velocity:
    """Return the velocities; a variance below zero says that the axis was not measured.

    Raises:
        PluginError: no such frame, or latencies that differ in a frame where they cannot.
        RecordingError: there is no covariance, and none was given.
    """
    require_known("velocity_frame", frame, VELOCITY_FRAMES)
    messages, absent = _with_velocity_covariance(messages, label, options, ledger)
    mps = np.where(absent, np.nan, messages["linear"])
    covariance = messages["velocity_covariance"].reshape(-1, 3, 3)
    t_s, latency_s = seconds(messages.stamp_ns, zero_ns), options.velocity_latency_s
    if frame in FROM:
        mps, covariance = swapped(FROM[frame], mps), turned_covariance(FROM[frame], covariance)
    if frame in ("enu", "ned"):
        return velocity_when_true(t_s, mps, covariance, latency_s)
    if len(set(latency_s)) > 1:
        raise PluginError(f"velocity_latency_s is {list(latency_s)}; in the frame {frame} all three must be the same.")
    if frame == "speed":
        return Velocity.along_course(t_s - latency_s[0], mps[:, 0], float(np.sqrt(np.median(covariance[:, 0, 0]))))
    return Velocity(t_s - latency_s[0], mps, covariance, "speed" if frame == "course" else "body")


def _with_velocity_covariance(
    messages: Messages, label: str, options: BagOptions, ledger: Ledger
) -> tuple[Messages, BoolArray]:
    """The messages with a 3 x 3 covariance, and which axes (n, 3) were not measured."""
    n = len(messages)
    stated = messages.values.get("linear_covariance", np.zeros((n, 9)))
    absent = stated[:, [0, 4, 8]] < 0
    unused = (absent[:, :, None] | absent[:, None, :]).reshape(n, 9)
    stated = np.where(unused, np.eye(3).ravel(), stated)
    messages = messages.with_values(velocity_covariance=stated, absent=absent.astype(np.float64))
    sigma = options.velocity_sigma_mps
    messages = sound_covariances(label, messages, ledger, "velocity_covariance", sigma, "velocity_sigma_mps")
    return messages, messages["absent"] > 0


def heading_of(
    messages: Messages,
    label: str,
    source: Literal["dual_antenna", "odometry"],
    ledger: Ledger,
    place: Place,
    zero_ns: int,
    stated_frame: str,
) -> Heading:
    """Return the yaw of the orientations, with the sigma of their covariance."""
    frame = frame_of(messages, stated_frame) if "position" in messages.values else "enu"
    turn = axes_to_enu(frame, place)
    variance = turned_covariance(turn, messages["orientation_covariance"].reshape(-1, 3, 3))[:, 2, 2]
    good = unit_quaternions(messages["orientation"]) & (variance > 0) & (variance < WORST_HEADING_RAD**2)
    messages = ledger.drop(label, messages, "a heading without a usable covariance", ~good)
    dcm = turn @ dcm_from_quaternion(messages["orientation"]) @ body_axes(frame)
    yaw_rad = euler_from_dcm(dcm)[:, 2] if good.any() else np.empty(0)
    return Heading(seconds(messages.stamp_ns, zero_ns), yaw_rad, np.sqrt(variance[good]), source)
