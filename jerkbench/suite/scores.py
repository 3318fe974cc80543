"""The score of an entry from its rows: against the plain filter, tuned alike, on what neither has seen; its page.

Over scenarios of faults (v1), and over random drives (v2).
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.campaigns.protocol import HALVES
from jerkbench.campaigns.ratios import (
    fastest_step_ns,
    nominal_of,
    of_families,
    of_unseen,
    ratio_verdict,
    ratio_word,
    worst_of,
)
from jerkbench.campaigns.search import losses
from jerkbench.evaluation.statistics.intervals import few_intervals
from jerkbench.evaluation.statistics.judgement import LEVEL
from jerkbench.evaluation.statistics.ranks import over_scenarios
from jerkbench.report.tables.writers import passive
from jerkbench.suite.campaign import ENTRY, GIVEN, PLAIN, suite_levels
from jerkbench.suite.protocol import DriveSuite, SuiteProtocol


@dataclass(frozen=True)
class EntryScore:
    """What an entry is worth; ratios of the position RMSE to the tuned plain filter, below 1 is better.

    Attributes:
        ratio: geometric mean over the families of faults.
        low: lower end of its 95 % interval over families and seeds.
        high: upper end.
        verdict: better, equal, worse or undecided, by that interval.
        given: the ratio at the setting that it came with.
        worst: name of the scenario where it is worst.
        worst_ratio: its ratio there.
        nominal: ratio where nothing is wrong: the price.
        lost: share of its runs that were lost.
        anees: median of its runs; 6 is expected. NaN where it has no covariance.
        step_ns: time a step [ns]; this alone depends on the machine.
    """

    ratio: float
    low: float
    high: float
    verdict: str
    given: float
    worst: str
    worst_ratio: float
    nominal: float
    lost: float
    anees: float
    step_ns: float


def entry_score(rows: pd.DataFrame, protocol: SuiteProtocol) -> EntryScore:
    """Return the score that the ``rows`` of an entry and of the plain filter show."""
    d = entry_log_ratios(rows, protocol)
    by_family = of_families(d, protocol.scenarios)
    mean = over_scenarios(by_family)
    worst, worst_ratio = worst_of(d, protocol.scenarios)
    own = rows[rows["method"] == ENTRY]
    counted = own[own["tuned_on"] != GIVEN] if (own["tuned_on"] != GIVEN).any() else own
    return EntryScore(
        ratio=mean.ratio,
        low=mean.low,
        high=mean.high,
        verdict=str(ratio_verdict(mean.low, mean.high, protocol.margin)),
        given=float(np.exp(of_families(entry_log_ratios(rows, protocol, as_given=True), protocol.scenarios).mean())),
        worst=worst,
        worst_ratio=worst_ratio,
        nominal=nominal_of(d, protocol.scenarios),
        lost=float((counted["status"] != "ok").mean()),
        anees=float(counted["anees"].median()),
        step_ns=fastest_step_ns(own, protocol.duration_s),
    )


def entry_log_ratios(rows: pd.DataFrame, protocol: SuiteProtocol, *, as_given: bool = False) -> FloatArray:
    """Return (S, n) log(entry / tuned plain) of each scenario and seed; a lost run counts a hundred times the level.

    Args:
        rows: of both.
        protocol: of the suite.
        as_given: take the entry at the setting that it came with, also where it was tuned.
    """
    start = rows[(rows["method"] == PLAIN) & (rows["tuned_on"] == GIVEN)].assign(trial=0)
    rows = rows.assign(loss=losses(rows, suite_levels(start, protocol)))
    entry, plain = (_scored(rows[rows["method"] == method], protocol) for method in (ENTRY, PLAIN))
    return np.asarray((entry[GIVEN] if as_given else entry["tuned"]) - plain["tuned"])


def _scored(rows: pd.DataFrame, protocol: SuiteProtocol) -> dict[str, FloatArray]:
    """Return (S, n) losses as given, and tuned on what a scenario is not of; those of `none` are the mean of both."""
    cube = rows.pivot_table(index="scenario", columns=["tuned_on", "seed"], values="loss").sort_index()
    given = cube[GIVEN].to_numpy()
    if set(rows["tuned_on"]) == {GIVEN}:
        return {GIVEN: given, "tuned": given}
    halves = [cube[half].to_numpy() for half in HALVES]
    return {GIVEN: given, "tuned": of_unseen(halves, protocol.scenarios)}


EXPLANATION = """\
Ratios of the position RMSE to the plain filter ({plain}), tuned with the same budget; below 1 is better. What is tuned
on one half of the faults is scored on the other, on seeds that no search has seen. A lost run counts a hundred times
the plain filter's level.
"""


def entry_page(name: str, score: EntryScore, rows: pd.DataFrame, protocol: SuiteProtocol) -> str:
    """Return the page as Markdown."""
    tuned_on = set(rows.loc[rows["method"] == ENTRY, "tuned_on"])
    plain = EXPLANATION.format(plain=" + ".join(protocol.plain.values()))
    return "\n".join(
        [passive(entry_line(name, score, protocol, tuned=tuned_on != {GIVEN})), "", plain, *_table(rows, protocol)]
    )


def entry_line(name: str, score: EntryScore, protocol: SuiteProtocol, *, tuned: bool) -> str:
    """Return what came out, in one line."""
    how = f"tuned, {protocol.trials} settings" if tuned else "not tuned"
    return (
        f"{name} on {protocol.name}: {score.ratio:.3f} of the tuned plain filter [{score.low:.3f}, {score.high:.3f}],"
        f" {score.verdict}; worst {score.worst} {score.worst_ratio:.2f}; nothing wrong {score.nominal:.3f};"
        f" lost {100 * score.lost:.1f} %; {how}."
    )


def _table(rows: pd.DataFrame, protocol: SuiteProtocol) -> list[str]:
    ratios = np.exp(entry_log_ratios(rows, protocol).mean(axis=1))
    lost = rows[rows["method"] == ENTRY].groupby("scenario")["status"].agg(lambda status: (status != "ok").sum())
    lines = [
        f"| {scenario.name} | {ratio:.3f} | {lost[number]} |"
        for number, (scenario, ratio) in enumerate(zip(protocol.scenarios, ratios, strict=True))
    ]
    return ["| scenario | ratio | lost runs |", "|---|---|---|", *lines, ""]


# The score over random drives.

NOTICEABLE = 1.03
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
        worse=float((d > np.log(NOTICEABLE)).mean()),
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


ABOUT_DRIVES = """\
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
    about = ABOUT_DRIVES.format(plain=plain, tuned=protocol.tune_seeds, n=score.n, entries=protocol.entries)
    lines = [f"| {kind} | {of.sum()} | {_ratio(d, of):.3f} |" for kind, of in members(protocol).items()]
    return "\n".join([passive(line), "", about, "| drives with | n | ratio |", "|---|---|---|", *lines, ""])
