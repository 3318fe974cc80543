"""A recording as a Fixposition-like ROS bag, which `dataset=fixposition` and `dataset=rosbag` read back as it was."""

import heapq
import shutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import astuple
from datetime import UTC, datetime
from itertools import chain, repeat
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import RecordingError
from jerkbench.files import write_atomically
from jerkbench.geometry import dcm_from_euler, enu_axes, enu_to_ecef, enu_to_geodetic, quaternion_from_dcm
from jerkbench.io.bag import ODOMETRY, STRING
from jerkbench.io.bag_topics import METADATA_TOPIC, Metadata
from jerkbench.recording import Heading, Imu, Origin, Recording, Reference, Velocity

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


# The parts of a recording as ROS messages, in the frames and orders of the Fixposition driver.

NEU = [1, 0, 2]
"""Where north, east, up stand in east, north, up."""

"""Type of a reference of which everything is known."""

RTK_FIXED, _GPS, _KNOWN = 2, 1, 3
"""Status, service and type of covariance of a NavSatFix."""

NOT_MEASURED = -1.0
"""Variance of an axis that was not measured."""

Stamped = tuple[float, str, Any]
"""Time [s] since the start, type, message."""


class Maker(NamedTuple):
    """Makes messages of one generation of ROS.

    Attributes:
        store: the types.
        ros1: whether headers have a running number.
        start_ns: time 0, nanoseconds since 1970.
    """

    store: "Typestore"
    ros1: bool
    start_ns: int

    def stamp_ns(self, t_s: float) -> int:
        """Return the stamp of a time since the start."""
        return self.start_ns + round(t_s * 1e9)

    def of(self, msgtype: str, *values: Any) -> Any:  # noqa: ANN401 - a class that rosbags makes at run time
        """Return a message."""
        return self.store.types[msgtype](*values)

    def xyz(self, values: FloatArray, name: str = "Vector3") -> Any:  # noqa: ANN401 - as above
        """Return a Vector3, Point or Quaternion."""
        return self.of(f"geometry_msgs/msg/{name}", *(float(value) for value in values))

    def stamped(self, t_s: float, frame_id: str, msgtype: str, *body: Any) -> Stamped:  # noqa: ANN401 - as above
        """Return a message with a header."""
        stamp = self.of("builtin_interfaces/msg/Time", *divmod(self.stamp_ns(t_s), 1_000_000_000))
        header = self.of("std_msgs/msg/Header", *([0] if self.ros1 else []), stamp, frame_id)
        return t_s, msgtype, self.of(msgtype, header, *body)

    def imu(
        self, t_s: float, frame_id: str, xyzw: FloatArray, yaw_variance: float, rate: FloatArray, force: FloatArray
    ) -> Stamped:
        """Return an Imu; covariances of zeros are none."""
        none, turned = np.zeros(9), np.diag([0.0, 0.0, yaw_variance]).ravel()
        body = (self.xyz(xyzw, "Quaternion"), turned, self.xyz(rate), none, self.xyz(force), none)
        return self.stamped(t_s, frame_id, "sensor_msgs/msg/Imu", *body)

    def twist(self, mps: FloatArray, covariance: FloatArray) -> Any:  # noqa: ANN401 - as above
        """Return a TwistWithCovariance without a rotation."""
        twist = self.of("geometry_msgs/msg/Twist", self.xyz(mps), self.xyz(np.zeros(3)))
        return self.of("geometry_msgs/msg/TwistWithCovariance", twist, covariance.ravel())


def imu_messages(make: Maker, imu: Imu) -> Iterator[Stamped]:
    """Yield what the driver calls poiimu: orientation and covariances are zeros, that is, absent."""
    for t, force, rate in zip(imu.t_s, imu.accel_mps2, imu.gyro_radps, strict=True):
        yield make.imu(t, "FP_POI", np.zeros(4), 0.0, rate, force)


def fix_messages(
    make: Maker, t_s: FloatArray, enu_m: FloatArray, covariance: FloatArray, origin: Origin
) -> Iterator[Stamped]:
    """Yield what the driver calls gnss1: covariance in the order north, east, up."""
    covariance = covariance[:, NEU][:, :, NEU]
    for t, place, matrix in zip(t_s, enu_to_geodetic(enu_m, origin), covariance, strict=True):
        status = make.of("sensor_msgs/msg/NavSatStatus", RTK_FIXED, _GPS)
        where = (float(value) for value in place)
        yield make.stamped(t, "GNSS1", "sensor_msgs/msg/NavSatFix", status, *where, matrix.ravel(), _KNOWN)


def velocity_messages(make: Maker, velocity: Velocity) -> Iterator[Stamped]:
    """Yield velocities in the recording's own frame; an axis that was not measured has the variance -1."""
    present = np.isfinite(velocity.mps)
    rows = zip(velocity.t_s, velocity.mps, velocity.covariance_m2ps2, present, strict=True)
    for t, mps, covariance, measured in rows:
        six = np.zeros((6, 6))
        six[:3, :3] = np.where(np.outer(measured, measured), covariance, np.diag(np.where(measured, 0.0, NOT_MEASURED)))
        twist = make.twist(np.nan_to_num(mps), six)
        yield make.stamped(t, velocity.frame, "geometry_msgs/msg/TwistWithCovarianceStamped", twist)


def heading_messages(make: Maker, heading: Heading) -> Iterator[Stamped]:
    """Yield headings as u-blox's driver does: an Imu with nothing but a yaw and its variance."""
    for t, yaw, sigma in zip(heading.t_s, heading.yaw_rad, heading.sigma_rad, strict=True):
        turned = np.array([0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)])
        yield make.imu(t, "enu", turned, sigma**2, np.zeros(3), np.zeros(3))


def whole_rows(reference: Reference) -> BoolArray:
    """Return (k,) which rows know all that any row does; none of a reference without positions."""
    parts = [part for part in (reference.enu_m, reference.velocity_mps, reference.euler_rad) if part is not None]
    if reference.enu_m is None:
        return np.zeros(len(reference.t_s), dtype=bool)
    return np.asarray(np.isfinite(np.hstack(parts)).all(axis=1))


def reference_messages(make: Maker, reference: Reference, origin: Origin) -> Iterator[Stamped]:
    """Yield the reference: an odometry in ECEF where all of it is known, else a pose, else a fix.

    Rows in which something is not known that the others have are left out.
    """
    if reference.enu_m is None:
        return
    rows = whole_rows(reference)
    t_s, enu_m = reference.t_s[rows], reference.enu_m[rows]
    if reference.euler_rad is None:
        yield from fix_messages(make, t_s, enu_m, np.tile(1e-4 * np.eye(3), (len(t_s), 1, 1)), origin)
        return
    omega = dcm_from_euler(reference.euler_rad[rows])
    xyzw, small = quaternion_from_dcm(enu_axes(origin).T @ omega), 1e-4 * np.eye(6)
    body_mps = np.zeros_like(enu_m)
    if reference.velocity_mps is not None:
        body_mps = np.einsum("nji,nj->ni", omega, reference.velocity_mps[rows])
    for t, p, q, v in zip(t_s, enu_to_ecef(enu_m, origin), xyzw, body_mps, strict=True):
        pose = make.of("geometry_msgs/msg/Pose", make.xyz(p, "Point"), make.xyz(q, "Quaternion"))
        if reference.velocity_mps is None:
            yield make.stamped(t, "FP_ECEF", "geometry_msgs/msg/PoseStamped", pose)
        else:
            posed = make.of("geometry_msgs/msg/PoseWithCovariance", pose, small.ravel())
            yield make.stamped(t, "FP_ECEF", ODOMETRY, "FP_POI", posed, make.twist(v, small))


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
    write_atomically(path, lambda partial: _write(make, streams, partial))
    return list(_left_out(recording, streams))


class _Written(NamedTuple):
    """The messages of a topic; they are made when they are written, for those of hours would not fit into memory."""

    rows: int
    messages: Iterator[Stamped]


def _streams(make: Maker, recording: Recording, origin: Origin) -> dict[str, _Written]:
    position, velocity = recording.position, recording.velocity
    heading, reference, imu = recording.heading, recording.reference, recording.inertial
    streams = {TOPICS["imu"]: _Written(len(imu.t_s), imu_messages(make, imu))}
    if position is not None:
        rows = np.isfinite(position.enu_m).all(axis=1)
        whole = position.t_s[rows], position.enu_m[rows], position.covariance_m2[rows]
        streams[TOPICS["position"]] = _Written(int(rows.sum()), fix_messages(make, *whole, origin))
    if velocity is not None:
        streams[TOPICS["velocity"]] = _Written(len(velocity.t_s), velocity_messages(make, velocity))
    if heading is not None:
        streams[TOPICS["heading"]] = _Written(len(heading.t_s), heading_messages(make, heading))
    whole_odometry = reference.velocity_mps is not None and reference.euler_rad is not None
    truth = _Written(int(whole_rows(reference).sum()), reference_messages(make, reference, origin))
    streams[ODOMETRY_TOPIC if whole_odometry else REFERENCE_TOPIC] = truth
    streams = {topic: stream for topic, stream in streams.items() if stream.rows}
    metadata = make.of(STRING, _metadata(recording, origin, make.start_ns, streams).to_json())
    return {**streams, METADATA_TOPIC: _Written(1, iter([(float(imu.t_s[0]), STRING, metadata)]))}


def _left_out(recording: Recording, streams: Mapping[str, _Written]) -> Iterator[str]:
    position, velocity, reference = recording.position, recording.velocity, recording.reference
    counts = {topic: stream.rows for topic, stream in streams.items()}
    if position is not None and (lost := len(position.t_s) - counts.get(TOPICS["position"], 0)):
        yield f"{lost} of {len(position.t_s)} fixes lack an axis, and a NavSatFix has all three: they are left out."
    written = counts.get(ODOMETRY_TOPIC, counts.get(REFERENCE_TOPIC, 0))
    if not reference.empty and (lost := len(reference.t_s) - written):
        yield f"{lost} of {len(reference.t_s)} rows of the reference lack what other rows have: they are left out."
    if not reference.scored.all():
        yield "Which rows of the reference are scored has no place in a bag: all of them will be."
    known = position and position.true_covariance_m2, velocity and velocity.true_covariance_m2ps2
    if any(covariance is not None for covariance in known):
        yield "True covariances have no place in a bag: an oracle will see the reported ones."


def _metadata(recording: Recording, origin: Origin, start_ns: int, topics: Iterable[str]) -> Metadata:
    roles = {role: topic for role, topic in TOPICS.items() if topic in topics}
    references = [topic for topic in (ODOMETRY_TOPIC, REFERENCE_TOPIC) if topic in topics]
    velocity, heading = recording.velocity, recording.heading
    frame = "enu" if velocity is None else velocity.frame
    roles |= dict(zip(("reference",), references, strict=False))
    return Metadata(
        *(recording.name, start_ns, recording.static_start_s, astuple(origin)),
        *(recording.reference.source, recording.reference.independent),
        outages_s=tuple((float(begin), float(end)) for begin, end in recording.outages_s),
        topics=roles,
        velocity_frame="course" if frame == "speed" else frame,
        heading_source="dual_antenna" if heading is None else heading.source,
        covariance_order="neu",
    )


def _write(make: Maker, streams: Mapping[str, _Written], path: Path) -> None:
    """Write a ROS 1 bag, or the folder of a ROS 2 bag, of which its one file is kept."""
    if make.ros1:
        from rosbags import rosbag1

        with rosbag1.Writer(path) as writer:
            _fill(make, writer, make.store.serialize_ros1, streams)
        return
    from rosbags import rosbag2

    plugin = rosbag2.StoragePlugin.MCAP if path.suffix == ".mcap" else rosbag2.StoragePlugin.SQLITE3
    with TemporaryDirectory(dir=path.parent) as folder:
        with rosbag2.Writer(Path(folder) / "bag", version=9, storage_plugin=plugin) as two:
            _fill(make, two, make.store.serialize_cdr, streams)
        (file,) = (Path(folder) / "bag").glob(f"*{path.suffix}")
        shutil.move(file, path)


def _fill(make: Maker, writer: Any, serialise: Any, streams: Mapping[str, _Written]) -> None:  # noqa: ANN401 - one of two writers
    bound = []
    for topic, stream in streams.items():
        first = next(stream.messages)
        connection = writer.add_connection(topic, first[1], typestore=make.store)  # whose type the first message says
        bound.append(zip(chain([first], stream.messages), repeat(connection)))
    for (t, msgtype, message), connection in heapq.merge(*bound, key=lambda pair: pair[0][0]):
        writer.write(connection, make.stamp_ns(t), serialise(message, msgtype))
