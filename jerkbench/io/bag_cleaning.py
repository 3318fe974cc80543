"""The messages of a bag, cleaned: what is wrong is counted, and repaired, dropped or refused.

With the mode "repair" what can be repaired is repaired and the rest dropped, with "drop" everything wrong is dropped,
with "refuse" it is an error.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import RecordingError, require_known
from jerkbench.io.bag import IMU, Messages
from jerkbench.io.bag_topics import TopicPlan, is_ecef
from jerkbench.io.sanitiser import (
    LATE_NS,
    MAX_LOCAL_M,
    MAX_MPS,
    MAX_MPS2,
    MAX_RADPS,
    UNDATED,
    frozen_rows,
    highest_before,
    off_earth,
    repeats_before,
    undated,
    unit_quaternions,
)

MODES = ("drop", "refuse", "repair")
DROPPED = "dropped"
KEPT = "kept"


@dataclass(frozen=True)
class Finding:
    """One kind of trouble in one stream.

    Attributes:
        stream: its name.
        fault: what is wrong with the rows, after "rows with".
        count: how many rows.
        of: of how many.
        done: what became of them.
        first_s: time of the first of them since the first message of the bag, by the recording computer's clock.
    """

    stream: str
    fault: str
    count: int
    of: int
    done: str
    first_s: float

    @property
    def trouble(self) -> str:
        """What was wrong."""
        rows = f"{self.count} of {self.of} rows with {self.fault}"
        return f"{self.stream}: {rows}, the first {self.first_s:.2f} s into the bag"

    def __str__(self) -> str:
        """Return the finding as a sentence."""
        return f"{self.trouble}: {self.done}."


class Ledger:
    """Collects findings; in the mode "refuse" the first one is an error."""

    def __init__(self, mode: str, start_ns: int) -> None:
        """Begin an empty report.

        Args:
            mode: one of `MODES`.
            start_ns: when the bag begins, by the recording computer's clock.

        Raises:
            PluginError: no such mode.
        """
        require_known("sanitise mode", mode, MODES)
        self.mode, self.start_ns = mode, start_ns
        self.findings: list[Finding] = []

    @property
    def repairs(self) -> bool:
        """Whether what can be mended is to be mended."""
        return self.mode == "repair"

    def add(self, stream: str, fault: str, rows: BoolArray, bag_ns: IntArray, done: str) -> None:
        """Note that ``rows`` (n,), recorded at ``bag_ns`` (n,), have the ``fault``, if any has.

        Raises:
            RecordingError: any has, and the mode is "refuse".
        """
        count = int(np.count_nonzero(rows))
        if not count:
            return
        first_s = (int(bag_ns[int(np.argmax(rows))]) - self.start_ns) * 1e-9
        finding = Finding(stream, fault, count, len(rows), done, first_s)
        if self.mode == "refuse":
            raise RecordingError(f"{finding.trouble}; choose sanitise=repair or sanitise=drop to go on without them.")
        self.findings.append(finding)

    def drop(self, stream: str, messages: Messages, fault: str, rows: BoolArray) -> Messages:
        """Note that ``rows`` (n,) have the ``fault``, and return the messages without them."""
        self.add(stream, fault, rows, messages.bag_ns, DROPPED)
        return messages.rows(~rows) if rows.any() else messages


FAR_NS = 10_000_000_000
"""A stamp that differs from the time of recording by so much more than usual is damaged."""

_FEW = 0.1
"""If more than this part of the stamps is far off, it is the recording computer's clock that does not fit."""

_GAP = 2.5
"""A step of more than so many usual intervals is a gap."""


def with_late_enough_stamps(
    stream: str, messages: Messages, ledger: Ledger, earliest_ns: int, offset_ns: int | None
) -> Messages:
    """Repair or drop stamps before ``earliest_ns``.

    A repaired stamp is the time of recording less the usual delay: that of this stream's good stamps, else
    ``offset_ns`` (another stream's), else none.
    """
    early = messages.stamp_ns < earliest_ns
    fault = f"a stamp before {np.datetime64(earliest_ns, 'ns').astype('datetime64[D]')}"
    if not ledger.repairs:
        return ledger.drop(stream, messages, fault, early)
    own = usual_delay_ns(messages, earliest_ns)
    delay = (offset_ns or 0) if own is None else own
    done = f"replaced by the time of recording less {delay * 1e-9:.3f} s"
    ledger.add(stream, fault, early, messages.bag_ns, done)
    return messages.stamped(np.where(early, messages.bag_ns - delay, messages.stamp_ns))


def usual_delay_ns(messages: Messages, earliest_ns: int) -> int | None:
    """Median of the time of recording less the stamp, over the stamps that can be; None where there is none."""
    good = messages.stamp_ns >= earliest_ns
    return int(np.median((messages.bag_ns - messages.stamp_ns)[good])) if good.any() else None


def ordered(stream: str, messages: Messages, ledger: Ledger) -> Messages:
    """Return messages whose stamps increase: without repeated, far and backward ones; late ones sorted in."""
    messages = ledger.drop(stream, messages, "the stamp of the row before", repeats_before(messages.stamp_ns))
    messages = _near(stream, messages, ledger)
    backwards = messages.stamp_ns < highest_before(messages.stamp_ns)
    if ledger.repairs:
        late = backwards & (messages.stamp_ns > highest_before(messages.stamp_ns) - LATE_NS)
        ledger.add(stream, "a stamp older than an earlier row's", late, messages.bag_ns, "sorted in")
        messages = ledger.drop(stream, messages, "a stamp that was set back by seconds", backwards & ~late)
        messages = messages.rows(np.argsort(messages.stamp_ns, kind="stable"))
        return ledger.drop(stream, messages, "the stamp of another row", repeats_before(messages.stamp_ns))
    stale = messages.stamp_ns <= highest_before(messages.stamp_ns)
    return ledger.drop(stream, messages, "a stamp not newer than an earlier row's", stale)


def report_gaps(stream: str, messages: Messages, ledger: Ledger) -> None:
    """Count the steps of ordered stamps that are longer than usual."""
    if len(messages) > 2:
        steps = np.diff(messages.stamp_ns)
        wide = np.concatenate([[False], steps > _GAP * np.median(steps)])
        longest = steps.max() * 1e-9
        ledger.add(stream, f"a gap before them, up to {longest:.2f} s", wide, messages.bag_ns, KEPT)


def _near(stream: str, messages: Messages, ledger: Ledger) -> Messages:
    if not len(messages):
        return messages
    delay = messages.bag_ns - messages.stamp_ns
    far = np.abs(delay - np.median(delay).astype(np.int64)) > FAR_NS
    fault = "a stamp far from the time of recording"
    if far.mean() > _FEW:
        ledger.add(stream, f"{fault}, whose clock ran otherwise", far, messages.bag_ns, KEPT)
        return messages
    return ledger.drop(stream, messages, fault, far)


_ROUNDING = 1e-6
"""A covariance that is asymmetric by less, relatively, was rounded on its way."""

MIN_FIX_VARIANCE = 1e-14
"""A smaller variance (0.1 micrometres) is a placeholder."""


def sound_covariances(
    stream: str, messages: Messages, ledger: Ledger, field: str, sigma: Sequence[float], parameter: str
) -> Messages:
    """Symmetrise the covariances (n, 9) of ``field``; replace or drop those that are none.

    In the mode "repair" such a row gets ``sigma`` squared on its diagonal, or, where that is empty, the covariance of
    the stream's median trace; with "drop" it is dropped, unless ``sigma`` is given and no row has a covariance.

    Raises:
        RecordingError: no row has a covariance, and ``sigma`` is empty; names ``parameter``, which gives it.
    """
    matrices = messages[field].reshape(-1, 3, 3)
    whole = 0.5 * (matrices + matrices.transpose(0, 2, 1))
    good = _is_covariance(matrices, whole)
    if not good.any() and len(messages) and not sigma:
        raise RecordingError(
            f"{stream}: none of the {len(messages)} rows has a covariance (zero, NaN or not positive definite);"
            f" give {parameter}: three standard deviations."
        )
    messages = messages.with_values(**{field: whole.reshape(-1, 9)})
    fault = f"a {field.replace('_', ' ')} that is zero, NaN or not positive definite"
    if good.all() or (good.any() and not ledger.repairs):
        return ledger.drop(stream, messages, fault, ~good)
    replacement, done = np.diag(np.square(sigma)), "replaced by sigmas of " + ", ".join(f"{s:g}" for s in sigma)
    if not sigma:
        traces = np.trace(whole[good], axis1=1, axis2=2)
        replacement = whole[good][np.argsort(traces)[len(traces) // 2]]
        done = "replaced by the stream's median covariance"
    ledger.add(stream, fault, ~good, messages.bag_ns, done)
    return messages.with_values(**{field: np.where(good[:, None], messages[field], replacement.ravel())})


def _is_covariance(matrices: FloatArray, whole: FloatArray) -> BoolArray:
    finite: BoolArray = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    usable = np.where(finite[:, None, None], whole, 0.0)
    size = np.abs(usable).max(axis=(1, 2), initial=0)
    with np.errstate(over="ignore", invalid="ignore"):
        skew = np.abs(matrices - whole).max(axis=(1, 2), initial=0)
        symmetric = finite & (skew <= _ROUNDING * size)
    bounded = size < 1e12  # a receiver without a fix writes 1e20 or so
    lowest = np.linalg.eigvalsh(np.where((symmetric & bounded)[:, None, None], usable, 0.0))[:, 0]
    return np.asarray(symmetric & bounded & (lowest > MIN_FIX_VARIANCE))


def without_impossible(
    stream: str, messages: Messages, ledger: Ledger, limits: Sequence[tuple[str, float]]
) -> Messages:
    """Drop rows in which a field is no finite number, or its length is above its limit."""
    for field, most in limits:
        finite: BoolArray = np.asarray(np.isfinite(messages[field]).all(axis=1))
        words = {"linear": "linear velocity"}.get(field, field.replace("_", " "))
        messages = ledger.drop(stream, messages, f"a NaN or infinite {words}", ~finite)
        with np.errstate(over="ignore"):
            over = np.linalg.norm(messages[field], axis=1) > most
        messages = ledger.drop(stream, messages, f"an impossible {words}, above {most:g}", over)
    return messages


MANOEUVRE_MPS2 = 10.0
ANOTHER_LEVEL = 4.0
"""A ratio of traces from which another covariance means another kind of fix."""


def without_no_fix(stream: str, messages: Messages, ledger: Ledger) -> Messages:
    """Drop what has the status -1, and coordinates that are not on Earth (or exactly 0, 0: never filled in)."""
    messages = ledger.drop(stream, messages, "status -1 (no fix)", messages["status"][:, 0] < 0)
    places = np.column_stack([messages[name] for name in ("latitude", "longitude", "altitude")])
    unknown = ~np.isfinite(places).all(axis=1) | (places[:, :2] == 0).all(axis=1)
    bad = unknown | off_earth(places, "geodetic")
    return ledger.drop(stream, messages, "coordinates that are NaN, zero or not on Earth", bad)


def report_jumps(stream: str, messages: Messages, ledger: Ledger, field: str, status: FloatArray | None = None) -> None:
    """Count jumps where status or covariance level changes: a receiver leaves or finds its fixed solution.

    The position [m] of ``field`` is compared with the one extrapolated from the two before; a jump is more than 3 sigma
    of both and what 10 m/s2 would explain.
    """
    p, t_s = messages[field], messages.stamp_ns * 1e-9
    if len(p) < 3:
        return
    dt = np.diff(t_s)
    trace = np.trace(messages["position_covariance"].reshape(-1, 3, 3), axis1=1, axis2=2)
    ratio = trace[2:] / trace[1:-1]
    changed = (ratio > ANOTHER_LEVEL) | (ratio < 1 / ANOTHER_LEVEL)
    if status is not None:
        changed |= np.diff(status)[1:] != 0
    expected = p[1:-1] + (p[1:-1] - p[:-2]) * (dt[1:] / dt[:-1])[:, None]
    explained = 3 * np.sqrt(trace[2:] + trace[1:-1]) + 0.5 * MANOEUVRE_MPS2 * (dt[1:] ** 2 + dt[1:] * dt[:-1])
    jumped = changed & (np.linalg.norm(p[2:] - expected, axis=1) > explained)
    rows = np.concatenate([[False, False], jumped])
    ledger.add(stream, "a jump at a change of the kind of fix", rows, messages.bag_ns, KEPT)


def clean_topics(
    raw: dict[str, Messages], plan: TopicPlan, ledger: Ledger, earliest_ns: int, *, bag_time: bool
) -> dict[str, Messages]:
    """Return the messages of each topic with good stamps and possible values; takes them out of ``raw``.

    Raises:
        RecordingError: nothing of a topic is left, or the mode is "refuse" and something is wrong.
    """
    delays = [delay for m in raw.values() if (delay := usual_delay_ns(m, earliest_ns)) is not None]
    offset_ns = int(np.median(delays)) if delays else None
    clean = {}
    for topic in list(raw):
        messages, label = raw.pop(topic), plan.label(topic)
        if bag_time:
            messages = messages.stamped(messages.bag_ns)
        else:
            messages = with_late_enough_stamps(label, messages, ledger, earliest_ns, offset_ns)
        messages = ledger.drop(label, messages, UNDATED, undated(messages.stamp_ns))
        messages = ordered(label, _possible(label, messages, plan, ledger), ledger)
        report_gaps(label, messages, ledger)
        if len(messages) < 2:
            findings = " ".join(str(f) for f in ledger.findings if f.stream == label) or "It has no more messages."
            raise RecordingError(
                f"{label}: {len(messages)} usable messages are left; at least 2 are needed. {findings}"
            )
        clean[topic] = messages
    return clean


def _possible(label: str, messages: Messages, plan: TopicPlan, ledger: Ledger) -> Messages:
    if messages.msgtype == IMU and "imu" in plan.roles(messages.topic):
        limits = [("linear_acceleration", MAX_MPS2), ("angular_velocity", MAX_RADPS)]
        messages = without_impossible(label, messages, ledger, limits)
        return ledger.drop(label, messages, "a frozen angular rate", frozen_rows(messages["angular_velocity"]))
    if "latitude" in messages.values:
        return without_no_fix(label, messages, ledger)
    if "position" in messages.values:
        messages = without_impossible(label, messages, ledger, [("position", MAX_LOCAL_M)])
        unit = unit_quaternions(messages["orientation"])
        if unit.any():  # otherwise the topic never has an orientation
            messages = ledger.drop(label, messages, "an orientation that is no unit quaternion", ~unit)
        if is_ecef(messages["position"]):
            off = off_earth(messages["position"], "ecef")
            messages = ledger.drop(label, messages, "an ECEF position that is not on Earth", off)
    if "linear" in messages.values:
        messages = without_impossible(label, messages, ledger, [("linear", MAX_MPS)])
    return messages
