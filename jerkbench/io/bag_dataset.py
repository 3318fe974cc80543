"""A data set that reads a ROS bag: its parameters, and the way from messages to a recording."""

from abc import abstractmethod
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Literal

import numpy as np

from jerkbench.arrays import (
    BoolArray,
    FloatArray,
    nearest_rows,
    require_choices,
    require_lengths,
    require_not_negative,
)
from jerkbench.errors import PluginError, RecordingError, require_known
from jerkbench.geometry import (
    dcm_from_euler,
    dcm_from_quaternion,
    enu_axes,
    euler_from_dcm,
)
from jerkbench.io.bag import Bag, Messages, bag_files, content_files, missing_parts, open_bag
from jerkbench.io.bag_cleaning import MODES, Ledger, clean_topics, report_jumps, sound_covariances
from jerkbench.io.bag_topics import Metadata, TopicPlan, is_ecef
from jerkbench.io.clocks import UNIX_EPOCH, velocity_when_true, with_common_time, with_own_outages
from jerkbench.io.files import FETCHED, FromFiles, named_folder
from jerkbench.io.frames import (
    ACCEL_UNITS,
    ENU_FROM_NED,
    FLU_FROM_FRD,
    GYRO_UNITS,
    LOCAL_FRAMES,
    axes_matrix,
    calibrated_at_rest,
    enu_from,
    first_rest_s,
    gravity_notes,
    in_enu,
    origin_of,
    swapped,
    turned_covariance,
)
from jerkbench.io.sanitiser import HELD, held_rows, leaping_rows, require_origin, unit_quaternions
from jerkbench.recording import Heading, Imu, Origin, Position, Recording, Reference, Velocity

BagFrame = Literal["geodetic", "ecef", "enu", "ned"]
POSE_FRAMES = ("auto", "ecef", "enu", "ned")
VELOCITY_FRAMES = ("body", "course", "enu", "frd", "ned", "speed")
ROTATIONS = {"ned": ENU_FROM_NED, "frd": FLU_FROM_FRD}
"""The rotation of a velocity into ENU, or into the body's axes."""

MAX_HEADING_SIGMA_RAD = float(np.pi)
"""A heading with a larger sigma carries no information."""

NO_REFERENCE = "none was named in the bag, so that errors are n/a and only the innovations (NIS) can judge"
OTHER_CLOCK = "check that all topics are of one drive, or take the times of recording with time_source=bag"

_CHOICES = {
    "sanitise": MODES,
    "time_source": ("bag", "header"),
    "covariance_order": ("enu", "neu"),
    "accel_unit": tuple(ACCEL_UNITS),
    "gyro_unit": tuple(GYRO_UNITS),
}
LENGTHS: dict[str, tuple[int, ...]] = dict.fromkeys(("mounting_deg", "lever_arm_m", "velocity_latency_s"), (3,))
LENGTHS |= dict.fromkeys(("position_sigma_m", "velocity_sigma_mps"), (0, 3))


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
        origin: latitude [deg], longitude [deg] and height [m] of ENU, and of the zero of local frames; empty: the first
            fix that is used.
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
        """Check that every choice exists and every list has its length."""
        require_choices(self, _CHOICES)
        require_not_negative("dataset", self, ("outage_s",))
        require_lengths(self, LENGTHS)
        require_origin("dataset", self.origin)
        _ = self.earliest_ns, self.body_from_imu

    @property
    def path(self) -> Path:
        """Return the path of ``file``.

        Raises:
            RecordingError: the file is one to be fetched, and was not.
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


class BagDataset(FromFiles, BagOptions):
    """A data set that is read from a ROS bag."""

    @abstractmethod
    def plan(self, bag: Bag) -> TopicPlan:
        """Return which topic has which role, and in which frames."""

    def load(self, seed: int = 0) -> Recording:  # noqa: ARG002 - a file has no seeds
        """Return the drive; ``seed`` changes nothing.

        Raises:
            RecordingError: the bag is damaged, a topic is missing, nothing usable is left, or ``sanitise`` refuses.
            PluginError: a parameter does not fit.
        """
        with open_bag(self.path) as bag:
            metadata = Metadata.of(bag)
            plan = self.plan(bag) if metadata is None else metadata.plan
            raw = bag.read(plan.fields(bag))
        samples = raw[plan.topics["imu"]]
        force = samples["linear_acceleration"] * ACCEL_UNITS[self.accel_unit]
        rate = samples["angular_velocity"] * GYRO_UNITS[self.gyro_unit]
        raw[samples.topic] = samples.with_values(linear_acceleration=force, angular_velocity=rate)
        ledger = Ledger(self.sanitise, min((int(m.bag_ns[0]) for m in raw.values() if len(m)), default=0))
        clean = clean_topics(raw, plan, ledger, self.earliest_ns, bag_time=self.time_source == "bag")
        recording = with_common_time(_Assembly(self, plan, ledger, clean).recording(metadata), OTHER_CLOCK)
        parts = missing_parts(bag_files(self.path))
        notes = [*self.remarks, *([f"Parts {parts} of the split bag are missing."] if parts else [])]
        notes += [*gravity_notes(recording.inertial.accel_mps2, "imu_axes"), *plan.notes, *recording.notes]
        return replace(recording, notes=(*notes, *map(str, ledger.findings)))

    def paths(self) -> tuple[Path, ...]:
        """Return the bag's files."""
        return content_files(self.path)


def frame_of(messages: Messages, stated: str) -> BagFrame:
    """Return the frame of positions; a pose in the frame "auto" is in ECEF by its distance from the Earth's centre."""
    if "latitude" in messages.values:
        return "geodetic"
    require_known("position_frame", stated, POSE_FRAMES)
    if stated == "auto":
        return "ecef" if is_ecef(messages["position"]) else "enu"
    return stated  # type: ignore[return-value]  # checked above


def places_of(messages: Messages) -> FloatArray:
    """Return (n, 3) latitude, longitude [deg] and height [m], or the positions of poses [m]."""
    if "position" in messages.values:
        return messages["position"]
    return np.column_stack([messages[name] for name in ("latitude", "longitude", "altitude")])


def _body_axes(frame: BagFrame) -> FloatArray:
    return FLU_FROM_FRD if frame == "ned" else np.eye(3)  # the body of orientations in NED is FRD


@dataclass
class _Assembly:
    """The steps from cleaned messages to a recording."""

    options: BagOptions
    plan: TopicPlan
    ledger: Ledger
    clean: dict[str, Messages]
    zero_ns: int = 0
    origin: Origin | None = None
    zero_m: FloatArray = field(default_factory=lambda: np.zeros(3))

    def recording(self, metadata: Metadata | None) -> Recording:
        """Return the recording; ``metadata`` are those of our own writer."""
        options = self.options
        samples, fixes, truth = (self.messages(role) for role in ("imu", "position", "reference"))
        assert samples is not None  # noqa: S101 - every plan has an IMU
        first_ns = int(samples.stamp_ns[0]) + round(options.imu_shift_s * 1e9)
        self.zero_ns = first_ns if metadata is None else metadata.start_ns
        fixes = None if fixes is None else self.usable_fixes(fixes)
        self.locate(fixes, truth, options.origin or (metadata.origin if metadata else ()))
        imu, velocity = self.imu(samples), self.velocity()
        position = None if fixes is None else self.position(fixes)
        reference = Reference(imu.t_s if position is None else position.t_s, NO_REFERENCE, independent=False)
        if truth is not None:
            reference = self.reference(truth)
        rest_s = self.rest_s(metadata, velocity, float(imu.t_s[-1]))
        recording = Recording(
            name=metadata.name if metadata else options.path.stem,
            imu=calibrated_at_rest(imu, rest_s, gyro=options.remove_gyro_bias, accel=options.scale_accel_to_gravity),
            reference=reference,
            position=None if position is None else _at_body(position, reference, options.lever_arm_m),
            velocity=velocity,
            heading=self.heading(),
            origin=self.origin,
            start_utc=UNIX_EPOCH + timedelta(microseconds=round(self.zero_ns / 1000)),
            static_start_s=rest_s,
            outages_s=np.array(metadata.outages_s if metadata else ()).reshape(-1, 2),
            notes=self.dependence(),
        )
        return with_own_outages(recording, options.outage_s)

    def messages(self, role: Literal["imu", "position", "velocity", "heading", "reference"]) -> Messages | None:
        return self.clean[self.plan.topics[role]] if role in self.plan.topics else None

    def seconds(self, messages: Messages) -> FloatArray:
        return np.asarray((messages.stamp_ns - self.zero_ns) * 1e-9)

    def locate(self, fixes: Messages | None, truth: Messages | None, origin: tuple[float, ...]) -> None:
        """Choose the origin of ENU: the given one, otherwise the first position of the fixes or of the reference."""
        first, stated = (fixes, self.plan.position_frame) if fixes is not None else (truth, self.plan.reference_frame)
        if origin:
            self.origin = Origin(*origin)
        elif first is not None:
            places, frame = places_of(first), frame_of(first, stated)
            self.origin = origin_of(places, frame)
            self.zero_m = in_enu(places[:1], frame, None)[0] if self.origin is None else self.zero_m

    def enu_m(self, messages: Messages, frame: BagFrame) -> FloatArray:
        """Return the positions (n, 3) in ENU.

        Raises:
            RecordingError: one of two topics is on the Earth, the other one is local, and no origin was given.
        """
        if not self.options.origin and (frame in LOCAL_FRAMES) != (self.origin is None):
            raise RecordingError(
                f"The topic {messages.topic} is in the frame {frame}, and the fixes are not; they cannot be compared"
                " without origin: give the latitude [deg], longitude [deg] and height [m] of the local frame's zero."
            )
        return in_enu(places_of(messages), frame, self.origin) - self.zero_m

    def axes(self, frame: BagFrame, covariance_order: str = "enu") -> FloatArray:
        """Return the matrix (3, 3) that turns vectors of the frame, or the covariance of fixes, into ENU."""
        if frame == "ecef" and self.origin is not None:
            return enu_axes(self.origin)
        north_first = frame == "geodetic" and covariance_order == "neu"
        return np.asarray(np.abs(ENU_FROM_NED)) if north_first else enu_from(frame)

    def imu(self, messages: Messages) -> Imu:
        turn = self.options.body_from_imu.T
        shifted = messages.stamped(messages.stamp_ns + round(self.options.imu_shift_s * 1e9))
        return Imu(self.seconds(shifted), messages["linear_acceleration"] @ turn, messages["angular_velocity"] @ turn)

    def usable_fixes(self, messages: Messages) -> Messages:
        """Return the fixes with a sound covariance that do not leap."""
        label, sigma = self.plan.label(messages.topic), self.options.position_sigma_m
        messages = sound_covariances(label, messages, self.ledger, "position_covariance", sigma, "position_sigma_m")
        frame = frame_of(messages, self.plan.position_frame)
        places = places_of(messages)
        middle = slice(len(places) // 2, None)  # the first may be the one that leaps
        messages = messages.with_values(enu_m=in_enu(places, frame, origin_of(places[middle], frame)))
        leaps = leaping_rows(np.asarray(messages.stamp_ns * 1e-9), messages["enu_m"])
        messages = self.ledger.drop(label, messages, "a position that leaps out of its neighbours", leaps)
        held = held_rows(places_of(messages))
        messages = self.ledger.drop(label, messages, HELD, held)
        status = messages["status"][:, 0] if "status" in messages.values else None
        report_jumps(label, messages, self.ledger, "enu_m", status)
        if len(messages) < 2:
            raise RecordingError(f"{label}: {len(messages)} usable positions are left; at least 2 are needed.")
        return messages

    def position(self, messages: Messages) -> Position:
        frame = frame_of(messages, self.plan.position_frame)
        turn = self.axes(frame, self.plan.covariance_order)
        covariance = turned_covariance(turn, messages["position_covariance"].reshape(-1, 3, 3))
        t_s = self.seconds(messages) - self.options.position_latency_s
        return Position(t_s, self.enu_m(messages, frame), covariance)

    def velocity(self) -> Velocity | None:
        """Return the velocities; an axis with a negative variance was not measured."""
        messages, frame = self.messages("velocity"), self.plan.velocity_frame
        if messages is None:
            return None
        require_known("velocity_frame", frame, VELOCITY_FRAMES)
        messages, absent = self.with_velocity_covariance(messages)
        mps = np.where(absent, np.nan, messages["linear"])
        covariance = messages["velocity_covariance"].reshape(-1, 3, 3)
        t_s, latency_s = self.seconds(messages), self.options.velocity_latency_s
        if frame in ROTATIONS:
            mps, covariance = swapped(ROTATIONS[frame], mps), turned_covariance(ROTATIONS[frame], covariance)
        if frame in LOCAL_FRAMES:
            return velocity_when_true(t_s, mps, covariance, latency_s)
        if len(set(latency_s)) > 1:
            raise PluginError(
                f"velocity_latency_s is {list(latency_s)}; in the frame {frame} all three must be the same."
            )
        if frame == "speed":
            sigma_mps = float(np.sqrt(np.median(covariance[:, 0, 0])))
            return Velocity.along_course(t_s - latency_s[0], mps[:, 0], sigma_mps)
        return Velocity(t_s - latency_s[0], mps, covariance, "speed" if frame == "course" else "body")

    def with_velocity_covariance(self, messages: Messages) -> tuple[Messages, BoolArray]:
        """Return the messages with a 3 x 3 covariance, and which axes (n, 3) were not measured."""
        n, sigma = len(messages), self.options.velocity_sigma_mps
        stated = messages.values.get("linear_covariance", np.zeros((n, 9)))
        absent = stated[:, [0, 4, 8]] < 0
        unused = (absent[:, :, None] | absent[:, None, :]).reshape(n, 9)
        stated = np.where(unused, np.eye(3).ravel(), stated)
        messages = messages.with_values(velocity_covariance=stated, absent=absent.astype(np.float64))
        label = self.plan.label(messages.topic)
        messages = sound_covariances(label, messages, self.ledger, "velocity_covariance", sigma, "velocity_sigma_mps")
        return messages, messages["absent"] > 0

    def heading(self) -> Heading | None:
        """Return the yaw of the orientations, with the sigma of their covariance."""
        messages, plan = self.messages("heading"), self.plan
        if messages is None:
            return None
        of_fixes = messages.topic == plan.topics.get("position")
        stated = plan.position_frame if of_fixes else plan.reference_frame
        frame: BagFrame = frame_of(messages, stated) if "position" in messages.values else "enu"
        turn = self.axes(frame)
        variance = turned_covariance(turn, messages["orientation_covariance"].reshape(-1, 3, 3))[:, 2, 2]
        good = unit_quaternions(messages["orientation"]) & (variance > 0) & (variance < MAX_HEADING_SIGMA_RAD**2)
        label = plan.label(messages.topic)
        messages = self.ledger.drop(label, messages, "a heading without a usable covariance", ~good)
        dcm = turn @ dcm_from_quaternion(messages["orientation"]) @ _body_axes(frame)
        yaw_rad = euler_from_dcm(dcm)[:, 2] if good.any() else np.empty(0)
        return Heading(self.seconds(messages), yaw_rad, np.sqrt(variance[good]), plan.heading_source)

    def reference(self, messages: Messages) -> Reference:
        """Return positions and, where the messages have them, attitudes and velocities (twists are in the body)."""
        plan, frame = self.plan, frame_of(messages, self.plan.reference_frame)
        source = plan.reference_source or f"the topic {messages.topic}"
        independent = plan.reference_independent and len(plan.roles(messages.topic)) == 1
        euler_rad = velocity_mps = None
        known = unit_quaternions(messages.values.get("orientation", np.zeros((1, 4))))
        if known.any():
            xyzw = np.where(known[:, None], messages["orientation"], [0.0, 0.0, 0.0, 1.0])
            dcm = self.axes(frame) @ dcm_from_quaternion(xyzw) @ _body_axes(frame)
            euler_rad = np.where(known[:, None], euler_from_dcm(dcm), np.nan)
            if "linear" in messages.values:
                mps = np.einsum("nij,nj->ni", dcm, messages["linear"] @ _body_axes(frame))
                velocity_mps = np.where(known[:, None], mps, np.nan)
        enu_m = self.enu_m(messages, frame)
        return Reference(
            self.seconds(messages), source, independent, enu_m=enu_m, velocity_mps=velocity_mps, euler_rad=euler_rad
        )

    def rest_s(self, metadata: Metadata | None, velocity: Velocity | None, end_s: float) -> float:
        if self.options.rest_s is not None:
            return self.options.rest_s
        if metadata is not None:
            return metadata.static_start_s
        if velocity is None or not (late := velocity.t_s >= 0).any():
            return 0.0
        return first_rest_s(velocity.t_s[late], np.linalg.norm(np.nan_to_num(velocity.mps[late]), axis=1), end_s)

    def dependence(self) -> tuple[str, ...]:
        """Return notes about roles that share a topic."""
        sharing = {topic: self.plan.roles(topic) for topic in self.plan.topics.values()}
        listed = {topic: f"{', '.join(roles[:-1])} and {roles[-1]}" for topic, roles in sharing.items() if roles[1:]}
        note = "{} are of one topic, {}: not independent of each other."
        return tuple(note.format(roles.capitalize(), topic) for topic, roles in listed.items())


def _at_body(position: Position, reference: Reference, lever_arm_m: tuple[float, ...]) -> Position:
    """Move fixes from the antenna to the body's reference point: p_body = p_antenna - Omega l (nearest attitude)."""
    if not any(lever_arm_m):
        return position
    if reference.euler_rad is None:
        raise RecordingError(
            "lever_arm_m needs the attitude of a reference, and the bag has none; leave it at zero, and give it to a"
            " filter that takes one (filter=eskf15)."
        )
    known = np.isfinite(reference.euler_rad).all(axis=1)
    nearest = nearest_rows(reference.t_s[known], position.t_s)
    omega = dcm_from_euler(reference.euler_rad[known][nearest])
    return replace(position, enu_m=position.enu_m - omega @ np.array(lever_arm_m))
