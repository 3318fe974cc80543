"""A survey of the topics of a bag, whatever their roles: the oddities that a loader has to know."""

from collections.abc import Iterator

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.geometry import dcm_from_quaternion
from jerkbench.io.bag import Bag, Messages, Topic
from jerkbench.io.bag_decode import LAYOUTS
from jerkbench.io.bag_roles import FIX, IMU, is_ecef
from jerkbench.io.frames import felt_axis
from jerkbench.io.sanitiser import frozen_rows, unit_quaternions

# The frame of a twist, body or world, and its independence from its own positions.

TELLS = 0.7
"""One reading has to fit so much better than the other to be believed."""

SLOPE_MPS = 0.01
"""A velocity that differs less (rms) from the slope of the positions was computed from them."""

_MOVES_MPS = 0.1
"""Slower than that nothing can be told apart."""


def twist_frame(messages: Messages) -> Iterator[str]:
    """Yield in which frame the velocity fits the slope of the positions: as it is, or turned by the orientation."""
    rows = unit_quaternions(messages["orientation"]) & np.isfinite(messages["linear"]).all(axis=1)
    m = messages.rows(rows)
    m = m.rows(np.diff(m.stamp_ns, prepend=-1) > 0)
    t_s, position, linear = (m.stamp_ns - messages.stamp_ns[0]) * 1e-9, m["position"], m["linear"]
    if len(t_s) < 5 or np.sqrt((linear**2).sum(axis=1).mean()) < _MOVES_MPS:
        return
    slope, middle = np.diff(position, axis=0) / np.diff(t_s)[:, None], 0.5 * (linear[1:] + linear[:-1])
    turned = np.einsum("nij,nj->ni", dcm_from_quaternion(m["orientation"][1:]), middle)
    world, body = _misfit(middle - slope), _misfit(turned - slope)
    misfit = f"(misfit to the slope of the positions {min(world, body):.3f}, else {max(world, body):.3f} m/s)"
    if min(world, body) < TELLS * max(world, body):
        yield f"its velocity is in the {'world' if world < body else 'body'}'s frame {misfit}"
    if min(world, body) < SLOPE_MPS:
        yield "its velocity is the slope of its positions: not independent of them"


def _misfit(difference_mps: FloatArray) -> float:
    """Median length: a leap of the positions shall not decide."""
    return float(np.median(np.linalg.norm(difference_mps, axis=1)))


_COVARIANCES = ("position_covariance", "linear_covariance", "linear_acceleration_covariance")
BLOCKED = {"pose_covariance": "position_covariance", "twist_covariance": "linear_covariance"}
"""Of a covariance of six rows the part that is looked at."""

UTM_M = 1e5
"""Local coordinates are smaller, UTM's are larger."""

LEAST_GRAVITY_MPS2 = 5.0


def survey(bag: Bag) -> Iterator[str]:
    """Yield a line for each topic, and indented lines for what is to be known of it.

    Raises:
        BagError: a topic is damaged.
    """
    for topic in bag.topics:
        if topic.msgtype not in LAYOUTS or not topic.count:
            yield f"{topic.name} ({topic.msgtype}): {topic.count} messages"
            continue
        messages = bag.read({topic.name: _fields(topic)})[topic.name]
        frames = " in ".join(name for name in (messages.child_frame_id, messages.frame_id) if name)
        rate = f"{topic.count} messages, {messages.rate_hz():.4g} Hz"
        yield f"{topic.name} ({topic.msgtype}): {rate}, frame {frames or '-'}"
        with np.errstate(over="ignore", invalid="ignore"):  # damaged numbers are what is to be described
            lines = list(_oddities(messages))
        yield from (f"    {line}" for line in lines)


def _fields(topic: Topic) -> list[str]:
    unused = ("service", "orientation_covariance", "angular", *BLOCKED)
    names = [part.name for part in LAYOUTS[topic.msgtype]]
    return [name for name in names if name not in unused] + [BLOCKED[name] for name in names if name in BLOCKED]


def _oddities(messages: Messages) -> Iterator[str]:
    yield from _stamps(messages)
    for name, value in messages.values.items():
        if count := int((~np.isfinite(value)).any(axis=1).sum()):
            yield f"{name.replace('_', ' ')} is NaN or infinite in {count} of {len(value)} messages"
    if messages.msgtype == IMU:
        yield from _imu(messages)
    elif messages.msgtype == FIX:
        yield from _fixes(messages)
    elif "position" in messages.values:
        yield from _poses(messages)
    for name in (name for name in _COVARIANCES if name in messages.values):
        yield f"{name.replace('_', ' ')}: {_level(messages[name][:, [0, 4, 8]])}"


def _stamps(messages: Messages) -> Iterator[str]:
    delay_s = (messages.bag_ns - messages.stamp_ns) * 1e-9
    steps = np.diff(messages.stamp_ns)
    low, middle, high = np.percentile(delay_s, [0, 50, 100])
    late = f"; {np.mean(delay_s < 0):.0%} of the stamps are later than their recording" if low < 0 else ""
    yield f"recorded {middle:.3f} s after its stamp ({low:.3f} to {high:.3f} s){late}"
    if (steps <= 0).any():
        yield f"{(steps == 0).sum()} stamps repeat the one before, {(steps < 0).sum()} go backwards"


def _imu(messages: Messages) -> Iterator[str]:
    force, rate = messages["linear_acceleration"], messages["angular_velocity"]
    if not force.any() and not rate.any():
        yield "every measurement is zero: this is no IMU"
        return
    middle = np.array([_middle(axis) for axis in force.T])
    if not np.isfinite(middle).all():
        yield "the specific force is never a number on some axis"
        return
    size = float(np.linalg.norm(middle))
    felt = f"gravity on {felt_axis(middle[None])}" if size >= LEAST_GRAVITY_MPS2 else "no gravity in it"
    turn = "" if felt in ("gravity on +z", "no gravity in it") else ": give imu_axes"
    yield f"specific force (median) {_numbers(middle)} m/s2, length {size:.3f}: {felt}{turn}"
    if (frozen := frozen_rows(rate)).any():
        yield f"the angular rate is frozen in {frozen.sum()} of {len(frozen)} rows"
    if not unit_quaternions(messages["orientation"]).any():
        yield "no orientation"


def _fixes(messages: Messages) -> Iterator[str]:
    states = zip(*np.unique(messages["status"], return_counts=True), strict=True)
    yield "status " + ", ".join(f"{int(s)}: {n}" for s, n in states)
    coordinates = [messages[name][:, 0] for name in ("latitude", "longitude", "altitude")]
    if not all(np.isfinite(axis).any() for axis in coordinates):
        yield "no coordinates: never a number"
        return
    ranges = [f"{np.nanmin(axis):.5f} to {np.nanmax(axis):.5f}" for axis in coordinates]
    yield f"latitude {ranges[0]} deg, longitude {ranges[1]} deg, height {ranges[2]} m"


def _poses(messages: Messages) -> Iterator[str]:
    position = messages["position"]
    if not position.any():
        yield "every position is zero"
        return
    first = position[int(np.argmax(np.abs(position).any(axis=1)))]
    frame, (x, y) = "local", np.abs(first[:2])
    if is_ecef(position):
        frame = "ECEF, by its distance from the Earth's centre"
    elif max(x, y) > UTM_M:
        order = "north first: probably NED" if x > y and x > 1e6 else "east first: probably ENU"
        frame = f"a map projection such as UTM, {order}"
    yield f"first position {_numbers(first)} m: {frame}"
    if (~unit_quaternions(messages["orientation"])).all():
        yield "no orientation"
    elif "linear" in messages.values:
        yield from twist_frame(messages)


def _level(variances: FloatArray) -> str:
    if not variances.any():
        return "zero throughout, that is, unknown"
    zeros = int((variances == 0).any(axis=1).sum())
    zero_rows = f", zero in {zeros} rows" if zeros else ""
    with np.errstate(invalid="ignore"):
        sigma = _numbers(np.sqrt([_middle(axis) for axis in variances.T]))
    if len(np.unique(variances[variances.any(axis=1)], axis=0)) == 1:
        return f"sigma {sigma} in every row{zero_rows}: a placeholder rather than an estimate"
    return f"sigma (median) {sigma}{zero_rows}"


def _middle(values: FloatArray) -> float:
    """The median of what is a number; NaN where nothing is."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def _numbers(values: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"
