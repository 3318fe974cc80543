"""The score of an attitude filter from its rows: each domain apart, against the plain filter, tuned alike; its page."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.campaigns.ratios import ratio_verdict
from jerkbench.campaigns.search import losses
from jerkbench.evaluation.statistics.intervals import few_intervals
from jerkbench.report.tables.writers import passive
from jerkbench.suite.campaign import ENTRY, GIVEN, PLAIN, suite_levels
from jerkbench.suite.protocol import HAND, AttitudeSuite

LOST_DEG = 180.0
"""What a lost run counts among the errors: the largest that there is."""


@dataclass(frozen=True)
class DomainScore:
    """What an entry is worth in one domain; ratios of the inclination RMSE to the tuned plain filter.

    Attributes:
        n: trials, or drives (a drive has every fault): what is counted.
        ratio: geometric mean over them.
        low: lower end of its 95 % interval.
        high: upper end.
        verdict: better, equal, worse or undecided, by that interval.
        given: the ratio at the setting that it came with.
        median_deg: median error of its runs [deg].
        worst_deg: that of its worst run [deg].
        worst: the trial or fault of that run.
        lost: share of its runs that were lost; each counts 180 deg.
    """

    n: int
    ratio: float
    low: float
    high: float
    verdict: str
    given: float
    median_deg: float
    worst_deg: float
    worst: str
    lost: float


AttitudeScore = Mapping[str, DomainScore]
"""The score in each domain."""


def attitude_score(rows: pd.DataFrame, protocol: AttitudeSuite) -> AttitudeScore:
    """Return the score that the ``rows`` of an entry and of the plain filter show."""
    return {domain: _of_domain(domain, rows, protocol) for domain in protocol.domains}


def _of_domain(domain: str, rows: pd.DataFrame, protocol: AttitudeSuite) -> DomainScore:
    d = attitude_log_ratios(rows, protocol, domain)
    (low,), (high,) = (np.exp(end) for end in few_intervals(d[None], 0.95))
    own = _scored(_known(rows, protocol, domain), ENTRY)
    deg = np.exp(own.groupby(["scenario", "seed"])["log_deg"].mean())
    return DomainScore(
        n=len(d),
        ratio=float(np.exp(d.mean())),
        low=float(low),
        high=float(high),
        verdict=str(ratio_verdict(low, high, protocol.margin)),
        given=float(np.exp(attitude_log_ratios(rows, protocol, domain, as_given=True).mean())),
        median_deg=float(deg.median()),
        worst_deg=float(deg.max()),
        worst=protocol.scenarios[deg.idxmax()[0]].fault,
        lost=float((own["status"] != "ok").mean()),
    )


def attitude_log_ratios(
    rows: pd.DataFrame, protocol: AttitudeSuite, domain: str, *, as_given: bool = False
) -> FloatArray:
    """Return (n,) log(entry / tuned plain) of each trial of a hand, or of each drive as the mean over its faults.

    Args:
        rows: of both.
        protocol: of the suite.
        domain: the rows of which one.
        as_given: take the entry at the setting that it came with, also where it was tuned.
    """
    known = _known(rows, protocol, domain)
    entry, plain = (
        own.groupby(["unit", "scenario"])["loss"].mean().groupby("unit").mean()
        for own in (_scored(known, ENTRY, as_given=as_given), _scored(known, PLAIN))
    )
    return np.asarray((entry - plain).to_numpy(), dtype=np.float64)


def _known(rows: pd.DataFrame, protocol: AttitudeSuite, domain: str) -> pd.DataFrame:
    """The rows of a domain with their loss, the logarithm of their error [deg], and what they are a value of."""
    scenarios, error = protocol.scenarios, protocol.numbers[0]
    here = rows[[scenarios[k].noise == domain for k in rows["scenario"]]]
    start = here[(here["method"] == PLAIN) & (here["tuned_on"] == GIVEN)].assign(trial=0)
    return here.assign(
        loss=losses(here, suite_levels(start, protocol), error),
        log_deg=np.log(here[error].where(here["status"] == "ok", LOST_DEG)),
        unit=here["scenario"] if domain == HAND else here["seed"],
    )


def _scored(known: pd.DataFrame, method: str, *, as_given: bool = False) -> pd.DataFrame:
    """The rows that count of a method: those of tuned settings, if there are any."""
    own = known[known["method"] == method]
    tuned = own[own["tuned_on"] != GIVEN]
    return own[own["tuned_on"] == GIVEN] if as_given or tuned.empty else tuned


EXPLANATION = """\
Errors of the inclination, the angle between the estimated and the true vertical; no heading is needed. Ratios are to
the plain filter ({plain}), tuned with the same budget; below 1 is better. What is tuned on one half of a domain is
scored on its other half. A lost run counts 180 deg, and a hundred times the plain filter's level.
"""


def attitude_page(name: str, rows: pd.DataFrame, protocol: AttitudeSuite) -> str:
    """Return the page as Markdown."""
    tuned = (rows.loc[rows["method"] == ENTRY, "tuned_on"] != GIVEN).any()
    how = f"tuned, {protocol.trials} settings a half" if tuned else "not tuned"
    lines = [
        f"{name} on {protocol.name}, {domain} (n = {own.n}): {own.ratio:.3f} of the tuned plain filter"
        f" [{own.low:.3f}, {own.high:.3f}], {own.verdict}; median {own.median_deg:.2f} deg, worst"
        f" {own.worst_deg:.2f} deg ({own.worst}); lost {100 * own.lost:.1f} %; {how}."
        for domain, own in attitude_score(rows, protocol).items()
    ]
    plain = EXPLANATION.format(plain=protocol.plain_entrant.name)
    return "\n\n".join([*map(passive, lines), plain + "\n" + _table(rows, protocol)])


def _table(rows: pd.DataFrame, protocol: AttitudeSuite) -> str:
    lines = ["| domain | trial or fault | error [deg] | plain [deg] | lost runs |", "|---|---|---|---|---|"]
    for domain in protocol.domains:
        known = _known(rows, protocol, domain)
        entry, plain = (_scored(known, method).groupby("scenario") for method in (ENTRY, PLAIN))
        for number, own in entry:
            error, level = (np.exp(of["log_deg"].mean()) for of in (own, plain.get_group(number)))
            lost = int((own["status"] != "ok").sum())
            fault = protocol.scenarios[int(str(number))].fault
            lines.append(f"| {domain} | {fault} | {error:.3f} | {level:.3f} | {lost} |")
    return "\n".join([*lines, ""])
