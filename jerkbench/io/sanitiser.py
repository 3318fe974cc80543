"""Faults of recorded messages: counted, reported, and dropped, repaired or refused.

Each check takes `Messages` and a `Ledger` and returns the messages that are left. With the mode "repair" what can be
mended is mended and the rest dropped, with "drop" everything wrong is dropped, with "refuse" it is an error.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import RecordingError, require_known
from jerkbench.io.bag import Messages
from jerkbench.io.limits import off_earth
from jerkbench.io.text import require_possible
from jerkbench.recording import Imu

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


# Impossible stamps: before there was such a recording, repeated, backwards, far from when they were
# recorded.

LATE_NS = 1_000_000_000
"""A message that is older than the one before it by less came late; by more, a clock was set back."""

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
    messages = ledger.drop(stream, messages, "the stamp of the row before", _repeated(messages.stamp_ns))
    messages = _near(stream, messages, ledger)
    backwards = messages.stamp_ns < _highest_before(messages.stamp_ns)
    if ledger.repairs:
        late = backwards & (messages.stamp_ns > _highest_before(messages.stamp_ns) - LATE_NS)
        ledger.add(stream, "a stamp older than an earlier row's", late, messages.bag_ns, "sorted in")
        messages = ledger.drop(stream, messages, "a stamp that was set back by seconds", backwards & ~late)
        messages = messages.rows(np.argsort(messages.stamp_ns, kind="stable"))
        return ledger.drop(stream, messages, "the stamp of another row", _repeated(messages.stamp_ns))
    stale = messages.stamp_ns <= _highest_before(messages.stamp_ns)
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


def _repeated(stamp_ns: IntArray) -> BoolArray:
    return np.concatenate([[False], np.diff(stamp_ns) == 0])[: len(stamp_ns)]


def _highest_before(stamp_ns: IntArray) -> IntArray:
    """(n,) highest of all stamps before each; of the first, one less than itself."""
    if not len(stamp_ns):
        return stamp_ns
    return np.concatenate([[stamp_ns[0] - 1], np.maximum.accumulate(stamp_ns)[:-1]])


# Unusable covariances: NaN, zero, or not positive definite.

_ROUNDING = 1e-6
"""A covariance that is asymmetric by less, relatively, was rounded on its way."""

SMALLEST = 1e-14
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
    return np.asarray(symmetric & bounded & (lowest > SMALLEST))


# Impossible values: not a number, beyond anything that moves on the ground, frozen.

MOST_MPS2 = 1000.0
MOST_RADPS = 100.0
MOST_MPS = 200.0
"""Beyond these a value is damage: 100 g, 5700 deg/s, 720 km/h."""

FROZEN_ROWS = 10
"""An angular rate that is the same so often in a row is not measured: noise alone would move the last digit."""

REPEATED = 0.05
"""A part of repeated samples that is larger is said: the logger asks more often than the sensor measures."""

UNIT_WITHIN = 0.02
"""The largest difference of a unit quaternion's length from 1."""


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


def possible_imu(where: str, imu: Imu) -> Imu:
    """Return the samples, of which none is beyond what an IMU measures.

    Raises:
        RecordingError: one is, by damage or by a wrong unit; names ``where`` and the row.
    """
    require_possible(f"{where}, specific force", imu.accel_mps2, MOST_MPS2)
    require_possible(f"{where}, angular rate", imu.gyro_radps, MOST_RADPS)
    return imu


def repeated_samples(imu: Imu) -> int:
    """Return how many samples repeat all six values of the one before."""
    same = (np.diff(imu.accel_mps2, axis=0) == 0).all(axis=1) & (np.diff(imu.gyro_radps, axis=0) == 0).all(axis=1)
    return int(same.sum())


def repeat_notes(imu: Imu) -> tuple[str, ...]:
    """Return a note where more than a twentieth of the samples repeat the one before, else none."""
    count, n = repeated_samples(imu), len(imu.t_s)
    few = f"{count} of {n} IMU samples ({count / n:.0%}) repeat all values of the one before"
    return (f"{few}: they measure nothing new.",) if count > REPEATED * n else ()


def frozen_rows(values: FloatArray) -> BoolArray:
    """Return (n,) which of (n, k) repeat the row before, within runs of at least `FROZEN_ROWS`.

    A run at the very start is frozen as a whole: nothing was measured yet.
    """
    same = np.concatenate([[False], (np.diff(values, axis=0) == 0).all(axis=1)])[: len(values)]
    run = np.cumsum(~same)
    long = np.bincount(run, minlength=1)[run] >= FROZEN_ROWS if len(values) else same
    return np.asarray(long & (same | (run == 1)))


def unit_quaternions(quaternions: FloatArray) -> BoolArray:
    """Return (n,) which of (n, 4) are of length 1."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.abs(np.linalg.norm(quaternions, axis=1) - 1.0) <= UNIT_WITHIN)


# Faulty fixes: impossible ones, leaps, and jumps where the kind of fix changes.

LEAP_M, LEAP_MPS = 50.0, 100.0
"""A fix that is further from the median of its neighbours than this, plus this a second, is damage."""

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


def steady_rows(t_s: FloatArray, position_m: FloatArray) -> tuple[BoolArray, tuple[str, ...]]:
    """Return (n,) which fixes do not leap, and a note that counts the others, or none.

    Raises:
        RecordingError: all of them leap.
    """
    leaps = leaping_rows(t_s, position_m)
    count, n = int(leaps.sum()), len(leaps)
    if count and count == n:
        raise RecordingError(
            f"All {n} fixes leap out of their neighbours by more than {LEAP_M:g} m; check the columns of the places,"
            " their frame and unit, and the times."
        )
    predicate = "leaps out of its" if count == 1 else "leap out of their"
    notes = (f"{count} of {n} fixes {predicate} neighbours by more than {LEAP_M:g} m: dropped.",) if count else ()
    return ~leaps, notes


def leaping_rows(t_s: FloatArray, position_m: FloatArray) -> BoolArray:
    """Return (n,) which are too far from the median of the five positions around them.

    An axis that is NaN was not measured: a position is judged by its other axes, each of them beside the nearest five
    that were. It leaps where, with the time that the five take::

        sum over the axes of (distance / (50 m + 100 m/s time))^2 > 1
    """
    over = np.zeros(len(position_m))
    for axis in position_m.T:
        known = np.flatnonzero(np.isfinite(axis))
        over[known] += _over_limit(t_s[known], axis[known]) ** 2
    return np.asarray(over > 1)


def _over_limit(t_s: FloatArray, axis_m: FloatArray) -> FloatArray:
    """Return (n,) each value's distance from the median of the five around it, over its limit; of fewer than 5, 0."""
    n = len(axis_m)
    if n < 5:
        return np.zeros(n)
    around = np.clip(np.arange(n), 2, n - 3)[:, None] + np.arange(-2, 3)  # at the ends the nearest five
    span_s = t_s[around[:, -1]] - t_s[around[:, 0]]
    return np.asarray(np.abs(axis_m - np.median(axis_m[around], axis=1)) / (LEAP_M + LEAP_MPS * span_s))


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
