"""Data sets that read ROS bags: their parameters, and the conversion of messages to a recording."""

from abc import abstractmethod
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from jerkbench.arrays import (
    FloatArray,
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
from jerkbench.io.bag_topics import (
    BagNotes,
    Metadata,
    TopicPlan,
    clean_topics,
    is_ecef,
    places_of,
    sound_covariances,
    steady_fixes,
)
from jerkbench.io.conversions import (
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
    rotated_covariance,
    swapped,
    utc_of,
    velocity_when_true,
)
from jerkbench.io.files import FETCHED, FromFiles, named_folder
from jerkbench.io.sanitiser import require_origin, unit_quaternions, with_common_time, with_recorded_outages
from jerkbench.recording import Heading, Imu, Origin, Position, Recording, Reference, Velocity

BagFrame = Literal["geodetic", "ecef", "enu", "ned"]
POSE_FRAMES = ("auto", "ecef", "enu", "ned")
VELOCITY_FRAMES = ("body", "course", "enu", "frd", "ned", "speed")
ROTATIONS = {"ned": ENU_FROM_NED, "frd": FLU_FROM_FRD}
"""The rotation of a velocity from NED to ENU, and from FRD to body axes (FLU)."""

MAX_HEADING_SIGMA_RAD = float(np.pi)
"""A heading with a larger sigma carries no information."""

NO_REFERENCE = "none was given for the bag, so errors are n/a and only innovations (NIS) can be evaluated"
OTHER_CLOCK = "check that all topics are of the same drive, or use the recording times with time_source=bag"

_CHOICES = {
    "time_source": ("bag", "header"),
    "covariance_order": ("enu", "neu"),
    "accel_unit": tuple(ACCEL_UNITS),
    "gyro_unit": tuple(GYRO_UNITS),
}
LENGTHS: dict[str, tuple[int, ...]] = dict.fromkeys(("mounting_deg", "velocity_latency_s"), (3,))
LENGTHS |= dict.fromkeys(("position_sigma_m", "velocity_sigma_mps"), (0, 3))


@dataclass(frozen=True)
class BagOptions:
    """The parameters of every recording from a ROS bag.

    The time of each measurement is the stamp of its message minus the latency of the measurement. The IMU is rotated
    into body axes::

        f_body = (Rz(yaw) Ry(pitch) Rx(roll))' A f_sensor,  A from imu_axes          and the same for the gyro

    Faulty messages are repaired or dropped, and the notes of the recording state the number of messages with each kind
    of fault. A stamp is faulty if it is before the year 2000, repeats or precedes the previous stamp, or is far from
    the recording time. Gaps between stamps are counted, but not repaired. Values must be finite and plausible, and the
    norm of a quaternion must be 1. An angular rate must not be constant for ten samples or more. Fixes must have a
    status other than -1, be on Earth, be close to their neighbours, and not repeat the previous fix. Covariances must
    be positive definite.

    Attributes:
        file: path of a .bag, .db3 or .mcap file, of the folder of a ROS 2 bag, or of a folder with the parts of a split
            .bag; "fetched:NAME/FILE" is a file that `jerkbench data fetch NAME` has fetched.
        time_source: source of the times: header (the stamps of the headers) or bag (the recording times).
        accel_unit: unit of the specific force: m/s2 (as ROS defines it) or g (from some drivers of laser scanners).
        gyro_unit: unit of the angular rate: deg/s or rad/s.
        imu_axes: axes of the IMU that point forward, left and up, for example [x, y, z] or [-z, -x, y].
        mounting_deg: small rotation (roll, pitch, yaw) from the body axes to the axes that ``imu_axes`` defines [deg].
        covariance_order: order of the axes in the covariance of a NavSatFix: enu (by the definition of the message) or
            neu (as Fixposition writes the covariance).
        position_sigma_m: standard deviations (east, north, up) of fixes without covariance [m], or empty to use the
            median covariance of the other fixes.
        velocity_sigma_mps: standard deviations of velocities without covariance, on the axes of their frame [m/s], or
            empty to use the median covariance of the other velocities.
        imu_shift_s: time shift that is added to the IMU's stamps [s].
        position_latency_s: age of each position at its stamp [s].
        velocity_latency_s: ages of the three axes of each velocity at its stamp [s].
        origin: latitude [deg], longitude [deg] and height [m] of the origin of ENU and of local frames, or empty to use
            the first valid fix.
        rest_s: duration of the rest at the start of the recording [s], or null to detect the rest in the velocity.
        remove_gyro_bias: whether to subtract the gyro's mean over the rest.
        scale_accel_to_gravity: whether to scale the accelerometer so that its mean over the rest is 9.81 m/s2.
        remarks: notes that are printed below every table of this recording.
        outage_s: minimum length of a gap between fixes that counts as an outage [s], or 0 for no outages. The outage
            metrics compare the estimate in an outage with the reference.
    """

    file: str
    time_source: str = "header"
    accel_unit: str = "m/s2"
    gyro_unit: str = "rad/s"
    imu_axes: tuple[str, ...] = ("x", "y", "z")
    mounting_deg: tuple[float, ...] = (0.0, 0.0, 0.0)
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
        """Require that every parameter with choices has a valid choice, and that every list has a valid length."""
        require_choices(self, _CHOICES)
        require_not_negative("dataset", self, ("outage_s",))
        require_lengths(self, LENGTHS)
        require_origin("dataset", self.origin)
        _ = self.body_from_imu

    @property
    def path(self) -> Path:
        """The path of ``file``, in which "fetched:NAME" is replaced by the folder of the fetched recording.

        Raises:
            RecordingError: the folder of a fetched file does not exist.
        """
        if not self.file.startswith(FETCHED):
            return Path(self.file).expanduser()
        folder, _, file = self.file.partition("/")
        return named_folder(folder, "dataset.file=FILE") / file

    @property
    def body_from_imu(self) -> FloatArray:
        """The rotation (3, 3) from the axes of the IMU to the body axes."""
        return np.asarray(dcm_from_euler(np.radians(self.mounting_deg)).T @ axes_matrix(self.imu_axes))


class BagDataset(FromFiles, BagOptions):
    """A data set that is read from a ROS bag."""

    @abstractmethod
    def plan(self, bag: Bag) -> TopicPlan:
        """Return the topic of each role (imu, position, ...), and the frames of the topics."""

    def load(self, seed: int = 0) -> Recording:  # noqa: ARG002 - a file has no seeds
        """Return the recording of the bag. ``seed`` has no effect.

        Raises:
            RecordingError: the bag is damaged, a topic is missing, or a topic has too few usable messages.
            PluginError: a parameter is invalid.
        """
        with open_bag(self.path) as bag:
            metadata = Metadata.of(bag)
            plan = self.plan(bag) if metadata is None else metadata.plan
            raw = bag.read(plan.fields(bag))
        samples = raw[plan.topics["imu"]]
        force = samples["linear_acceleration"] * ACCEL_UNITS[self.accel_unit]
        rate = samples["angular_velocity"] * GYRO_UNITS[self.gyro_unit]
        raw[samples.topic] = samples.with_values(linear_acceleration=force, angular_velocity=rate)
        clean, found = clean_topics(raw, plan, bag_time=self.time_source == "bag")
        recording = with_common_time(_Assembly(self, plan, found, clean).recording(metadata), OTHER_CLOCK)
        parts = missing_parts(bag_files(self.path))
        notes = [*self.remarks, *([f"Parts {parts} of the split bag are missing."] if parts else [])]
        notes += [*gravity_notes(recording.inertial.accel_mps2, "imu_axes"), *plan.notes, *recording.notes]
        return replace(recording, notes=(*notes, *found.notes))

    def paths(self) -> tuple[Path, ...]:
        """Return the paths of all files of the bag."""
        return content_files(self.path)


def frame_of(messages: Messages, stated: str) -> BagFrame:
    """Return the frame of positions, where "auto" means ECEF for poses near the Earth's surface, otherwise ENU."""
    if "latitude" in messages.values:
        return "geodetic"
    require_known("position_frame", stated, POSE_FRAMES)
    if stated == "auto":
        return "ecef" if is_ecef(messages["position"]) else "enu"
    return stated  # type: ignore[return-value]  # checked above


def _body_axes(frame: BagFrame) -> FloatArray:
    return FLU_FROM_FRD if frame == "ned" else np.eye(3)  # with a NED frame, the body axes are FRD


@dataclass
class _Assembly:
    """Converts cleaned messages to a recording."""

    options: BagOptions
    plan: TopicPlan
    found: BagNotes
    clean: dict[str, Messages]
    zero_ns: int = 0
    origin: Origin | None = None
    zero_m: FloatArray = field(default_factory=lambda: np.zeros(3))

    def recording(self, metadata: Metadata | None) -> Recording:
        """Return the recording. ``metadata`` is None if the bag was not written by jerkbench."""
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
            position=position,
            velocity=velocity,
            heading=self.heading(),
            origin=self.origin,
            start_utc=utc_of(self.zero_ns, 0.0),
            static_start_s=rest_s,
            outages_s=np.array(metadata.outages_s if metadata else ()).reshape(-1, 2),
            notes=self.dependence(),
        )
        return with_recorded_outages(recording, options.outage_s)

    def messages(self, role: Literal["imu", "position", "velocity", "heading", "reference"]) -> Messages | None:
        return self.clean[self.plan.topics[role]] if role in self.plan.topics else None

    def seconds(self, messages: Messages) -> FloatArray:
        return np.asarray((messages.stamp_ns - self.zero_ns) * 1e-9)

    def locate(self, fixes: Messages | None, truth: Messages | None, origin: tuple[float, ...]) -> None:
        """Set the origin of ENU to ``origin``, or to the first fix or reference position if ``origin`` is empty."""
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
            RecordingError: ``origin`` is empty, and one topic is geodetic or in ECEF, whereas another topic is in a
                local frame.
        """
        if not self.options.origin and (frame in LOCAL_FRAMES) != (self.origin is None):
            raise RecordingError(
                f"The topic {messages.topic} is in the frame {frame}, but the fixes are not. To compare the topic and"
                " the fixes, give origin: latitude [deg], longitude [deg] and height [m] of the local frame's zero."
            )
        return in_enu(places_of(messages), frame, self.origin) - self.zero_m

    def axes(self, frame: BagFrame, covariance_order: str = "enu") -> FloatArray:
        """Return the rotation (3, 3) of covariances and attitudes from ``frame`` to ENU."""
        if frame == "ecef" and self.origin is not None:
            return enu_axes(self.origin)
        north_first = frame == "geodetic" and covariance_order == "neu"
        return np.asarray(np.abs(ENU_FROM_NED)) if north_first else enu_from(frame)

    def imu(self, messages: Messages) -> Imu:
        turn = self.options.body_from_imu.T
        shifted = messages.stamped(messages.stamp_ns + round(self.options.imu_shift_s * 1e9))
        return Imu(self.seconds(shifted), messages["linear_acceleration"] @ turn, messages["angular_velocity"] @ turn)

    def usable_fixes(self, messages: Messages) -> Messages:
        """Return the fixes with valid covariances, without fixes that are far from their neighbours or repeat a fix."""
        sigma = self.options.position_sigma_m
        messages = sound_covariances(messages, self.found, "position_covariance", sigma, "position_sigma_m")
        return steady_fixes(messages, frame_of(messages, self.plan.position_frame), self.found)

    def position(self, messages: Messages) -> Position:
        frame = frame_of(messages, self.plan.position_frame)
        turn = self.axes(frame, self.plan.covariance_order)
        covariance = rotated_covariance(turn, messages["position_covariance"].reshape(-1, 3, 3))
        t_s = self.seconds(messages) - self.options.position_latency_s
        return Position(t_s, self.enu_m(messages, frame), covariance)

    def velocity(self) -> Velocity | None:
        """Return the velocities. An axis with a negative variance was not measured, so its velocity is NaN."""
        messages, frame = self.messages("velocity"), self.plan.velocity_frame
        if messages is None:
            return None
        require_known("velocity_frame", frame, VELOCITY_FRAMES)
        stated = messages.values.get("linear_covariance", np.zeros((len(messages), 9)))
        absent = stated[:, [0, 4, 8]] < 0
        unused = (absent[:, :, None] | absent[:, None, :]).reshape(-1, 9)
        messages = messages.with_values(velocity_covariance=np.where(unused, np.eye(3).ravel(), stated))
        sigma = self.options.velocity_sigma_mps
        messages = sound_covariances(messages, self.found, "velocity_covariance", sigma, "velocity_sigma_mps")
        mps = np.where(absent, np.nan, messages["linear"])
        covariance = messages["velocity_covariance"].reshape(-1, 3, 3)
        t_s, latency_s = self.seconds(messages), self.options.velocity_latency_s
        if frame in ROTATIONS:
            mps, covariance = swapped(ROTATIONS[frame], mps), rotated_covariance(ROTATIONS[frame], covariance)
        if frame in LOCAL_FRAMES:
            return velocity_when_true(t_s, mps, covariance, latency_s)
        if len(set(latency_s)) > 1:
            raise PluginError(
                f"velocity_latency_s is {list(latency_s)}; in the frame {frame}, all three latencies must be equal."
            )
        if frame == "speed":
            sigma_mps = float(np.sqrt(np.median(covariance[:, 0, 0])))
            return Velocity.along_course(t_s - latency_s[0], mps[:, 0], sigma_mps)
        return Velocity(t_s - latency_s[0], mps, covariance, "speed" if frame == "course" else "body")

    def heading(self) -> Heading | None:
        """Return the headings: the yaw of the orientations, and its standard deviation from their covariance."""
        messages, plan = self.messages("heading"), self.plan
        if messages is None:
            return None
        of_fixes = messages.topic == plan.topics.get("position")
        stated = plan.position_frame if of_fixes else plan.reference_frame
        frame: BagFrame = frame_of(messages, stated) if "position" in messages.values else "enu"
        turn = self.axes(frame)
        variance = rotated_covariance(turn, messages["orientation_covariance"].reshape(-1, 3, 3))[:, 2, 2]
        good = unit_quaternions(messages["orientation"]) & (variance > 0) & (variance < MAX_HEADING_SIGMA_RAD**2)
        messages = self.found.drop(messages, "a heading without a usable covariance", ~good)
        dcm = turn @ dcm_from_quaternion(messages["orientation"]) @ _body_axes(frame)
        yaw_rad = euler_from_dcm(dcm)[:, 2] if good.any() else np.empty(0)
        return Heading(self.seconds(messages), yaw_rad, np.sqrt(variance[good]), plan.heading_source)

    def reference(self, messages: Messages) -> Reference:
        """Return the reference: positions and, if available, attitudes and the velocities of twists, rotated to ENU."""
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
        """Return a note for each topic that has several roles, because these roles are not independent."""
        sharing = {topic: self.plan.roles(topic) for topic in self.plan.topics.values()}
        listed = {topic: f"{', '.join(roles[:-1])} and {roles[-1]}" for topic, roles in sharing.items() if roles[1:]}
        note = "{} are of the same topic, {}: they are not independent."
        return tuple(note.format(roles.capitalize(), topic) for topic, roles in listed.items())
