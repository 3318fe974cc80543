"""The messages that a data set uses of a bag, before the sanitiser, and the metadata that our own writer adds."""

import dataclasses
import hashlib
import json
import os
import warnings
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from jerkbench.files import cache_folder, forget_oldest, write_atomically
from jerkbench.io.bag import Bag, BagError, Messages, content_files, open_bag
from jerkbench.io.bag_roles import TopicPlan, wanted_fields
from jerkbench.io.files import NO_ARRAY, fingerprint
from jerkbench.io.limits import UNDATED, require_origin, undated

# The metadata of a recording that no ROS message holds: the topic that our own writer adds, as
# JSON.

METADATA_TOPIC = "/jerkbench/about"
STRING = "std_msgs/msg/String"


@dataclass(frozen=True)
class Metadata:
    """The metadata that `jerkbench data convert` writes beside the measurements.

    Attributes:
        name: of the recording.
        start_ns: time 0, nanoseconds since 1970.
        static_start_s: how long it stands still.
        origin: latitude [deg], longitude [deg], height [m]; empty where unknown.
        reference_source: where the reference comes from.
        reference_independent: whether it shares nothing with the measurements.
        outages_s: intervals without aiding.
        topics: role -> topic.
        velocity_frame: frame of the velocity.
        heading_source: what measured the headings.
        covariance_order: of the fixes: neu or enu.
    """

    name: str
    start_ns: int
    static_start_s: float
    origin: tuple[float, ...]
    reference_source: str
    reference_independent: bool
    outages_s: tuple[tuple[float, float], ...]
    topics: dict[str, str]
    velocity_frame: str
    heading_source: str
    covariance_order: str

    @classmethod
    def from_plain(cls, values: dict[str, Any]) -> Self:
        """Return it from what JSON makes of it.

        Raises:
            ValueError, TypeError, KeyError, AttributeError: something is missing or of another type.
        """
        topics = {str(role): str(topic) for role, topic in values["topics"].items()}
        origin = tuple(float(value) for value in values["origin"])
        require_origin(METADATA_TOPIC, origin)
        times = {"start_ns": int(values["start_ns"]), "static_start_s": float(values["static_start_s"])}
        if undated(times["start_ns"]):
            raise ValueError(UNDATED)
        outages_s = tuple((float(begin), float(end)) for begin, end in values["outages_s"])
        return cls(**{**values, **times, "topics": topics, "origin": origin, "outages_s": outages_s})

    def to_json(self) -> str:
        """Return the content of the message."""
        return json.dumps(vars(self), sort_keys=True)


def read_metadata(bag: Bag) -> Metadata | None:
    """Return what the bag's own topic says, or None where there is none.

    Raises:
        BagError: the topic is there and damaged.
    """
    if not any(topic.name == METADATA_TOPIC and topic.msgtype == STRING and topic.count for topic in bag.topics):
        return None
    text = bag.text(METADATA_TOPIC)
    try:
        return Metadata.from_plain(json.loads(text))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise BagError(
            f"{bag.path}, topic {METADATA_TOPIC} is damaged ({type(error).__name__}); convert the recording once more."
        ) from error


WORTH_BYTES = 4_000_000
"""A smaller bag is read faster than a person notices; it is not kept."""

MOST_BYTES = 2_000_000_000
"""No more than so much is kept; what was not used for the longest time goes first."""

BAGS = "bags"
"""The kind of cache that holds what was read of bags."""

PATTERN = "*.npz"
"""The extracts in their folder."""

DAMAGE = (*NO_ARRAY, KeyError, AttributeError, RuntimeError, zipfile.BadZipFile)
"""Errors of a damaged or deleted file of the cache; the bag itself is read again."""


HeadingSource = Literal["dual_antenna", "odometry"]


@dataclass(frozen=True)
class Frames:
    """The frames and orders of the topics of a plan.

    Attributes:
        covariance_order: of the position's covariances: enu or neu.
        position: frame of the position's poses: auto, ecef, enu or ned.
        velocity: body, course, frd, enu, ned or speed.
        reference: frame of the reference's poses.
        heading: what measured the headings.
        reference_source: where the reference comes from; empty: its topic.
        reference_independent: whether it shares nothing with the measurements.
    """

    covariance_order: str = "enu"
    position: str = "auto"
    velocity: str = "body"
    reference: str = "auto"
    heading: HeadingSource = "odometry"
    reference_source: str = ""
    reference_independent: bool = False


Planner = Callable[[Bag], tuple[TopicPlan, Frames]]


class Extract(NamedTuple):
    """The messages that are used, and what they are used for.

    Attributes:
        metadata: the metadata that our own writer added, or None.
        plan: which topic has which role.
        frames: how they are to be understood.
        raw: the messages by topic.
    """

    metadata: Metadata | None
    plan: TopicPlan
    frames: Frames
    raw: dict[str, Messages]


def extract(path: Path, planner: Planner, choices: str) -> Extract:
    """Return what ``planner`` takes out of the bag; of a large bag the second time from the cache.

    Args:
        path: the bag.
        planner: decides about topics.
        choices: everything that its decision depends on besides the bag.

    Raises:
        RecordingError: the bag is damaged, or lacks a topic.
    """
    files = content_files(path)
    if sum(file.stat().st_size for file in files) < WORTH_BYTES:
        return _read(path, planner)
    mark = fingerprint(files)
    key = f"{mark} {choices} {_reader_digest()}"
    kept = cache_folder(BAGS) / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.npz"
    if (stored := _kept(kept)) is not None:
        return stored
    read = _read(path, planner)
    if fingerprint(content_files(path)) != mark:  # it changed meanwhile: what was read has no name to keep it under
        return read
    try:
        _keep(read, kept)
    except OSError as error:
        warnings.warn(f"{kept.parent} cannot be written ({error}); bags are read anew each time.", stacklevel=2)
    return read


def _read(path: Path, planner: Planner) -> Extract:
    with open_bag(path) as bag:
        metadata = read_metadata(bag)
        plan, frames = planner(bag) if metadata is None else _as_written(metadata)
        return Extract(metadata, plan, frames, bag.read(wanted_fields(plan, bag)))


def _as_written(metadata: Metadata) -> tuple[TopicPlan, Frames]:
    """Return the plan and the frames that our own writer stored; they need no planner."""
    m, auto = metadata, "auto"
    source = m.reference_source, m.reference_independent
    frames = Frames(m.covariance_order, auto, m.velocity_frame, auto, m.heading_source, *source)  # type: ignore[arg-type]  # Heading checks it
    return TopicPlan(m.topics), frames  # type: ignore[arg-type]  # checked where its fields are looked up


def _keep(read: Extract, path: Path) -> None:
    arrays: dict[str, Any] = {}
    heads = []
    for k, messages in enumerate(read.raw.values()):
        heads.append([messages.topic, messages.msgtype, messages.frame_id, messages.child_frame_id])
        arrays |= {f"{k}.bag_ns": messages.bag_ns, f"{k}.stamp_ns": messages.stamp_ns}
        arrays |= {f"{k}:{name}": value for name, value in messages.values.items()}
    metadata = None if read.metadata is None else vars(read.metadata)
    header = metadata, dict(read.plan.topics), read.plan.notes, vars(read.frames), heads
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    write_atomically(path, lambda partial: np.savez(partial, **arrays))
    forget_oldest(path.parent, PATTERN, MOST_BYTES)


def _kept(path: Path) -> Extract | None:
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:  # closed on damage too
            arrays = {name: file[name] for name in file.files}
        told, topics, notes, frames, heads = json.loads(arrays.pop("header").tobytes())
        metadata = None if told is None else Metadata.from_plain(told)
        raw = {}
        for k, (topic, msgtype, frame, child) in enumerate(heads):
            values = {name.partition(":")[2]: value for name, value in arrays.items() if name.startswith(f"{k}:")}
            stamps = arrays[f"{k}.bag_ns"], arrays[f"{k}.stamp_ns"]
            raw[topic] = Messages(topic, msgtype, frame, child, *stamps, values)
        with suppress(OSError):
            os.utime(path)  # used just now: others go first; a cache that is read only stays as it is
        return Extract(metadata, TopicPlan(topics, tuple(notes)), Frames(**frames), raw)
    except DAMAGE:
        return None


def choices_of(dataset: Any, common: type) -> str:  # noqa: ANN401 - a dataclass
    """Return the fields that a data set has besides those of ``common``, and their values."""
    shared = {f.name for f in dataclasses.fields(common)} - {"covariance_order"}
    own = {f.name: getattr(dataset, f.name) for f in dataclasses.fields(dataset) if f.name not in shared}
    return f"{type(dataset).__name__} {own}"


@cache
def _reader_digest() -> str:
    """Hash of the code that reads: what another version kept is not read."""
    sources = sorted(Path(__file__).parent.glob("bag*.py"))
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest() + version("rosbags")
