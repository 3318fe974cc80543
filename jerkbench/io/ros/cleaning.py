"""Every topic through the sanitiser: stamps first, then the values that its roles use."""

from collections.abc import Mapping

import numpy as np

from jerkbench.errors import RecordingError
from jerkbench.io.ros.bag import Messages
from jerkbench.io.ros.roles import IMU, Role, TopicPlan
from jerkbench.io.sanitiser import (
    DROPPED,
    MOST_MPS,
    MOST_MPS2,
    MOST_RADPS,
    Ledger,
    ordered,
    report_gaps,
    unit_quaternions,
    usual_delay_ns,
    with_late_enough_stamps,
    without_bad_quaternions,
    without_frozen_gyro,
    without_impossible,
    without_no_fix,
)

EARTH_RADIUS_M = (6.3e6, 6.4e6)
"""Distances [m] of the Earth's surface from its centre; positions between them are in ECEF."""

MOST_M = 1e8
"""No local or UTM coordinate is larger."""


def clean_topics(
    raw: dict[str, Messages], plan: TopicPlan, ledger: Ledger, earliest_ns: int, *, bag_time: bool
) -> dict[str, Messages]:
    """Return the messages of each topic with good stamps and possible values; takes them out of ``raw``.

    Raises:
        RecordingError: nothing of a topic is left, or the mode is "refuse" and something is wrong.
    """
    delays = [usual_delay_ns(messages, earliest_ns) for messages in raw.values()]
    usual = [delay for delay in delays if delay is not None]
    offset_ns = int(np.median(usual)) if usual else None
    clean = {}
    for topic in list(raw):
        messages, label = raw.pop(topic), plan.label(topic)
        if bag_time:
            messages = messages.stamped(messages.bag_ns)
        else:
            messages = with_late_enough_stamps(label, messages, ledger, earliest_ns, offset_ns)
        messages = ordered(label, _possible(label, messages, plan, ledger), ledger)
        report_gaps(label, messages, ledger)
        clean[topic] = _require_two(messages, label, ledger)
    return clean


def is_ecef(position_m: np.ndarray) -> bool:
    """Whether positions (n, 3) [m] are in ECEF, by their distance from the Earth's centre."""
    with np.errstate(over="ignore"):
        radius_m = np.median(np.linalg.norm(position_m, axis=1)) if len(position_m) else 0.0
    return bool(EARTH_RADIUS_M[0] < radius_m < EARTH_RADIUS_M[1])


def _possible(label: str, messages: Messages, plan: TopicPlan, ledger: Ledger) -> Messages:
    if messages.msgtype == IMU and "imu" in plan.roles(messages.topic):
        limits = [("linear_acceleration", MOST_MPS2), ("angular_velocity", MOST_RADPS)]
        return without_frozen_gyro(label, without_impossible(label, messages, ledger, limits), ledger)
    if "latitude" in messages.values:
        return without_no_fix(label, messages, ledger)
    if "position" in messages.values:
        messages = _possible_pose(label, messages, ledger)
    if "linear" in messages.values:
        messages = without_impossible(label, messages, ledger, [("linear", MOST_MPS)])
    return messages


def _possible_pose(label: str, messages: Messages, ledger: Ledger) -> Messages:
    messages = without_impossible(label, messages, ledger, [("position", MOST_M)])
    if unit_quaternions(messages["orientation"]).any():  # else it never gives any
        messages = without_bad_quaternions(label, messages, ledger)
    if is_ecef(messages["position"]):
        radius_m = np.linalg.norm(messages["position"], axis=1)
        inside = (radius_m > EARTH_RADIUS_M[0]) & (radius_m < EARTH_RADIUS_M[1])
        ledger.add(label, "an ECEF position that is not on Earth", ~inside, messages.bag_ns, DROPPED)
        messages = messages.rows(inside)
    return messages


def _require_two(messages: Messages, label: str, ledger: Ledger) -> Messages:
    if len(messages) >= 2:
        return messages
    findings = " ".join(str(f) for f in ledger.findings if f.stream == label) or "It has no more messages."
    raise RecordingError(f"{label}: {len(messages)} usable messages are left; at least 2 are needed. {findings}")


def by_topic(plan: TopicPlan, clean: Mapping[str, Messages], role: Role) -> Messages | None:
    """Return the messages of a role, or None."""
    topic = plan.topics.get(role)
    return None if topic is None else clean[topic]
