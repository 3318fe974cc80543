"""A bag and a plan -> a recording: read, clean, turn, order by time."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.bags.cleaning import by_topic, clean_topics
from jerkbench.bags.extract import Frames, Planner, choices_of, extract
from jerkbench.bags.metadata import Metadata
from jerkbench.bags.options import BagOptions
from jerkbench.bags.positions import Place, first_place, frame_of
from jerkbench.bags.references import at_body, no_reference, reference_of
from jerkbench.bags.roles import TopicPlan
from jerkbench.bags.streams import heading_of, imu_of, position_of, usable_fixes, velocity_of
from jerkbench.readers.gravity import gravity_notes
from jerkbench.readers.overlap import with_common_time
from jerkbench.readers.ros.files import bag_files, missing_parts
from jerkbench.readers.ros.messages import Messages
from jerkbench.readers.standstill import calibrated, first_rest_s
from jerkbench.recording import Heading, Imu, Position, Recording, Reference, Velocity
from jerkbench.sanitiser.ledger import Finding, Ledger

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


def load_bag(options: BagOptions, planner: Planner) -> Loaded:
    """Read the bag of ``options`` into a recording.

    Raises:
        RecordingError: the bag is damaged, a topic is missing, nothing usable is left, or ``sanitise`` refuses.
        PluginError: a parameter does not fit.
    """
    path = options.path
    extracted = extract(path, planner, choices_of(options, BagOptions))
    plan, raw = extracted.plan, dict(extracted.raw)
    ledger = Ledger(options.sanitise, min((int(m.bag_ns[0]) for m in raw.values() if len(m)), default=0))
    clean = clean_topics(raw, plan, ledger, options.earliest_ns, bag_time=options.time_source == "bag")
    parts = missing_parts(bag_files(path))
    notes = [*options.remarks, *([f"Parts {parts} of the split bag are missing."] if parts else [])]
    recording = with_common_time(
        _assembled(options, plan, extracted.frames, extracted.metadata, clean, ledger), OTHER_CLOCK
    )
    notes += [
        *gravity_notes(recording.inertial.accel_mps2, "imu_axes"),
        *plan.notes,
        *recording.notes,
        *(str(finding) for finding in ledger.findings),
    ]
    return Loaded(replace(recording, notes=tuple(notes)), plan, tuple(ledger.findings))


def _assembled(
    options: BagOptions,
    plan: TopicPlan,
    frames: Frames,
    metadata: Metadata | None,
    clean: dict[str, Messages],
    ledger: Ledger,
) -> Recording:
    samples = _required(clean, plan, "imu")
    zero_ns = metadata.start_ns if metadata else int(samples.stamp_ns[0]) + round(options.imu_shift_s * 1e9)
    imu = imu_of(samples, options, zero_ns)
    fixes, place = _fixes(options, plan, frames, metadata, clean, ledger)
    position = None
    if fixes is not None:
        order, latency_s = frames.covariance_order, options.position_latency_s
        position = position_of(fixes, frames.position, order, latency_s, place, zero_ns)
    velocity = _velocity(options, plan, frames, clean, ledger, zero_ns)
    reference = _reference(plan, frames, clean, place, zero_ns, imu if position is None else position)
    rest_s = _rest_s(options, metadata, velocity, float(imu.t_s[-1]))
    return Recording(
        name=metadata.name if metadata else options.path.stem,
        imu=calibrated(imu, rest_s, gyro=options.remove_gyro_bias, accel=options.scale_accel_to_gravity),
        reference=reference,
        position=None if position is None else at_body(position, reference, options.lever_arm_m),
        velocity=velocity,
        heading=_heading(plan, frames, clean, ledger, place, zero_ns),
        origin=place.origin,
        start_utc=datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=round(zero_ns / 1000)),
        static_start_s=rest_s,
        outages_s=np.array(metadata.outages_s if metadata else ()).reshape(-1, 2),
        notes=_dependence(plan),
    )


def _required(clean: dict[str, Messages], plan: TopicPlan, role: str) -> Messages:
    return clean[plan.topics[role]]  # type: ignore[index]  # a plan has an IMU


def _fixes(
    options: BagOptions,
    plan: TopicPlan,
    frames: Frames,
    metadata: Metadata | None,
    clean: dict[str, Messages],
    ledger: Ledger,
) -> tuple[Messages | None, Place]:
    """The usable positions, and where ENU begins."""
    messages, origin = by_topic(plan, clean, "position"), options.origin or (metadata.origin if metadata else ())
    if messages is not None:
        messages = usable_fixes(messages, plan.label(messages.topic), frames.position, options, ledger)
        return messages, first_place(messages, frame_of(messages, frames.position), origin)
    reference = by_topic(plan, clean, "reference")
    if reference is None:
        return None, Place(None, np.zeros(3))
    return None, first_place(reference, frame_of(reference, frames.reference), origin)


def _velocity(
    options: BagOptions, plan: TopicPlan, frames: Frames, clean: dict[str, Messages], ledger: Ledger, zero_ns: int
) -> Velocity | None:
    messages = by_topic(plan, clean, "velocity")
    if messages is None:
        return None
    return velocity_of(messages, plan.label(messages.topic), frames.velocity, options, ledger, zero_ns)


def _reference(
    plan: TopicPlan, frames: Frames, clean: dict[str, Messages], place: Place, zero_ns: int, otherwise: Imu | Position
) -> Reference:
    messages = by_topic(plan, clean, "reference")
    if messages is None:
        return no_reference(otherwise.t_s)
    source = frames.reference_source or f"the topic {messages.topic}"
    independent = frames.reference_independent and len(plan.roles(messages.topic)) == 1
    return reference_of(messages, frames.reference, place, zero_ns, source, independent=independent)


def _heading(
    plan: TopicPlan, frames: Frames, clean: dict[str, Messages], ledger: Ledger, place: Place, zero_ns: int
) -> Heading | None:
    messages = by_topic(plan, clean, "heading")
    if messages is None:
        return None
    label, same = plan.label(messages.topic), messages.topic == plan.topics.get("position")
    frame = frames.position if same else frames.reference
    return heading_of(messages, label, frames.heading, ledger, place, zero_ns, frame)


def _rest_s(options: BagOptions, metadata: Metadata | None, velocity: Velocity | None, end_s: float) -> float:
    if options.rest_s is not None:
        return options.rest_s
    if metadata is not None:
        return metadata.static_start_s
    if velocity is None:
        return 0.0
    late = velocity.t_s >= 0
    speed: FloatArray = np.linalg.norm(np.nan_to_num(velocity.mps[late]), axis=1)
    return first_rest_s(velocity.t_s[late], speed, end_s) if late.any() else 0.0


def _dependence(plan: TopicPlan) -> tuple[str, ...]:
    """Sentences about roles that share a topic."""
    sharing = {topic: plan.roles(topic) for topic in plan.topics.values()}
    return tuple(
        f"{' and '.join([', '.join(roles[:-1]), roles[-1]]).capitalize()} are of one topic, {topic}: not independent of"
        " each other."
        for topic, roles in sharing.items()
        if len(roles) > 1
    )
