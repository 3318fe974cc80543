"""An estimated trajectory as it was read, its values at the reference's stamps, and one from a bag's odometry."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.estimate import Estimate
from jerkbench.geometry import dcm_from_euler, dcm_from_quaternion, euler_from_dcm
from jerkbench.io.clocks import ns_since_1970
from jerkbench.io.ros.bag import Bag, Messages, open_bag
from jerkbench.io.ros.writing import SOMETIME
from jerkbench.recording import Recording

SAME_S = 1e-6
"""Stamps that are nearer are the same: seconds since 1970 in 64 bits are known to a quarter of that."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Estimates at stamps of their own.

    Attributes:
        where: the file, for errors.
        t_s: (n,) seconds from the recording's start; increasing.
        enu_m: (n, 3) finite.
        velocity_mps: (n, 3) in ENU, finite, or None.
        euler_rad: (n, 3) roll, pitch, yaw; NaN where unknown; or None.
        covariance: (n, 6, 6) of position and velocity in ENU, NaN where unknown; or None.
    """

    where: str
    t_s: FloatArray
    enu_m: FloatArray
    velocity_mps: FloatArray | None = None
    euler_rad: FloatArray | None = None
    covariance: FloatArray | None = None


def estimate_at_reference(trajectory: Trajectory, recording: Recording, max_gap_s: float) -> Estimate:
    """Return the estimate at the reference's stamps from the trajectory's first sample to its last; nothing is aligned.

    A stamp between two samples that are no more than ``max_gap_s`` [s] apart is interpolated between them: position,
    velocity and covariance on a straight line, the attitude by the shortest turn. A trajectory that ends earlier than
    the reference, by more than that, is a run that stopped.

    Raises:
        RecordingError: it leaves a stamp in a longer gap.
    """
    stamps_s = recording.reference.t_s
    begin, end = trajectory.t_s[[0, -1]] + [-SAME_S, SAME_S]
    index = np.flatnonzero((stamps_s >= begin) & (stamps_s <= end)).astype(np.int64)
    before, share = _between(trajectory, stamps_s[index], max_gap_s)
    absent, failure, last_s = np.full((len(index), 3), np.nan), "", float(trajectory.t_s[-1])
    if len(stamps_s) and stamps_s[-1] > last_s + max_gap_s:
        failure = f"The trajectory ends at {last_s:.2f} s, the reference at {stamps_s[-1]:.2f} s."
    velocity, covariance, euler = trajectory.velocity_mps, trajectory.covariance, trajectory.euler_rad
    return Estimate(
        index=index,
        position_m=_on_line(trajectory.enu_m, before, share),
        velocity_mps=absent if velocity is None else _on_line(velocity, before, share),
        covariance=np.full((len(index), 6, 6), np.nan) if covariance is None else _on_line(covariance, before, share),
        euler_rad=absent if euler is None else _turned(euler, before, share),
        failure=failure,
        position_only=velocity is None,
    )


def _between(trajectory: Trajectory, stamps_s: FloatArray, gap_s: float) -> tuple[IntArray, FloatArray]:
    """Return (k,) the sample before each stamp, and how far (0 to 1) it is to the next; a sample at the stamp is taken.

    Raises:
        RecordingError: the samples around a stamp are further apart than ``gap_s``.
    """
    t_s, last = trajectory.t_s, len(trajectory.t_s) - 1
    before = np.clip(np.searchsorted(t_s, stamps_s + SAME_S, side="right") - 1, 0, last)
    after = np.minimum(before + 1, last)
    since_s, length_s = stamps_s - t_s[before], t_s[after] - t_s[before]
    between = np.abs(since_s) > SAME_S
    wide = between & (length_s > gap_s + SAME_S)
    if wide.any():
        k = int(np.argmax(wide))
        raise RecordingError(
            f"{trajectory.where} has no estimate between {t_s[before[k]]:.2f} and {t_s[after[k]]:.2f} s, where the"
            f" reference has one at {stamps_s[k]:.2f} s ({int(wide.sum())} such stamps, {last + 1} estimates in all);"
            f" write an estimate at each stamp, or allow longer gaps than {gap_s:g} s (filter.max_gap_s)."
        )
    return before.astype(np.int64), np.where(between, since_s / np.where(length_s > 0, length_s, 1.0), 0.0)


def _on_line(values: FloatArray, before: IntArray, share: FloatArray) -> FloatArray:
    """(k, ...) values on the straight line from the sample before to the one after; at a sample its own, to the bit."""
    after = np.minimum(before + 1, len(values) - 1)
    weight = share.reshape(-1, *[1] * (values.ndim - 1))
    return np.where(weight == 0.0, values[before], (1.0 - weight) * values[before] + weight * values[after])


def _turned(euler_rad: FloatArray, before: IntArray, share: FloatArray) -> FloatArray:
    """(k, 3) angles on the shortest turn from the sample before to the one after; NaN where one of them is unknown."""
    from scipy.spatial.transform import Rotation

    turned, second_rad = euler_rad[before], euler_rad[np.minimum(before + 1, len(euler_rad) - 1)]
    turned[(share > 0) & ~np.isfinite(second_rad).all(axis=1)] = np.nan
    rows = np.flatnonzero((share > 0) & np.isfinite(turned).all(axis=1))
    if len(rows):
        first, second = (Rotation.from_matrix(dcm_from_euler(angles[rows])) for angles in (turned, second_rad))
        part = Rotation.from_rotvec((first.inv() * second).as_rotvec() * share[rows, None])
        turned[rows] = euler_from_dcm((first * part).as_matrix())
    return turned


# A topic of a ROS bag -> the trajectory that a node has published.

BAGS = (".bag", ".db3", ".mcap")
"""Endings of bags."""

ODOMETRY = "nav_msgs/msg/Odometry"
POSES = ("geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/PoseStamped")
POSE = ("position", "orientation")
FIELDS = {
    ODOMETRY: (*POSE, "linear", "position_covariance", "linear_covariance"),
    POSES[0]: (*POSE, "position_covariance"),
    POSES[1]: POSE,
}
"""What is read of each type."""


def read_odometry(path: Path, topic: str, recording: Recording) -> Trajectory:
    """Read what a node has published: poses in the recording's ENU, the twist in the body, with their covariances.

    Args:
        path: the bag.
        topic: its name; empty: the only odometry of the bag.
        recording: what the node has run over; where nobody knows when it began, an exported bag begins in 2020.

    Raises:
        RecordingError: there is no such topic, it has no poses, or its stamps do not increase.
    """
    with open_bag(path) as bag:
        name = topic or _only_odometry(bag)
        msgtype = bag.topic(name).msgtype
        if msgtype not in FIELDS:
            advice = "name a topic of Odometry or of poses: filter.topic=..."
            raise RecordingError(f"{path}: {name} is a {msgtype}; {advice}")
        messages = bag.read({name: FIELDS[msgtype]})[name]
    where = f"{path}, {name}"
    t_s = _seconds(where, messages, recording)
    dcm = dcm_from_quaternion(messages["orientation"])
    velocity = np.einsum("nij,nj->ni", dcm, messages["linear"]) if msgtype == ODOMETRY else None
    return Trajectory(where, t_s, messages["position"], velocity, euler_from_dcm(dcm), _covariance(messages, dcm))


def _only_odometry(bag: Bag) -> str:
    names = [topic.name for topic in bag.topics if topic.msgtype == ODOMETRY]
    if len(names) != 1:
        raise RecordingError(
            f"{bag.path} has {len(names)} topics of {ODOMETRY}{': ' if names else ''}{', '.join(names)}; name the one "
            "to score: filter.topic=..."
        )
    return names[0]


def _seconds(where: str, messages: Messages, recording: Recording) -> FloatArray:
    start_ns = ns_since_1970(recording.start_utc or SOMETIME)
    if count := int((np.diff(messages.stamp_ns) <= 0).sum()):
        raise RecordingError(
            f"{where}: {count} of {len(messages)} messages are not later than the one before; publish each stamp once."
        )
    return np.asarray((messages.stamp_ns - start_ns) * 1e-9)


def _covariance(messages: Messages, dcm: FloatArray) -> FloatArray | None:
    """(n, 6, 6) in ENU; between position and velocity a message has none: zero; all zeros mean that it has nothing."""
    position, linear = (messages.values.get(f"{part}_covariance", np.zeros(1)) for part in ("position", "linear"))
    if not position.any():
        return None
    covariance = np.full((len(messages), 6, 6), np.nan)
    covariance[:, :3, :3] = position.reshape(-1, 3, 3)
    if linear.any():
        covariance[:, :3, 3:] = covariance[:, 3:, :3] = 0.0
        covariance[:, 3:, 3:] = dcm @ linear.reshape(-1, 3, 3) @ np.swapaxes(dcm, 1, 2)
    return covariance
