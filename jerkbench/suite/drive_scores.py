"""The score of an entry over random drives: against the plain filter, tuned alike, on unseen drives; its page."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.campaigns.ratios import fastest_step_ns, ratio_word
from jerkbench.campaigns.search import losses
from jerkbench.evaluation.statistics.intervals import few_intervals
from jerkbench.evaluation.statistics.judgement import LEVEL
from jerkbench.report.tables.writers import passive
from jerkbench.suite.campaign import ENTRY, GIVEN, PLAIN, suite_levels
from jerkbench.suite.protocol import DriveSuite

WORSE = 1.03
"""A ratio above this counts as worse on a drive."""


@dataclass(frozen=True)
class DriveScore:
    """What an entry is worth on random drives; ratios of the position RMSE to the tuned plain filter.

    Attributes:
        n: drives.
        ratio: geometric mean over them.
        low: lower end of its interval, which holds for as many entries at once as the suite says.
        high: upper end.
        verdict: better, worse, equal within the margin, or undecided, by that interval.
        given: the ratio at the setting that it came with.
        nominal: geometric mean over the drives without a fault: the price.
        worse: share of drives on which it is worse by more than 3 %.
        worst_kind: kind of fault among whose drives the ratio is largest.
        worst_ratio: that ratio.
        lost: share of its runs that were lost.
        anees: median of its runs; 6 is expected. NaN where it has no covariance.
        step_ns: time a step [ns]; this alone depends on the machine.
    """

    n: int
    ratio: float
    low: float
    high: float
    verdict: str
    given: float
    nominal: float
    worse: float
    worst_kind: str
    worst_ratio: float
    lost: float
    anees: float
    step_ns: float


def drive_score(rows: pd.DataFrame, protocol: DriveSuite) -> DriveScore:
    """Return the score that the ``rows`` of an entry and of the plain filter show."""
    d, given = drive_log_ratios(rows, protocol), drive_log_ratios(rows, protocol, as_given=True)
    low, high = (float(np.exp(end[0])) for end in few_intervals(d[None], 1 - LEVEL / protocol.entries))
    own = rows[rows["method"] == ENTRY]
    counted = own[own["tuned_on"] != GIVEN] if (own["tuned_on"] != GIVEN).any() else own
    known = members(protocol)
    kinds = {name: _ratio(d, member) for name, member in known.items() if " " not in name}
    worst = max(kinds, key=lambda name: kinds[name])
    return DriveScore(
        n=len(d),
        ratio=float(np.exp(d.mean())),
        low=low,
        high=high,
        verdict=ratio_word(low, high, protocol.margin),
        given=float(np.exp(given.mean())),
        nominal=_ratio(d, known["0 faults"]) if "0 faults" in known else float("nan"),
        worse=float((d > np.log(WORSE)).mean()),
        worst_kind=worst,
        worst_ratio=kinds[worst],
        lost=float((counted["status"] != "ok").mean()),
        anees=float(counted["anees"].median()),
        step_ns=fastest_step_ns(own, protocol.duration_s),
    )


def _ratio(d: FloatArray, member: BoolArray) -> float:
    return float(np.exp(d[member].mean()))


def members(protocol: DriveSuite) -> dict[str, BoolArray]:
    """Return which drives (n,) have "0 faults", "1 fault" ..., and which have each kind of fault; those that occur."""
    dataset = plugins.create("dataset", protocol.dataset)
    drawn = [list(dataset.drawn(seed)[2]) for seed in protocol.seeds_to_test_on]
    named = [[f"{len(kinds)} fault{'s' * (len(kinds) != 1)}", *kinds] for kinds in drawn]
    names = sorted({name for own in named for name in own})
    return {name: np.array([name in own for own in named]) for name in names}


def drive_log_ratios(rows: pd.DataFrame, protocol: DriveSuite, *, as_given: bool = False) -> FloatArray:
    """Return (n,) log(entry / tuned plain) of each drive; a lost run counts a hundred times the drive's level.

    Args:
        rows: of both.
        protocol: of the suite.
        as_given: take the entry at the setting that it came with, also where it was tuned.
    """
    start = rows[(rows["method"] == PLAIN) & (rows["tuned_on"] == GIVEN)].assign(trial=0)
    levels = suite_levels(start, protocol)
    known = rows.assign(loss=losses(rows, levels, protocol.numbers[0], protocol.level_of))
    of = {key: own.sort_values("seed")["loss"].to_numpy() for key, own in known.groupby(["method", "tuned_on"])}
    (search,) = protocol.searches
    entry, plain = (of.get((method, search), of[method, GIVEN]) for method in (ENTRY, PLAIN))
    return np.asarray((of[ENTRY, GIVEN] if as_given else entry) - plain, dtype=np.float64)


EXPLANATION = """\
Ratios of the position RMSE to the plain filter ({plain}), tuned with the same budget; below 1 is better. Each drive has
its own field, speed and faults. What is tuned on {tuned} drives is scored on {n} others. A lost run counts a hundred
times the error of the plain filter at its defaults on that drive. The interval is over drives, at 5 % for {entries}
entries at once. The luck of the one tuning is not in it.
"""


def drive_page(name: str, rows: pd.DataFrame, protocol: DriveSuite) -> str:
    """Return the page as Markdown: a line, and the ratio by number and by kind of faults."""
    score, d = drive_score(rows, protocol), drive_log_ratios(rows, protocol)
    tuned = set(rows.loc[rows["method"] == ENTRY, "tuned_on"]) != {GIVEN}
    how = f"tuned, {protocol.trials} settings" if tuned else "not tuned"
    line = (
        f"{name} on {protocol.name} (n = {score.n} drives): {score.ratio:.3f} of the tuned plain filter"
        f" [{score.low:.3f}, {score.high:.3f}], {score.verdict}; without a fault {score.nominal:.3f}; worst kind"
        f" {score.worst_kind} {score.worst_ratio:.2f}; lost {100 * score.lost:.1f} %; {how}."
    )
    plain = " + ".join(protocol.plain.values())
    about = EXPLANATION.format(plain=plain, tuned=protocol.tune_seeds, n=score.n, entries=protocol.entries)
    lines = [f"| {kind} | {of.sum()} | {_ratio(d, of):.3f} |" for kind, of in members(protocol).items()]
    return "\n".join([passive(line), "", about, "| drives with | n | ratio |", "|---|---|---|", *lines, ""])
