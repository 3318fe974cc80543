"""Topics of a bag: their roles, the metadata that jerkbench writes, and the cleaning of their messages."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Self, get_args

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import RecordingError
from jerkbench.io.bag import (
    FIX,
    IMU,
    ODOMETRY,
    POSE,
    POSE_COVARIANCE,
    STRING,
    TWIST,
    TWIST_COVARIANCE,
    VECTOR,
    Bag,
    Messages,
)
from jerkbench.io.sanitiser import (
    HELD,
    MAX_DAMAGED,
    MAX_MPS,
    MAX_MPS2,
    MAX_RADPS,
    UNDATED,
    beyond,
    drop_notes,
    frozen_rows,
    held_rows,
    ordered_rows,
    possible_rows,
    require_origin,
    steady_rows,
    undated,
    unit_quaternions,
)

Role = Literal["imu", "position", "velocity", "heading", "reference"]
ROLES: tuple[Role, ...] = get_args(Role)
HeadingSource = Literal["dual_antenna", "odometry", "course"]

_COORDINATES = ("status", "latitude", "longitude", "altitude", "position_covariance")
_POSE = ("position", "orientation")
"""Fields that are zero in the messages of an odometry that has not started."""

_PLACES, _LINEAR = (*_POSE, "position_covariance"), ("linear", "linear_covariance")
ROLE_FIELDS: dict[Role, dict[str, tuple[str, ...]]] = {
    "imu": {IMU: ("angular_velocity", "linear_acceleration")},
    "position": {FIX: _COORDINATES, ODOMETRY: _PLACES, POSE_COVARIANCE: _PLACES},
    "velocity": {ODOMETRY: (*_POSE, *_LINEAR), TWIST_COVARIANCE: _LINEAR, TWIST: ("linear",), VECTOR: ("linear",)},
    "heading": {IMU: ("orientation", "orientation_covariance"), ODOMETRY: (*_POSE, "orientation_covariance")},
    "reference": {ODOMETRY: (*_POSE, "linear"), FIX: _COORDINATES, POSE_COVARIANCE: _POSE, POSE: _POSE},
}
"""Fields that are read for each role from each message type."""


@dataclass(frozen=True)
class TopicPlan:
    """The topic of each role, and the frames and sources of the topics.

    Attributes:
        topics: name of the topic of each role.
        notes: notes about guessed topics, with the reason for each guess.
        covariance_order: order of the axes in the covariances of fixes, either enu or neu.
        position_frame: frame of positions that are poses: auto, ecef, enu or ned.
        velocity_frame: frame of the velocities: body, course, frd, enu, ned or speed.
        reference_frame: frame of reference positions that are poses: auto, ecef, enu or ned.
        heading_source: the sensor that measured the headings.
        reference_source: source of the reference as a phrase, or an empty string to use the name of the topic.
        reference_independent: whether the reference is independent of the measurements.
    """

    topics: Mapping[Role, str]
    notes: tuple[str, ...] = ()
    covariance_order: str = "enu"
    position_frame: str = "auto"
    velocity_frame: str = "body"
    reference_frame: str = "auto"
    heading_source: HeadingSource = "odometry"
    reference_source: str = ""
    reference_independent: bool = False

    def label(self, topic: str) -> str:
        """Return the roles and the name of a topic as text, for messages."""
        return f"{', '.join(self.roles(topic))} ({topic})"

    def roles(self, topic: str) -> tuple[Role, ...]:
        """Return all roles to which a topic is assigned."""
        return tuple(role for role, name in self.topics.items() if name == topic)

    def fields(self, bag: Bag) -> dict[str, tuple[str, ...]]:
        """Return the names of the message fields that are read from each topic.

        Raises:
            RecordingError: a topic does not exist, or the message type of the topic does not support its role.
        """
        wanted: dict[str, dict[str, None]] = {}
        for role, name in self.topics.items():
            topic, types = bag.topic(name), ROLE_FIELDS[role]
            if topic.msgtype not in types:
                suitable = ", ".join(other.name for other in bag.topics if other.msgtype in types) or "none"
                raise RecordingError(
                    f"{bag.path}: the topic {name} has the type {topic.msgtype}, which contains no {role}. Set"
                    f" {role}_topic to a topic of the type {' or '.join(types)}. Topics of these types: {suitable}."
                )
            wanted.setdefault(name, {}).update(dict.fromkeys(types[topic.msgtype]))
        return {name: tuple(fields) for name, fields in wanted.items()}


# The metadata of a recording, which jerkbench writes as JSON, because no ROS message has fields for such metadata.

METADATA_TOPIC = "/jerkbench/about"
_OF_PLAN = ("covariance_order", "heading_source", "reference_independent", "reference_source", "velocity_frame")


@dataclass(frozen=True)
class Metadata:
    """The metadata that `jerkbench data convert` writes with the measurements.

    Attributes:
        name: name of the recording.
        start_ns: UTC at t_s = 0, in nanoseconds since 1970.
        static_start_s: duration for which the vehicle is stationary at the start [s].
        origin: latitude [deg], longitude [deg] and height [m] of the origin of ENU, or empty if unknown.
        outages_s: start and end of each interval without position fixes [s].
        plan: roles, frames and sources of the written topics.
    """

    name: str
    start_ns: int
    static_start_s: float
    origin: tuple[float, ...]
    outages_s: tuple[tuple[float, float], ...]
    plan: TopicPlan

    @classmethod
    def of(cls, bag: Bag) -> Self | None:
        """Return the metadata in a bag, or None if the bag has no metadata.

        Raises:
            RecordingError: the topic with the metadata is damaged.
        """
        if not any(topic.name == METADATA_TOPIC and topic.msgtype == STRING and topic.count for topic in bag.topics):
            return None
        text = bag.text(METADATA_TOPIC)
        try:
            return cls.from_plain(json.loads(text))
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise RecordingError(
                f"{bag.path}: the topic {METADATA_TOPIC} is damaged ({type(error).__name__}); create the bag again."
            ) from error

    @classmethod
    def from_plain(cls, values: dict[str, Any]) -> Self:
        """Return the metadata from parsed JSON.

        Raises:
            ValueError, TypeError, KeyError, AttributeError: an entry is missing or has a wrong type.
        """
        topics = {str(role): str(topic) for role, topic in values["topics"].items()}
        origin = tuple(float(value) for value in values["origin"])
        require_origin(METADATA_TOPIC, origin)
        start_ns = int(values["start_ns"])
        if undated(start_ns):
            raise ValueError(UNDATED)
        outages_s = tuple((float(start), float(end)) for start, end in values["outages_s"])
        plan = TopicPlan(topics, **{name: values[name] for name in _OF_PLAN})  # type: ignore[arg-type]  # see `fields`
        return cls(values["name"], start_ns, float(values["static_start_s"]), origin, outages_s, plan)

    def to_json(self) -> str:
        """Return the metadata as JSON, which is the content of the message."""
        values = vars(self) | {name: getattr(self.plan, name) for name in ("topics", *_OF_PLAN)}
        return json.dumps({name: value for name, value in values.items() if name != "plan"}, sort_keys=True)


EARTH_RADIUS_M = (6.3e6, 6.4e6)
"""Range of the median distance from the centre of the Earth [m] in which positions are regarded as ECEF."""


def is_ecef(position_m: FloatArray) -> bool:
    """Return whether positions (n, 3) [m] are in ECEF: their median norm is close to the Earth's radius."""
    with np.errstate(over="ignore"):
        radius_m = np.median(np.linalg.norm(position_m, axis=1)) if len(position_m) else 0.0
    return bool(EARTH_RADIUS_M[0] < radius_m < EARTH_RADIUS_M[1])


# Cleaning of the messages: faulty messages are repaired or dropped, and each kind of fault is counted.

RETAINED = "retained"

EARLIEST_NS = 946_684_800_000_000_000
"""Start of the year 2000. Earlier stamps are of a clock that was not set and started in 1970 or 1980."""

FAR_NS = 10_000_000_000
"""Maximum difference between the delay of a message (recording time minus stamp) and the median delay.

If the difference is larger, the stamp is damaged.
"""

_GAP = 2.5
"""A step between stamps is a gap if it is longer than the median step by more than this factor."""

_LIMITS = {
    "linear_acceleration": ("a specific force", MAX_MPS2, "m/s2"),
    "angular_velocity": ("an angular rate", MAX_RADPS, "rad/s"),
    "coordinates": ("a position", np.inf, ""),
    "position": ("a position", np.inf, ""),
    "linear": ("a velocity", MAX_MPS, "m/s"),
}
"""Name in notes, maximum plausible value and unit of each field. Positions are checked by `possible_rows` instead."""


@dataclass
class BagNotes:
    """Counts the faults of the messages of a bag.

    Attributes:
        plan: roles of the topics, which name the topics in the notes.
        start_ns: time of the first recorded message, by the clock of the recording computer [ns].
        notes: one note for each kind of fault of each topic.
    """

    plan: TopicPlan
    start_ns: int
    notes: list[str] = field(default_factory=list)

    def add(self, messages: Messages, fault: str, rows: BoolArray, done: str) -> None:
        """Add a note with the number of messages in the mask ``rows``, their ``fault`` and their treatment ``done``."""
        since_s = np.asarray((messages.bag_ns - self.start_ns) * 1e-9)
        self.notes += drop_notes(self.plan.label(messages.topic), {fault: rows}, done, since_s)

    def drop(self, messages: Messages, fault: str, rows: BoolArray) -> Messages:
        """Drop the messages in the mask ``rows`` (n,), and add a note with their number and their ``fault``."""
        self.add(messages, fault, rows, "dropped")
        return messages.rows(~rows) if rows.any() else messages


def clean_topics(raw: dict[str, Messages], plan: TopicPlan, *, bag_time: bool) -> tuple[dict[str, Messages], BagNotes]:
    """Return the messages of each topic with valid stamps and plausible values, and notes about the faults.

    A stamp before the year 2000 is replaced by the recording time minus the median delay of the valid stamps of the
    topic. If a topic has no valid stamps, the median of the delays of the other topics is used. If ``bag_time`` is
    True, the recording times replace all stamps. The function empties ``raw`` to save memory.

    Raises:
        RecordingError: fewer than two messages of a topic are left, or the stamps of a topic come from several clocks.
    """
    notes = BagNotes(plan, min((int(m.bag_ns[0]) for m in raw.values() if len(m)), default=0))
    good = {topic: (m.bag_ns - m.stamp_ns)[m.stamp_ns >= EARLIEST_NS] for topic, m in raw.items()}
    delays = {topic: int(np.median(delay)) for topic, delay in good.items() if len(delay)}
    otherwise = int(np.median(list(delays.values()))) if delays else 0
    clean = {}
    for topic in list(raw):
        messages, label = raw.pop(topic), plan.label(topic)
        if bag_time:
            messages = messages.stamped(messages.bag_ns)
        else:
            early, delay_ns = messages.stamp_ns < EARLIEST_NS, delays.get(topic, otherwise)
            done = f"replaced by the time of recording less {delay_ns * 1e-9:.3f} s"
            notes.add(messages, "a stamp before 2000", early, done)
            messages = messages.stamped(np.where(early, messages.bag_ns - delay_ns, messages.stamp_ns))
        messages = _near(notes.drop(messages, UNDATED, undated(messages.stamp_ns)), notes)
        messages = _possible(messages, plan, notes)
        order, of_order = ordered_rows(label, messages.stamp_ns)
        messages = messages.rows(order)
        notes.notes += of_order
        _count_gaps(messages, notes)
        if len(messages) < 2:
            said = " ".join(note for note in notes.notes if note.startswith(label)) or "No message was dropped."
            raise RecordingError(f"{label}: {len(messages)} usable messages are left; at least 2 are needed. {said}")
        clean[topic] = messages
    return clean, notes


def _near(messages: Messages, notes: BagNotes) -> Messages:
    """Drop messages whose delay (recording time minus stamp) is far from the median delay.

    If the delays of more than 10 % of the messages are far from the median delay, all messages are returned, because
    the stamps then come from another clock.
    """
    delay = messages.bag_ns - messages.stamp_ns
    far = np.abs(delay - (np.median(delay).astype(np.int64) if len(messages) else 0)) > FAR_NS
    fault = "a stamp far from the time of recording"
    if far.sum() <= MAX_DAMAGED * len(far):
        return notes.drop(messages, fault, far)
    notes.add(messages, f"{fault} (different clock)", far, RETAINED)
    return messages


def _possible(messages: Messages, plan: TopicPlan, notes: BagNotes) -> Messages:
    fields, label = messages.values, plan.label(messages.topic)
    if "status" in fields:
        messages = notes.drop(messages, "status -1 (no fix)", messages["status"][:, 0] < 0)
    if "latitude" in fields:
        messages = messages.with_values(coordinates=places_of(messages))
    for name in [name for name in messages.values if name in _LIMITS]:
        what, most, unit = _LIMITS[name]
        finite = np.asarray(np.isfinite(messages[name]).all(axis=1))
        messages = notes.drop(messages, f"{what} that is NaN or infinite", ~finite)
        messages = notes.drop(messages, f"{what} beyond {most:g} {unit}", beyond(messages[name], most))
    if messages.msgtype == IMU and "imu" in plan.roles(messages.topic):
        return notes.drop(messages, "a frozen angular rate", frozen_rows(messages["angular_velocity"]))
    if "orientation" in fields and "position" in fields:
        unit_length = unit_quaternions(messages["orientation"])
        if unit_length.any():  # otherwise, the topic has no orientations
            messages = notes.drop(messages, "an orientation that is not a unit quaternion", ~unit_length)
    if "latitude" in fields or "position" in fields:
        places = places_of(messages)
        frame = "geodetic" if "latitude" in fields else "ecef" if is_ecef(places) else "enu"
        rows, of_places = possible_rows(label, places=places, frame=frame)
        messages = messages.rows(rows)
        notes.notes += of_places
    return messages


def _count_gaps(messages: Messages, notes: BagNotes) -> None:
    """Add a note that counts the steps between stamps that are longer than 2.5 times the median step."""
    if len(messages) > 2:
        steps = np.diff(messages.stamp_ns)
        wide = np.concatenate([[False], steps > _GAP * np.median(steps)])
        notes.add(messages, f"a gap before them, up to {steps.max() * 1e-9:.2f} s", wide, RETAINED)


def places_of(messages: Messages) -> FloatArray:
    """Return the positions (n, 3) of poses [m], or the latitudes, longitudes [deg] and heights [m] of fixes."""
    if "position" in messages.values:
        return messages["position"]
    return np.column_stack([messages[name] for name in ("latitude", "longitude", "altitude")])


_ROUNDING = 1e-6
"""Maximum relative asymmetry of a covariance that is caused by rounding."""

MIN_FIX_VARIANCE, MAX_FIX_VARIANCE = 1e-14, 1e12
"""Range of valid variances. A smaller variance (0.1 micrometres) is a placeholder; a receiver without a fix writes
values such as 1e20."""


def sound_covariances(
    messages: Messages, notes: BagNotes, name: str, sigma: Sequence[float], parameter: str
) -> Messages:
    """Symmetrise the covariances (n, 9) of the field ``name``, and replace invalid covariances.

    The replacement is a diagonal covariance with the standard deviations ``sigma``. If ``sigma`` is empty, the
    replacement is the valid covariance of the topic with the median trace.

    Raises:
        RecordingError: no row has a valid covariance, and ``sigma`` is empty. The error message names ``parameter``,
            the option that sets ``sigma``.
    """
    matrices = messages[name].reshape(-1, 3, 3)
    symmetric = 0.5 * (matrices + matrices.transpose(0, 2, 1))
    good = _is_covariance(matrices, symmetric)
    if not good.any() and len(messages) and not sigma:
        raise RecordingError(
            f"{notes.plan.label(messages.topic)}: none of the {len(messages)} rows has a valid covariance (all are"
            f" zero, NaN or not positive definite); set {parameter} to the standard deviations of the three axes."
        )
    replacement, done = np.diag(np.square(sigma)), "replaced by sigmas of " + ", ".join(f"{s:g}" for s in sigma)
    if not sigma:
        traces = np.trace(symmetric[good], axis1=1, axis2=2)
        replacement = symmetric[good][np.argsort(traces)[len(traces) // 2]]
        done = "replaced by the stream's median covariance"
    notes.add(messages, f"a {name.replace('_', ' ')} that is zero, NaN or not positive definite", ~good, done)
    return messages.with_values(**{name: np.where(good[:, None, None], symmetric, replacement).reshape(-1, 9)})


def _is_covariance(matrices: FloatArray, symmetric: FloatArray) -> BoolArray:
    size = np.abs(symmetric).max(axis=(1, 2), initial=0)
    with np.errstate(over="ignore", invalid="ignore"):
        asymmetry = np.abs(matrices - symmetric).max(axis=(1, 2), initial=0)
        usable = (size < MAX_FIX_VARIANCE) & (asymmetry <= _ROUNDING * size)  # comparisons with NaN are false
    lowest = np.linalg.eigvalsh(np.where(usable[:, None, None], symmetric, 0.0))[:, 0]
    return np.asarray(usable & (lowest > MIN_FIX_VARIANCE))


def steady_fixes(messages: Messages, frame: str, notes: BagNotes) -> Messages:
    """Drop messages whose position in ``frame`` is far from its neighbours, or repeats the previous position.

    Raises:
        RecordingError: fewer than two messages are left.
    """
    label, places = notes.plan.label(messages.topic), places_of(messages)
    steady, of_leaps = steady_rows(label, np.asarray(messages.stamp_ns * 1e-9), places, frame)
    messages = messages.rows(steady)
    notes.notes += of_leaps
    messages = notes.drop(messages, HELD, held_rows(places_of(messages)))
    if len(messages) < 2:
        raise RecordingError(f"{label}: {len(messages)} usable positions are left; at least 2 are needed.")
    return messages
