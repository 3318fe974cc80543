"""The score of an entry from its rows: against the plain filter, tuned alike, on what neither has seen."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.audit.protocol import HALVES
from jerkbench.audit.searches import losses
from jerkbench.audit.verdicts import IMU_HZ, NOMINAL, verdict_of
from jerkbench.evaluation.statistics.scenarios import over_scenarios
from jerkbench.suite.campaign import ENTRY, GIVEN, PLAIN, suite_levels
from jerkbench.suite.protocol import SuiteProtocol


@dataclass(frozen=True)
class Score:
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


def score_of(rows: pd.DataFrame, protocol: SuiteProtocol) -> Score:
    """Return the score that the ``rows`` of an entry and of the plain filter show."""
    d = log_ratios(rows, protocol)
    by_family = of_families(d, protocol)
    mean = over_scenarios(by_family)
    by_scenario = d.mean(axis=1)
    worst, scenarios = int(np.argmax(by_scenario)), protocol.scenarios
    nominal = [scenario.family == NOMINAL for scenario in scenarios]
    own = rows[rows["method"] == ENTRY]
    counted = own[own["tuned_on"] != GIVEN] if (own["tuned_on"] != GIVEN).any() else own
    return Score(
        ratio=mean.ratio,
        low=mean.low,
        high=mean.high,
        verdict=str(verdict_of(mean.low, mean.high, protocol.margin)),
        given=float(np.exp(of_families(log_ratios(rows, protocol, as_given=True), protocol).mean())),
        worst=scenarios[worst].name,
        worst_ratio=float(np.exp(by_scenario[worst])),
        nominal=float(np.exp(by_scenario[nominal].mean())),
        lost=float((counted["status"] != "ok").mean()),
        anees=float(counted["anees"].median()),
        step_ns=float(own["seconds"].min() / (protocol.duration_s * IMU_HZ) * 1e9),
    )


def log_ratios(rows: pd.DataFrame, protocol: SuiteProtocol, *, as_given: bool = False) -> FloatArray:
    """Return (S, n) log(entry / tuned plain) of each scenario and seed; a lost run counts a hundred times the level.

    Args:
        rows: of both.
        protocol: of the suite.
        as_given: take the entry at the setting that it came with, also where it was tuned.
    """
    start = rows[(rows["method"] == PLAIN) & (rows["tuned_on"] == GIVEN)].assign(trial=0)
    rows = rows.assign(loss=losses(rows, suite_levels(start)))
    entry, plain = (_scored(rows[rows["method"] == method], protocol) for method in (ENTRY, PLAIN))
    return np.asarray((entry[GIVEN] if as_given else entry["tuned"]) - plain["tuned"])


def of_families(d: FloatArray, protocol: SuiteProtocol) -> FloatArray:
    """Return (F, n) means over the scenarios of each family: the fields of one fault are one unit."""
    names = np.array([scenario.family for scenario in protocol.scenarios])
    return np.array([d[names == family.name].mean(axis=0) for family in protocol.families])


def _scored(rows: pd.DataFrame, protocol: SuiteProtocol) -> dict[str, FloatArray]:
    """Return (S, n) losses as given, and tuned on what a scenario is not of; those of `none` are the mean of both."""
    cube = rows.pivot_table(index="scenario", columns=["tuned_on", "seed"], values="loss").sort_index()
    given = cube[GIVEN].to_numpy()
    if set(rows["tuned_on"]) == {GIVEN}:
        return {GIVEN: given, "tuned": given}
    halves = np.stack([cube[half].to_numpy() for half in HALVES])
    count = range(len(protocol.scenarios))
    wanted = [[half != protocol.scenarios[number].half for half in HALVES] for number in count]
    tuned = np.array([halves[wanted[number], number].mean(axis=0) for number in count])
    return {GIVEN: given, "tuned": tuned}
