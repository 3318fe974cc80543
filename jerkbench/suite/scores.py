"""The score of an entry from its rows: against the plain filter, tuned alike, on what neither has seen; its page."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.campaigns.protocol import HALVES
from jerkbench.campaigns.ratios import fastest_step_ns, nominal_of, of_families, of_unseen, ratio_verdict, worst_of
from jerkbench.campaigns.search import losses
from jerkbench.evaluation.statistics.ranks import over_scenarios
from jerkbench.report.tables.writers import passive
from jerkbench.suite.campaign import ENTRY, GIVEN, PLAIN, suite_levels
from jerkbench.suite.protocol import SuiteProtocol


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
