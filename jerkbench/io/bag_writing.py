"""Writing of a recording as a ROS bag with the topics of a Fixposition, which the data set `fixposition` can read."""

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
from jerkbench.io.bag_topics import METADATA_TOPIC, Metadata, Role, TopicPlan
from jerkbench.recording import Heading, Imu, Origin, Recording, Reference, Velocity

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


# Conversion of a recording to ROS messages, in the frames of the Fixposition driver.

NEU = [1, 0, 2]
"""Indices of north, east and up in a vector in ENU."""

RTK_FIXED, _GPS, _KNOWN = 2, 1, 3
"""Status, service and type of covariance of a NavSatFix."""

NOT_MEASURED = -1.0
"""Variance of an axis that was not measured."""

Stamped = tuple[float, str, Any]
"""Time since the start [s], message type, and message."""


class Maker(NamedTuple):
    """Creates messages of ROS 1 or ROS 2.

    Attributes:
        store: the definitions of all message types.
        ros1: whether the messages have the format of ROS 1, in which headers contain a sequence number.
        start_ns: UTC at t_s = 0, in nanoseconds since 1970.
    """

    store: "Typestore"
    ros1: bool
    start_ns: int

    def stamp_ns(self, t_s: float) -> int:
        """Return the stamp [ns since 1970] of a time since the start [s]."""
        return self.start_ns + round(t_s * 1e9)

    def of(self, msgtype: str, *values: Any) -> Any:  # noqa: ANN401 - a class that rosbags makes at run time
        """Return a message of type ``msgtype`` with the fields ``values``."""
        return self.store.types[msgtype](*values)

    def xyz(self, values: FloatArray, name: str = "Vector3") -> Any:  # noqa: ANN401 - as above
        """Return a message of the type Vector3, Point or Quaternion with ``values``."""
        return self.of(f"geometry_msgs/msg/{name}", *(float(value) for value in values))

    def stamped(self, t_s: float, frame_id: str, msgtype: str, *body: Any) -> Stamped:  # noqa: ANN401 - as above
        """Return the time, the message type, and the message, which has a header and the fields ``body``."""
        stamp = self.of("builtin_interfaces/msg/Time", *divmod(self.stamp_ns(t_s), 1_000_000_000))
        header = self.of("std_msgs/msg/Header", *([0] if self.ros1 else []), stamp, frame_id)
        return t_s, msgtype, self.of(msgtype, header, *body)

    def imu(
        self, t_s: float, frame_id: str, xyzw: FloatArray, yaw_variance: float, rate: FloatArray, force: FloatArray
    ) -> Stamped:
        """Return an Imu message, in which covariances of zero mean that rate and force have unknown covariances."""
        none, orientation_covariance = np.zeros(9), np.diag([0.0, 0.0, yaw_variance]).ravel()
        body = (self.xyz(xyzw, "Quaternion"), orientation_covariance, self.xyz(rate), none, self.xyz(force), none)
        return self.stamped(t_s, frame_id, "sensor_msgs/msg/Imu", *body)

    def twist(self, mps: FloatArray, covariance: FloatArray) -> Any:  # noqa: ANN401 - as above
        """Return a TwistWithCovariance with the velocity ``mps``. The angular velocity is zero."""
        twist = self.of("geometry_msgs/msg/Twist", self.xyz(mps), self.xyz(np.zeros(3)))
        return self.of("geometry_msgs/msg/TwistWithCovariance", twist, covariance.ravel())


def imu_messages(make: Maker, imu: Imu) -> Iterator[Stamped]:
    """Yield messages of the topic poiimu, in which zeros mean that orientation and covariances are unknown."""
    for t, force, rate in zip(imu.t_s, imu.accel_mps2, imu.gyro_radps, strict=True):
        yield make.imu(t, "FP_POI", np.zeros(4), 0.0, rate, force)


def fix_messages(
    make: Maker, t_s: FloatArray, enu_m: FloatArray, covariance: FloatArray, origin: Origin
) -> Iterator[Stamped]:
    """Yield messages of the topic gnss1, with covariances in the order north, east, up."""
    covariance = covariance[:, NEU][:, :, NEU]
    for t, geodetic, matrix in zip(t_s, enu_to_geodetic(enu_m, origin), covariance, strict=True):
        status = make.of("sensor_msgs/msg/NavSatStatus", RTK_FIXED, _GPS)
        coordinates = (float(value) for value in geodetic)
        yield make.stamped(t, "GNSS1", "sensor_msgs/msg/NavSatFix", status, *coordinates, matrix.ravel(), _KNOWN)


def velocity_messages(make: Maker, velocity: Velocity) -> Iterator[Stamped]:
    """Yield velocities in the frame of the recording. An axis that was not measured has the variance -1."""
    rows = zip(velocity.t_s, velocity.mps, velocity.covariance_m2ps2, np.isfinite(velocity.mps), strict=True)
    for t, mps, covariance, measured in rows:
        six = np.zeros((6, 6))
        six[:3, :3] = np.where(np.outer(measured, measured), covariance, np.diag(np.where(measured, 0.0, NOT_MEASURED)))
        twist = make.twist(np.nan_to_num(mps), six)
        yield make.stamped(t, velocity.frame, "geometry_msgs/msg/TwistWithCovarianceStamped", twist)


def heading_messages(make: Maker, heading: Heading) -> Iterator[Stamped]:
    """Yield headings in the format of the u-blox driver: an Imu that contains only the yaw and its variance."""
    for t, yaw, sigma in zip(heading.t_s, heading.yaw_rad, heading.sigma_rad, strict=True):
        quaternion = np.array([0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)])
        yield make.imu(t, "enu", quaternion, sigma**2, np.zeros(3), np.zeros(3))


def complete_rows(reference: Reference) -> BoolArray:
    """Return a mask (k,) of the reference's rows without NaN, which is False everywhere without positions."""
    parts = [part for part in (reference.enu_m, reference.velocity_mps, reference.euler_rad) if part is not None]
    if reference.enu_m is None:
        return np.zeros(len(reference.t_s), dtype=bool)
    return np.asarray(np.isfinite(np.hstack(parts)).all(axis=1))


def reference_messages(make: Maker, reference: Reference, origin: Origin) -> Iterator[Stamped]:
    """Yield the complete rows of the reference as odometry in ECEF.

    If the reference has no velocity, yield poses. If the reference has no attitude, yield fixes.
    """
    if reference.enu_m is None:
        return
    rows = complete_rows(reference)
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


TOPICS: dict[Role, str] = {
    "imu": "/fixposition/poiimu",
    "position": "/fixposition/gnss1",
    "velocity": "/jerkbench/velocity",
    "heading": "/jerkbench/heading",
}
ODOMETRY_TOPIC, REFERENCE_TOPIC = "/fixposition/odometry_ecef", "/jerkbench/reference"
SOMETIME = datetime(2020, 1, 1, tzinfo=UTC)
"""Time 0 of a recording without a known date."""


def write_bag(recording: Recording, path: Path) -> list[str]:
    """Write a recording as a ROS 1 bag (.bag), or as the data file of a ROS 2 bag (.db3, .mcap).

    Data for which the Fixposition driver has no topic are written to topics under /jerkbench: velocities in their
    frame, headings, and the metadata of the recording.

    Returns:
        A message for each part of the recording that a bag cannot store.

    Raises:
        RecordingError: the recording has no origin on the Earth.
    """
    if recording.origin is None:
        raise RecordingError(f"{recording.name} has no origin on the Earth, which a bag needs; write .csv or .parquet.")
    from rosbags.typesys import Stores, get_typestore

    ros1 = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    start = recording.start_utc or SOMETIME
    make = Maker(store, ros1, round(start.timestamp() * 1e6) * 1000)
    streams = _streams(make, recording, recording.origin)
    write_atomically(path, lambda partial: _write(make, streams, partial))
    return list(_left_out(recording))


_Streams = Mapping[str, tuple[Stamped, Iterator[Stamped]]]
"""The first message of each topic, and an iterator that creates the other messages during writing, because they may not
fit into memory."""


def _streams(make: Maker, recording: Recording, origin: Origin) -> _Streams:
    position, velocity = recording.position, recording.velocity
    heading, reference, imu = recording.heading, recording.reference, recording.inertial
    streams = {TOPICS["imu"]: imu_messages(make, imu)}
    if position is not None:
        rows = np.isfinite(position.enu_m).all(axis=1)
        complete = position.t_s[rows], position.enu_m[rows], position.covariance_m2[rows]
        streams[TOPICS["position"]] = fix_messages(make, *complete, origin)
    if velocity is not None:
        streams[TOPICS["velocity"]] = velocity_messages(make, velocity)
    if heading is not None:
        streams[TOPICS["heading"]] = heading_messages(make, heading)
    is_odometry = reference.velocity_mps is not None and reference.euler_rad is not None
    streams[ODOMETRY_TOPIC if is_odometry else REFERENCE_TOPIC] = reference_messages(make, reference, origin)
    filled = {topic: (first, rest) for topic, rest in streams.items() if (first := next(rest, None))}
    metadata = make.of(STRING, _metadata(recording, origin, make.start_ns, filled).to_json())
    return {**filled, METADATA_TOPIC: ((float(imu.t_s[0]), STRING, metadata), iter(()))}


def _left_out(recording: Recording) -> Iterator[str]:
    position, velocity, reference = recording.position, recording.velocity, recording.reference
    if position is not None and (omitted := int((~np.isfinite(position.enu_m).all(axis=1)).sum())):
        yield f"{omitted} of {len(position.t_s)} fixes lack an axis that a NavSatFix needs and are omitted."
    if not reference.empty and (omitted := int((~complete_rows(reference)).sum())):
        yield f"{omitted} of {len(reference.t_s)} rows of the reference are incomplete and are omitted."
    if not reference.scored.all():
        yield "A bag cannot store which rows of the reference are scored: all rows will be scored."
    known = position and position.true_covariance_m2, velocity and velocity.true_covariance_m2ps2
    if any(covariance is not None for covariance in known):
        yield "A bag cannot store true covariances: an oracle will use the reported covariances."


def _metadata(recording: Recording, origin: Origin, start_ns: int, topics: Iterable[str]) -> Metadata:
    roles = {role: topic for role, topic in TOPICS.items() if topic in topics}
    references = [topic for topic in (ODOMETRY_TOPIC, REFERENCE_TOPIC) if topic in topics]
    velocity, heading = recording.velocity, recording.heading
    frame = "enu" if velocity is None else velocity.frame
    roles |= dict(zip(("reference",), references, strict=False))
    plan = TopicPlan(
        roles,
        velocity_frame="course" if frame == "speed" else frame,
        heading_source="odometry" if heading is not None and heading.source == "odometry" else "dual_antenna",
        covariance_order="neu",
        reference_source=recording.reference.source,
        reference_independent=recording.reference.independent,
    )
    outages_s = tuple((float(begin), float(end)) for begin, end in recording.outages_s)
    return Metadata(recording.name, start_ns, recording.static_start_s, astuple(origin), outages_s, plan)


def _write(make: Maker, streams: _Streams, path: Path) -> None:
    """Write a ROS 1 bag, or the data file of a ROS 2 bag without the other files of its folder."""
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


def _fill(make: Maker, writer: Any, serialise: Any, streams: _Streams) -> None:  # noqa: ANN401 - one of two writers
    bound = []
    for topic, (first, rest) in streams.items():
        connection = writer.add_connection(topic, first[1], typestore=make.store)  # the first message sets the type
        bound.append(zip(chain([first], rest), repeat(connection)))
    for (t, msgtype, message), connection in heapq.merge(*bound, key=lambda pair: pair[0][0]):
        writer.write(connection, make.stamp_ns(t), serialise(message, msgtype))
