"""A bag and a plan -> a recording: read, clean, turn, order by time; its headings and its reference."""

import dataclasses
from abc import abstractmethod
from dataclasses import dataclass, replace
from datetime import timedelta
from pathlib import Path

import numpy as np

from jerkbench.arrays import nearest_rows
from jerkbench.errors import RecordingError
from jerkbench.geometry import dcm_from_euler, dcm_from_quaternion, euler_from_dcm
from jerkbench.io.bag import Bag, Messages, bag_files, content_files, missing_parts
from jerkbench.io.bag_extract import Extract, Frames, Metadata, Planner, choices_of, extract
from jerkbench.io.bag_roles import TopicPlan, clean_topics
from jerkbench.io.bag_streams import (
    BagOptions,
    Place,
    axes_to_enu,
    body_axes,
    first_place,
    fixes_in_enu,
    frame_of,
    heading_of,
    imu_of,
    position_of,
    seconds,
    usable_fixes,
    velocity_of,
)
from jerkbench.io.clocks import UNIX_EPOCH, with_common_time, with_own_outages
from jerkbench.io.files import FromFiles
from jerkbench.io.frames import ACCEL_UNITS, GYRO_UNITS, calibrated_at_rest, first_rest_s, gravity_notes
from jerkbench.io.sanitiser import Finding, Ledger, unit_quaternions
from jerkbench.recording import Heading, Position, Recording, Reference, Velocity

# Headings from fix to fix, for a recording that has no other.

_SURE = 4.0
"""A step between fixes has to be so many of its own sigmas long, for a course to be Gaussian and not reversed."""


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
            f"{recording.name}: within {over_s:g} s no two fixes are further apart than {_SURE:g} of their sigmas; make"
            " course_over_s longer."
        )
    ahead = f"they look {over_s / 2:g} s ahead, and share the fixes' errors."
    note = f"Headings are courses between fixes {over_s:g} s apart, placed in the middle: {ahead}"
    return replace(recording, heading=heading, notes=(*recording.notes, note))


def courses(position: Position, over_s: float) -> Heading:
    """Return the direction between fixes that are ``over_s`` apart, one after the other without overlap."""
    usual = float(np.median(np.diff(position.t_s)))
    rows = np.arange(0, len(position.t_s), max(round(over_s / usual), 1))
    t_s = position.t_s[rows]
    step_m, duration_s = np.diff(position.enu_m[rows, :2], axis=0), np.diff(t_s)
    variance = np.diagonal(position.covariance_m2[rows], axis1=1, axis2=2)[:, :2].max(axis=1)
    sigma_m = np.sqrt(variance[1:] + variance[:-1])
    far_m = np.linalg.norm(step_m, axis=1)
    with np.errstate(invalid="ignore"):
        sure = (far_m > _SURE * sigma_m) & (duration_s < 1.5 * over_s + usual)  # NaN and gaps are not sure
    middle_s = 0.5 * (t_s[1:] + t_s[:-1])[sure]
    yaw_rad = np.arctan2(step_m[sure, 1], step_m[sure, 0])
    return Heading(middle_s, yaw_rad, sigma_m[sure] / far_m[sure], "course")


# The reference of a recording from a bag, and the lever arm, which needs its attitude.

NO_REFERENCE = "none was named in the bag, so that errors are n/a and only the innovations (NIS) can judge"


def reference_of(
    messages: Messages, stated_frame: str, place: Place, zero_ns: int, source: str, *, independent: bool
) -> Reference:
    """Return positions, and, where the messages have them, attitudes and velocities (twists are in the body)."""
    frame = frame_of(messages, stated_frame)
    t_s, enu_m = seconds(messages.stamp_ns, zero_ns), fixes_in_enu(messages, frame, place)
    euler_rad = velocity_mps = None
    known = unit_quaternions(messages.values.get("orientation", np.zeros((1, 4))))
    if known.any():
        xyzw = np.where(known[:, None], messages["orientation"], [0.0, 0.0, 0.0, 1.0])
        dcm = axes_to_enu(frame, place) @ dcm_from_quaternion(xyzw) @ body_axes(frame)
        euler_rad = np.where(known[:, None], euler_from_dcm(dcm), np.nan)
        if "linear" in messages.values:
            mps = np.einsum("nij,nj->ni", dcm, messages["linear"] @ body_axes(frame))
            velocity_mps = np.where(known[:, None], mps, np.nan)
    return Reference(t_s, source, independent, enu_m=enu_m, velocity_mps=velocity_mps, euler_rad=euler_rad)


def at_body(position: Position, reference: Reference, lever_arm_m: tuple[float, ...]) -> Position:
    """Move fixes from the antenna to the body's reference point with the reference's nearest attitude.

    p_body = p_antenna - Omega l.

    Raises:
        RecordingError: the reference has no attitude.
    """
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
    return dataclasses.replace(position, enu_m=position.enu_m - omega @ np.array(lever_arm_m))


OTHER_CLOCK = "check that all topics are of one drive, or take the times of recording with time_source=bag"


@dataclass(frozen=True)
class Loaded:
    """A recording and how it came about.

    Attributes:
        recording: the recording.
        plan: which topic had which role.
        findings: the sanitiser's report.
    """

    recording: Recording
    plan: TopicPlan
    findings: tuple[Finding, ...]


class BagDataset(FromFiles, BagOptions):
    """A data set that is read from a ROS bag."""

    def loaded(self) -> Loaded:
        """Return the drive with the sanitiser's report and the topics."""
        return load_bag(self, self.plan)

    @abstractmethod
    def plan(self, bag: Bag) -> tuple[TopicPlan, Frames]:
        """Return which topic has which role, and in which frames."""

    def load(self, seed: int = 0) -> Recording:  # noqa: ARG002 - a file has no seeds
        """Return the drive; ``seed`` changes nothing.

        Raises:
            RecordingError: the bag is damaged, a topic is missing, or nothing usable is left.
        """
        return self.loaded().recording

    def paths(self) -> tuple[Path, ...]:
        """Return the bag's files."""
        return content_files(self.path)


def load_bag(options: BagOptions, planner: Planner) -> Loaded:
    """Read the bag of ``options`` into a recording.

    Raises:
        RecordingError: the bag is damaged, a topic is missing, nothing usable is left, or ``sanitise`` refuses.
        PluginError: a parameter does not fit.
    """
    path = options.path
    extracted = extract(path, planner, choices_of(options, BagOptions))
    plan, raw = extracted.plan, dict(extracted.raw)
    samples = raw[plan.topics["imu"]]
    force = samples["linear_acceleration"] * ACCEL_UNITS[options.accel_unit]
    rate = samples["angular_velocity"] * GYRO_UNITS[options.gyro_unit]
    raw[samples.topic] = samples.with_values(linear_acceleration=force, angular_velocity=rate)
    ledger = Ledger(options.sanitise, min((int(m.bag_ns[0]) for m in raw.values() if len(m)), default=0))
    clean = clean_topics(raw, plan, ledger, options.earliest_ns, bag_time=options.time_source == "bag")
    parts = missing_parts(bag_files(path))
    notes = [*options.remarks, *([f"Parts {parts} of the split bag are missing."] if parts else [])]
    recording = with_common_time(_assembled(options, extracted, clean, ledger), OTHER_CLOCK)
    notes += [*gravity_notes(recording.inertial.accel_mps2, "imu_axes"), *plan.notes, *recording.notes]
    notes += map(str, ledger.findings)
    return Loaded(replace(recording, notes=tuple(notes)), plan, tuple(ledger.findings))


def _assembled(options: BagOptions, extracted: Extract, clean: dict[str, Messages], ledger: Ledger) -> Recording:
    plan, frames, metadata = extracted.plan, extracted.frames, extracted.metadata
    roles = {role: clean[topic] for role, topic in plan.topics.items()}
    samples, fixes, truth = roles["imu"], roles.get("position"), roles.get("reference")
    zero_ns = metadata.start_ns if metadata else int(samples.stamp_ns[0]) + round(options.imu_shift_s * 1e9)
    imu, place = imu_of(samples, options, zero_ns), Place(None)
    origin = options.origin or (metadata.origin if metadata else ())
    position = velocity = heading = None
    if fixes is not None:
        fixes = usable_fixes(fixes, plan.label(fixes.topic), frames.position, options, ledger)
        place = first_place(fixes, frame_of(fixes, frames.position), origin)
        order, latency_s = frames.covariance_order, options.position_latency_s
        position = position_of(fixes, frames.position, order, latency_s, place, zero_ns)
    elif truth is not None:
        place = first_place(truth, frame_of(truth, frames.reference), origin)
    if (twists := roles.get("velocity")) is not None:
        velocity = velocity_of(twists, plan.label(twists.topic), frames.velocity, options, ledger, zero_ns)
    reference = Reference(imu.t_s if position is None else position.t_s, NO_REFERENCE, independent=False)
    if truth is not None:
        source = frames.reference_source or f"the topic {truth.topic}"
        independent = frames.reference_independent and len(plan.roles(truth.topic)) == 1
        reference = reference_of(truth, frames.reference, place, zero_ns, source, independent=independent)
    rest_s = _rest_s(options, metadata, velocity, float(imu.t_s[-1]))
    if (turned := roles.get("heading")) is not None:
        frame = frames.position if turned is roles.get("position") else frames.reference
        heading = heading_of(turned, plan.label(turned.topic), frames.heading, ledger, place, zero_ns, frame)
    recording = Recording(
        name=metadata.name if metadata else options.path.stem,
        imu=calibrated_at_rest(imu, rest_s, gyro=options.remove_gyro_bias, accel=options.scale_accel_to_gravity),
        reference=reference,
        position=None if position is None else at_body(position, reference, options.lever_arm_m),
        velocity=velocity,
        heading=heading,
        origin=place.origin,
        start_utc=UNIX_EPOCH + timedelta(microseconds=round(zero_ns / 1000)),
        static_start_s=rest_s,
        outages_s=np.array(metadata.outages_s if metadata else ()).reshape(-1, 2),
        notes=_dependence(plan),
    )
    return with_own_outages(recording, options.outage_s)


def _rest_s(options: BagOptions, metadata: Metadata | None, velocity: Velocity | None, end_s: float) -> float:
    if options.rest_s is not None:
        return options.rest_s
    if metadata is not None:
        return metadata.static_start_s
    if velocity is None or not (late := velocity.t_s >= 0).any():
        return 0.0
    return first_rest_s(velocity.t_s[late], np.linalg.norm(np.nan_to_num(velocity.mps[late]), axis=1), end_s)


def _dependence(plan: TopicPlan) -> tuple[str, ...]:
    """Sentences about roles that share a topic."""
    sharing = {topic: plan.roles(topic) for topic in plan.topics.values()}
    listed = {name: f"{', '.join(roles[:-1])} and {roles[-1]}" for name, roles in sharing.items() if len(roles) > 1}
    note = "{} are of one topic, {}: not independent of each other."
    return tuple(note.format(roles.capitalize(), name) for name, roles in listed.items())
