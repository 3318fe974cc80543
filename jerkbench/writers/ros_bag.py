"""A recording as a Fixposition-like ROS bag, which `dataset=fixposition` and `dataset=rosbag` read back as it was."""

import heapq
import shutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import chain, repeat
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from jerkbench.bags.metadata import METADATA_TOPIC, STRING, Metadata
from jerkbench.errors import RecordingError
from jerkbench.files import write_atomically
from jerkbench.recording import Origin, Recording
from jerkbench.writers.ros_messages import (
    ODOMETRY,
    Maker,
    Stamped,
    fix_messages,
    heading_messages,
    imu_messages,
    reference_messages,
    velocity_messages,
    whole_fixes,
    whole_rows,
)

TOPICS = {
    "imu": "/fixposition/poiimu",
    "position": "/fixposition/gnss1",
    "velocity": "/jerkbench/velocity",
    "heading": "/jerkbench/heading",
}
ODOMETRY_TOPIC, REFERENCE_TOPIC = "/fixposition/odometry_ecef", "/jerkbench/reference"
SOMETIME = datetime(2020, 1, 1, tzinfo=UTC)
"""Time 0 of a recording of which nobody knows when it was."""


def write_bag(recording: Recording, path: Path) -> list[str]:
    """Write a ROS 1 bag (.bag), or the one file of a ROS 2 bag (.db3, .mcap).

    What the driver has no topic for is under /jerkbench: velocities with their own frame, headings, and what belongs to
    the recording as a whole.

    Returns:
        What could not be written, a sentence each.

    Raises:
        RecordingError: it has no origin, so that nothing of it is on the Earth.
    """
    if recording.origin is None:
        raise RecordingError(
            f"{recording.name} has no origin on the Earth, and the topics of a bag are geodetic and ECEF; convert it to"
            " .csv or .parquet."
        )
    from rosbags.typesys import Stores, get_typestore

    ros1 = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    start = recording.start_utc or SOMETIME
    make = Maker(store, ros1, round(start.timestamp() * 1e6) * 1000)
    streams = _streams(make, recording, recording.origin)
    write = _write_ros1 if ros1 else _write_ros2
    write_atomically(path, lambda partial: write(make, streams, partial))
    return list(_left_out(recording, streams))


@dataclass(frozen=True)
class _Stream:
    """The messages of a topic; they are made when they are written, for those of hours would not fit into memory."""

    msgtype: str
    count: int
    messages: Iterator[Stamped]


def _streams(make: Maker, recording: Recording, origin: Origin) -> dict[str, _Stream]:
    position, velocity, heading, reference = (
        recording.position,
        recording.velocity,
        recording.heading,
        recording.reference,
    )
    streams = {TOPICS["imu"]: _stream(len(recording.inertial.t_s), imu_messages(make, recording.inertial))}
    if position is not None:
        streams[TOPICS["position"]] = _stream(int(whole_fixes(position).sum()), fix_messages(make, position, origin))
    if velocity is not None:
        streams[TOPICS["velocity"]] = _stream(len(velocity.t_s), velocity_messages(make, velocity))
    if heading is not None:
        streams[TOPICS["heading"]] = _stream(len(heading.t_s), heading_messages(make, heading))
    truth = _stream(int(whole_rows(reference).sum()), reference_messages(make, reference, origin))
    streams[ODOMETRY_TOPIC if truth.msgtype == ODOMETRY else REFERENCE_TOPIC] = truth
    streams = {topic: stream for topic, stream in streams.items() if stream.count}
    metadata = make.of(STRING, _metadata(recording, origin, make.start_ns, streams).to_json())
    return {**streams, METADATA_TOPIC: _stream(1, iter([(float(recording.inertial.t_s[0]), STRING, metadata)]))}


def _stream(count: int, messages: Iterator[Stamped]) -> _Stream:
    """The first message says of which type they are."""
    first = next(messages, None)
    return _Stream("", 0, iter(())) if first is None else _Stream(first[1], count, chain([first], messages))


def _left_out(recording: Recording, streams: Mapping[str, _Stream]) -> Iterator[str]:
    position, velocity, reference = recording.position, recording.velocity, recording.reference
    counts = {topic: stream.count for topic, stream in streams.items()}
    if position is not None and (lost := len(position.t_s) - counts.get(TOPICS["position"], 0)):
        yield f"{lost} of {len(position.t_s)} fixes lack an axis, and a NavSatFix has all three: they are left out."
    written = counts.get(ODOMETRY_TOPIC, counts.get(REFERENCE_TOPIC, 0))
    if not reference.empty and (lost := len(reference.t_s) - written):
        yield f"{lost} of {len(reference.t_s)} rows of the reference lack what other rows have: they are left out."
    if not reference.scored.all():
        yield "Which rows of the reference are scored has no place in a bag: all of them will be."
    if (position and position.true_covariance_m2 is not None) or (
        velocity and velocity.true_covariance_m2ps2 is not None
    ):
        yield "True covariances have no place in a bag: an oracle will see the reported ones."


def _metadata(recording: Recording, origin: Origin, start_ns: int, topics: Iterable[str]) -> Metadata:
    roles = {role: topic for role, topic in TOPICS.items() if topic in topics}
    references = [topic for topic in (ODOMETRY_TOPIC, REFERENCE_TOPIC) if topic in topics]
    velocity, heading = recording.velocity, recording.heading
    frame = "enu" if velocity is None else velocity.frame
    return Metadata(
        name=recording.name,
        start_ns=start_ns,
        static_start_s=recording.static_start_s,
        origin=(origin.latitude_deg, origin.longitude_deg, origin.height_m),
        reference_source=recording.reference.source,
        reference_independent=recording.reference.independent,
        outages_s=tuple((float(begin), float(end)) for begin, end in recording.outages_s),
        topics={**roles, **({"reference": references[0]} if references else {})},
        velocity_frame="course" if frame == "speed" else frame,
        heading_source="dual_antenna" if heading is None else heading.source,
        covariance_order="neu",
    )


def _write_ros1(make: Maker, streams: Mapping[str, _Stream], path: Path) -> None:
    from rosbags.rosbag1 import Writer

    with Writer(path) as writer:
        _fill(make, writer, make.store.serialize_ros1, streams)


def _write_ros2(make: Maker, streams: Mapping[str, _Stream], path: Path) -> None:
    """Write the folder of a ROS 2 bag, and keep its one file."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    plugin = StoragePlugin.MCAP if path.suffix == ".mcap" else StoragePlugin.SQLITE3
    with TemporaryDirectory(dir=path.parent) as folder:
        with Writer(Path(folder) / "bag", version=9, storage_plugin=plugin) as writer:
            _fill(make, writer, make.store.serialize_cdr, streams)
        (file,) = (Path(folder) / "bag").glob(f"*{path.suffix}")
        shutil.move(file, path)


def _fill(make: Maker, writer: Any, serialise: Any, streams: Mapping[str, _Stream]) -> None:  # noqa: ANN401 - one of two writers
    connections = [
        writer.add_connection(topic, stream.msgtype, typestore=make.store) for topic, stream in streams.items()
    ]
    bound = [
        zip(stream.messages, repeat(connection))
        for stream, connection in zip(streams.values(), connections, strict=True)
    ]
    for (t, msgtype, message), connection in heapq.merge(*bound, key=lambda pair: pair[0][0]):
        writer.write(connection, make.stamp_ns(t), serialise(message, msgtype))
