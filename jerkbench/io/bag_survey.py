"""The topics of a bag, whatever their roles, with what a user has to know to choose among them."""

from collections.abc import Iterator

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.io.bag import FIELDS, FIX, IMU, Bag, Messages
from jerkbench.io.bag_topics import is_ecef
from jerkbench.io.frames import felt_axis
from jerkbench.io.sanitiser import frozen_rows, unit_quaternions

MIN_UTM_M = 1e5
"""Local coordinates are smaller, those of map projections are larger."""

MIN_GRAVITY_MPS2 = 5.0


def survey(bag: Bag) -> Iterator[str]:
    """Yield a line for each topic, and indented lines with its properties.

    Raises:
        BagError: a topic is damaged.
    """
    for topic in bag.topics:
        if topic.msgtype not in FIELDS or not topic.count:
            yield f"{topic.name} ({topic.msgtype}): {topic.count} messages"
            continue
        messages = bag.read({topic.name: tuple(FIELDS[topic.msgtype])})[topic.name]
        frames = " in ".join(name for name in (messages.child_frame_id, messages.frame_id) if name)
        rate = f"{topic.count} messages, {messages.rate_hz():.4g} Hz"
        yield f"{topic.name} ({topic.msgtype}): {rate}, frame {frames or '-'}"
        with np.errstate(over="ignore", invalid="ignore"):  # damaged numbers are described too
            yield from [f"    {line}" for line in _properties(messages)]


def _properties(messages: Messages) -> Iterator[str]:
    yield from _stamps(messages)
    for name, value in messages.values.items():
        if count := int((~np.isfinite(value)).any(axis=1).sum()):
            yield f"{name.replace('_', ' ')} is NaN or infinite in {count} of {len(value)} messages"
    if messages.msgtype == IMU:
        yield from _imu(messages)
    elif messages.msgtype == FIX:
        states = zip(*np.unique(messages["status"], return_counts=True), strict=True)
        yield "status " + ", ".join(f"{int(status)}: {count}" for status, count in states)
        yield ", ".join(f"{name} {_range(messages[name])}" for name in ("latitude", "longitude", "altitude"))
    elif "position" in messages.values:
        yield _first_position(messages["position"])
    if "orientation" in messages.values and not unit_quaternions(messages["orientation"]).any():
        yield "no orientation"
    for name in ("position_covariance", "linear_covariance"):
        if name in messages.values:
            yield f"{name.replace('_', ' ')}: {_sigmas(messages[name][:, [0, 4, 8]])}"


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
    median = np.array([_median(axis) for axis in force.T])
    size = float(np.linalg.norm(median))
    felt = f"gravity on {felt_axis(median[None])}" if size >= MIN_GRAVITY_MPS2 else "no gravity in it"
    turn = "" if felt in ("gravity on +z", "no gravity in it") else ": give imu_axes"
    yield f"specific force (median) {_numbers(median)} m/s2, length {size:.3f}: {felt}{turn}"
    if (frozen := frozen_rows(rate)).any():
        yield f"the angular rate is frozen in {frozen.sum()} of {len(frozen)} rows"


def _first_position(position: FloatArray) -> str:
    if not position.any():
        return "every position is zero"
    first = position[int(np.argmax(np.abs(position).any(axis=1)))]
    frame, (x, y) = "local", np.abs(first[:2])
    if is_ecef(position):
        frame = "ECEF, by its distance from the Earth's centre"
    elif max(x, y) > MIN_UTM_M:
        order = "north first: probably NED" if x > y and x > 1e6 else "east first: probably ENU"
        frame = f"a map projection such as UTM, {order}"
    return f"first position {_numbers(first)} m: {frame}"


def _sigmas(variances: FloatArray) -> str:
    if not variances.any():
        return "zero throughout, that is, unknown"
    sigma = _numbers(np.sqrt([_median(axis) for axis in variances.T]))
    constant = len(np.unique(variances[variances.any(axis=1)], axis=0)) == 1
    return f"sigma {sigma} in every row: a placeholder rather than an estimate" if constant else f"sigma {sigma}"


def _median(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def _range(values: FloatArray) -> str:
    known = values[np.isfinite(values)]
    return f"{known.min():.5f} to {known.max():.5f}" if len(known) else "unknown"


def _numbers(values: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in values) + ")"
