"""Impossible stamps: before there was such a recording, repeated, backwards, far from when they were recorded."""

import numpy as np

from jerkbench.arrays import BoolArray, IntArray
from jerkbench.readers.ros.messages import Messages
from jerkbench.sanitiser.ledger import DROPPED, KEPT, Ledger

LATE_NS = 1_000_000_000
"""A message that is older than the one before it by less came late; by more, a clock was set back."""

FAR_NS = 10_000_000_000
"""A stamp that differs from the time of recording by so much more than usual is damaged."""

FEW = 0.1
"""If more than this part of the stamps is far off, it is the recording computer's clock that does not fit."""

GAP = 2.5
"""A step of more than so many usual intervals is a gap."""


def with_late_enough_stamps(
    stream: str, messages: Messages, ledger: Ledger, earliest_ns: int, offset_ns: int | None
) -> Messages:
    """Repair or drop stamps before ``earliest_ns``.

    A repaired stamp is the time of recording less the usual delay: that of this stream's good stamps, else
    ``offset_ns`` (another stream's), else none.
    """
    early = messages.stamp_ns < earliest_ns
    year = np.datetime64(earliest_ns, "ns").astype("datetime64[D]")
    if ledger.repairs:
        own = usual_delay_ns(messages, earliest_ns)
        delay = next((d for d in (own, offset_ns) if d is not None), 0)
        done = f"replaced by the time of recording less {delay * 1e-9:.3f} s"
        ledger.add(stream, f"a stamp before {year}", early, messages.bag_ns, done)
        return messages.stamped(np.where(early, messages.bag_ns - delay, messages.stamp_ns))
    ledger.add(stream, f"a stamp before {year}", early, messages.bag_ns, DROPPED)
    return messages.rows(~early)


def usual_delay_ns(messages: Messages, earliest_ns: int) -> int | None:
    """Median of the time of recording less the stamp, over the stamps that can be; None where there is none."""
    good = messages.stamp_ns >= earliest_ns
    return int(np.median((messages.bag_ns - messages.stamp_ns)[good])) if good.any() else None


def ordered(stream: str, messages: Messages, ledger: Ledger) -> Messages:
    """Return messages whose stamps increase: without repeated, far and backward ones; late ones sorted in."""
    messages = _without(stream, messages, ledger, "the stamp of the row before", _repeated(messages.stamp_ns))
    messages = _near(stream, messages, ledger)
    backwards = messages.stamp_ns < _highest_before(messages.stamp_ns)
    if ledger.repairs:
        late = backwards & (messages.stamp_ns > _highest_before(messages.stamp_ns) - LATE_NS)
        ledger.add(stream, "a stamp older than an earlier row's", late, messages.bag_ns, "sorted in")
        messages = _without(stream, messages, ledger, "a stamp that was set back by seconds", backwards & ~late)
        messages = messages.rows(np.argsort(messages.stamp_ns, kind="stable"))
        return _without(stream, messages, ledger, "the stamp of another row", _repeated(messages.stamp_ns))
    return _without(
        stream,
        messages,
        ledger,
        "a stamp not newer than an earlier row's",
        messages.stamp_ns <= _highest_before(messages.stamp_ns),
    )


def report_gaps(stream: str, messages: Messages, ledger: Ledger) -> None:
    """Count the steps of ordered stamps that are longer than usual."""
    if len(messages) > 2:
        steps = np.diff(messages.stamp_ns)
        wide = np.concatenate([[False], steps > GAP * np.median(steps)])
        longest = steps.max() * 1e-9
        ledger.add(stream, f"a gap before them, up to {longest:.2f} s", wide, messages.bag_ns, KEPT)


def _without(stream: str, messages: Messages, ledger: Ledger, fault: str, rows: BoolArray) -> Messages:
    ledger.add(stream, fault, rows, messages.bag_ns, DROPPED)
    return messages.rows(~rows) if rows.any() else messages


def _near(stream: str, messages: Messages, ledger: Ledger) -> Messages:
    if not len(messages):
        return messages
    delay = messages.bag_ns - messages.stamp_ns
    far = np.abs(delay - np.median(delay).astype(np.int64)) > FAR_NS
    if far.mean() > FEW:
        ledger.add(
            stream, "a stamp far from the time of recording, whose clock ran otherwise", far, messages.bag_ns, KEPT
        )
        return messages
    return _without(stream, messages, ledger, "a stamp far from the time of recording", far)


def _repeated(stamp_ns: IntArray) -> BoolArray:
    return np.concatenate([[False], np.diff(stamp_ns) == 0])[: len(stamp_ns)]


def _highest_before(stamp_ns: IntArray) -> IntArray:
    """(n,) highest of all stamps before each; of the first, one less than itself."""
    if not len(stamp_ns):
        return stamp_ns
    return np.concatenate([[stamp_ns[0] - 1], np.maximum.accumulate(stamp_ns)[:-1]])
