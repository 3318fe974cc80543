"""The messages that a data set uses of a bag, before the sanitiser; cached by the content of the bag."""

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
from tokenize import TokenError
from typing import Any, Literal

import numpy as np

from jerkbench.bags.metadata import Metadata, read_metadata
from jerkbench.bags.roles import TopicPlan, wanted_fields
from jerkbench.files import cache_folder, forget_oldest, write_atomically
from jerkbench.readers.files import fingerprint
from jerkbench.readers.ros.bag import Bag, open_bag
from jerkbench.readers.ros.files import content_files
from jerkbench.readers.ros.messages import Messages

WORTH_BYTES = 4_000_000
"""A smaller bag is read faster than a person notices; it is not kept."""

MOST_BYTES = 2_000_000_000
"""No more than so much is kept; what was not used for the longest time goes first."""

BAGS = "bags"
"""The kind of cache that holds what was read of bags."""

PATTERN = "*.npz"
"""The extracts in their folder."""

DAMAGE = (
    OSError,
    EOFError,
    ValueError,
    KeyError,
    TypeError,
    AttributeError,
    SyntaxError,
    TokenError,
    MemoryError,
    OverflowError,
    RuntimeError,
    zipfile.BadZipFile,
)
"""Errors of a damaged or deleted file of the cache; the bag itself is read again."""


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
    heading: Literal["dual_antenna", "odometry"] = "odometry"
    reference_source: str = ""
    reference_independent: bool = False


Planner = Callable[[Bag], tuple[TopicPlan, Frames]]


@dataclass(frozen=True)
class Extract:
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
    stored = _kept(kept)
    if stored is not None:
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
    frames = Frames(
        covariance_order=metadata.covariance_order,
        velocity=metadata.velocity_frame,
        heading=metadata.heading_source,  # type: ignore[arg-type]  # Heading checks it
        reference_source=metadata.reference_source,
        reference_independent=metadata.reference_independent,
    )
    return TopicPlan(metadata.topics), frames  # type: ignore[arg-type]  # checked where its fields are looked up


def _keep(read: Extract, path: Path) -> None:
    arrays: dict[str, Any] = {}
    heads = []
    for k, messages in enumerate(read.raw.values()):
        heads.append([messages.topic, messages.msgtype, messages.frame_id, messages.child_frame_id])
        arrays |= {f"{k}.bag_ns": messages.bag_ns, f"{k}.stamp_ns": messages.stamp_ns}
        arrays |= {f"{k}:{name}": value for name, value in messages.values.items()}
    metadata = None if read.metadata is None else vars(read.metadata)
    header = {
        "metadata": metadata,
        "topics": dict(read.plan.topics),
        "notes": read.plan.notes,
        "frames": vars(read.frames),
        "heads": heads,
    }
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    write_atomically(path, lambda partial: np.savez(partial, **arrays))
    forget_oldest(path.parent, PATTERN, MOST_BYTES)


def _kept(path: Path) -> Extract | None:
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:  # closed on damage too
            arrays = {name: file[name] for name in file.files}
        header = json.loads(arrays.pop("header").tobytes())
        metadata = None if header["metadata"] is None else Metadata.from_plain(header["metadata"])
        raw = {head[0]: _messages(k, head, arrays) for k, head in enumerate(header["heads"])}
        with suppress(OSError):
            os.utime(path)  # used just now: others go first; a cache that is read only stays as it is
        return Extract(metadata, TopicPlan(header["topics"], tuple(header["notes"])), Frames(**header["frames"]), raw)
    except DAMAGE:
        return None


def _messages(k: int, head: list[str], arrays: dict[str, Any]) -> Messages:
    values = {name.partition(":")[2]: value for name, value in arrays.items() if name.startswith(f"{k}:")}
    topic, msgtype, frame_id, child_frame_id = head
    stamps = arrays[f"{k}.bag_ns"], arrays[f"{k}.stamp_ns"]
    return Messages(topic, msgtype, frame_id, child_frame_id, *stamps, values)


def choices_of(dataset: Any, common: type) -> str:  # noqa: ANN401 - a dataclass
    """Return the fields that a data set has besides those of ``common``, and their values."""
    shared = {f.name for f in dataclasses.fields(common)} - {"covariance_order"}
    own = {f.name: getattr(dataset, f.name) for f in dataclasses.fields(dataset) if f.name not in shared}
    return f"{type(dataset).__name__} {own}"


@cache
def _reader_digest() -> str:
    """Hash of the code that reads: what another version kept is not read."""
    package = Path(__file__).parents[1]
    sources = sorted([*(package / "readers" / "ros").glob("*.py"), *(package / "bags").glob("*.py")])
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest() + version("rosbags")
