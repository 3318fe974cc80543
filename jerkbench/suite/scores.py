"""The score of an entry from its rows: against the plain filter, tuned alike, on what neither has seen; its page.

Of filters that navigate over scenarios of faults (v1) or random drives (v2), by their position; of attitude filters,
by the tilt.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.evaluation.intervals import few_intervals
from jerkbench.evaluation.judgement import LEVEL, Verdict
from jerkbench.evaluation.ranks import over_scenarios
from jerkbench.files import filled_template
from jerkbench.report.writers import passive
from jerkbench.suite.campaign import AS_GIVEN, ENTRY, PLAIN, suite_levels, suite_losses
from jerkbench.suite.protocol import HAND, AttitudeSuite, DriveSuite, SuiteProtocol

EntryScore = dict[str, Any]
"""What the rows of an entry show, by name. Ratios are to the tuned plain filter; below 1 is better.

``ratio`` is a geometric mean, ``low`` and ``high`` the ends of its interval, which decides the ``verdict``; ``given``
is the ratio at the setting that the entry came with, ``lost`` the share of its runs that were lost. ``anees`` is the
median of its runs, of which 6 is expected (NaN without a covariance). ``step_ns`` is the time of a step [ns], which
alone depends on the machine.
"""


@dataclass(frozen=True)
class BoardValue:
    """One field of the board.

    Attributes:
        text: what is shown.
        sorting: the number to sort by; empty: by the text.
    """

    text: str
    sorting: str = ""


def counted(rows: pd.DataFrame, method: str, *, as_given: bool = False) -> pd.DataFrame:
    """Return the rows of a method that count: those of tuned settings, if there are any."""
    own = rows[rows["method"] == method]
    tuned = own[own["tuned_on"] != AS_GIVEN]
    return own[own["tuned_on"] == AS_GIVEN] if as_given or tuned.empty else tuned


def entry_log_ratios(rows: pd.DataFrame, protocol: SuiteProtocol, *, as_given: bool = False) -> "pd.Series[float]":
    """Return log(entry / tuned plain) by scenario and seed; a lost run counts a hundred times the level.

    Where a scenario is scored with what was tuned on each half, it is the mean of both.

    Args:
        rows: of both.
        protocol: of the suite.
        as_given: take the entry at the setting that it came with, also where it was tuned.
    """
    start = rows[(rows["method"] == PLAIN) & (rows["tuned_on"] == AS_GIVEN)].assign(trial=0)
    known = rows.assign(loss=suite_losses(rows, suite_levels(start, protocol), protocol))
    own = counted(known, ENTRY, as_given=as_given), counted(known, PLAIN)
    entry, plain = (rows.groupby(["scenario", "seed"])["loss"].mean() for rows in own)
    return entry - plain


IMU_HZ = 100.0
"""Steps a second of the simulated fields."""


def of_runs(rows: pd.DataFrame, protocol: SuiteProtocol) -> EntryScore:
    """Return what the runs of an entry alone show."""
    own = counted(rows, ENTRY)
    fastest_s = float(rows.loc[rows["method"] == ENTRY, "seconds"].min())
    return {
        "lost": float((own["status"] != "ok").mean()),
        "anees": float(own["anees"].median()),
        "step_ns": fastest_s / (protocol.duration_s * IMU_HZ) * 1e9,
    }


def ratio_verdict(low: float, high: float, margin: float) -> Verdict:
    """Return what an interval of a ratio shows: equal within the margin, else better, worse or nothing."""
    if 1 / (1 + margin) <= low and high <= 1 + margin:
        return Verdict.EQUAL
    return Verdict.BETTER if high < 1 else Verdict.WORSE if low > 1 else Verdict.UNDECIDED


def ratio_word(low: float, high: float, margin: float) -> str:
    """Return the verdict of an interval of a ratio, as the audit has it: better or worse first, then equal.

    >>> ratio_word(0.92, 0.98, 0.1), ratio_word(0.95, 1.04, 0.1), ratio_word(0.8, 1.2, 0.1)
    ('better, by less than 10 %', 'equal', 'undecided')
    """
    shown, verdict = "better" if high < 1 else "worse" if low > 1 else "", ratio_verdict(low, high, margin)
    return f"{shown}, by less than {100 * margin:g} %" if shown and verdict is Verdict.EQUAL else shown or str(verdict)


def number_field(value: float, form: str) -> BoardValue:
    """Return the field of a number, in a form such as "{:.2f}"; it is sorted by all its digits."""
    return BoardValue(form.format(value), f"{value:.9g}")


def first_fields(score: EntryScore) -> list[BoardValue]:
    """Return the fields of a ratio with its interval, and of the verdict."""
    interval = f" [{score['low']:.3f}, {score['high']:.3f}]"
    return [number_field(score["ratio"], "{:.3f}" + interval), BoardValue(score["verdict"])]


@dataclass(frozen=True)
class EntryScoring(ABC):
    """How the entries of a suite are scored and shown.

    Attributes:
        protocol: of the suite.
    """

    kind: ClassVar[str]
    """By which `about.md.jinja` tells what is compared with what."""

    protocol: SuiteProtocol

    @property
    def about(self) -> str:
        """What is compared with what, on the board."""
        return " ".join(self._about(board=self.kind, page="").split())

    def _about(self, **where: str) -> str:
        template = Path(__file__).with_name("about.md.jinja")
        return filled_template(template, p=self.protocol, plain=self.protocol.plain_entrant.name, **where)

    @property
    @abstractmethod
    def heads(self) -> tuple[str, ...]:
        """What stands above the fields on the board."""

    @abstractmethod
    def score(self, rows: pd.DataFrame) -> EntryScore:
        """Return the score that the rows show."""

    @abstractmethod
    def fields(self, rows: pd.DataFrame) -> list[BoardValue]:
        """Return the fields of an entry on the board."""

    @abstractmethod
    def costs(self, rows: pd.DataFrame) -> Mapping[str, FloatArray]:
        """Return what ranks are of, and (S, n) logarithms of ratios that each is found from; the first sorts."""

    @abstractmethod
    def page(self, name: str, rows: pd.DataFrame) -> str:
        """Return the page of an entry: a line with its score, and a table."""

    def _page(self, lines: Iterable[str], heads: Sequence[str], table: Iterable[Iterable[object]]) -> str:
        """A page as Markdown: lines, what they mean, and a table with ``heads``."""
        about = self._about(page=self.kind, board="")
        rows = [f"| {' | '.join(map(str, row))} |" for row in (heads, *table)]
        return "\n".join(["\n\n".join([*lines, about]), rows[0], f"|{'---|' * len(heads)}", *rows[1:], ""])

    def _line(self, name: str, score: EntryScore, more: str, rows: pd.DataFrame) -> str:
        """What came out of the entry ``name``, in one line."""
        half = " a half" if self.kind == "attitude" else ""
        tuned = (rows.loc[rows["method"] == ENTRY, "tuned_on"] != AS_GIVEN).any()
        how = f"tuned, {self.protocol.trials} settings{half}" if tuned else "not tuned"
        return passive(
            f"{name}: {score['ratio']:.3f} of the tuned plain filter [{score['low']:.3f}, {score['high']:.3f}],"
            f" {score['verdict']}; {more}; lost {100 * score['lost']:.1f} %; {how}."
        )


@dataclass(frozen=True)
class ByPosition(EntryScoring):
    """The position RMSE over scenarios of faults.

    Its score is over families of faults, with a 95 % interval over families and seeds. ``worst`` names the scenario
    where the entry is worst, with ``worst_ratio``; ``nominal`` is the ratio where nothing is wrong: the price.
    """

    kind = "faults"
    heads = ("ratio to tuned plain [95 %]", "verdict", "worst scenario", "nothing wrong", "lost [%]", "ns a step")

    def ratios(self, rows: pd.DataFrame, *, as_given: bool = False) -> FloatArray:
        """Return (S, n) the logarithms of ratios of each scenario and seed."""
        d = entry_log_ratios(rows, self.protocol, as_given=as_given).to_numpy(dtype=np.float64)
        return np.asarray(d.reshape(len(self.protocol.scenarios), -1))

    def of_families(self, d: FloatArray) -> FloatArray:
        """Return (F, n) means over the scenarios of each family: severities and fields of one fault are one unit."""
        names = np.array([scenario.family for scenario in self.protocol.scenarios])
        return np.array([d[names == family].mean(axis=0) for family in dict.fromkeys(names.tolist())])

    def score(self, rows: pd.DataFrame) -> EntryScore:
        """Return the score that the rows show."""
        d, scenarios = self.ratios(rows), self.protocol.scenarios
        mean, by_scenario = over_scenarios(self.of_families(d)), d.mean(axis=1)
        worst = int(np.argmax(by_scenario))
        nominal = np.array([scenario.family == "none" for scenario in scenarios])
        return {
            "ratio": mean.ratio,
            "low": mean.low,
            "high": mean.high,
            "verdict": str(ratio_verdict(mean.low, mean.high, self.protocol.margin)),
            "given": float(np.exp(self.of_families(self.ratios(rows, as_given=True)).mean())),
            "worst": scenarios[worst].name,
            "worst_ratio": float(np.exp(by_scenario[worst])),
            "nominal": float(np.exp(by_scenario[nominal].mean())),
            **of_runs(rows, self.protocol),
        }

    def page(self, name: str, rows: pd.DataFrame) -> str:
        """Return the page of an entry: a line, and the ratio in each scenario."""
        protocol, score = self.protocol, self.score(rows)
        more = f"worst {score['worst']} {score['worst_ratio']:.2f}; nothing wrong {score['nominal']:.3f}"
        lost = (rows[rows["method"] == ENTRY].set_index("scenario")["status"] != "ok").groupby("scenario").sum()
        ratios = np.exp(self.ratios(rows).mean(axis=1))
        table = ((own.name, f"{ratios[k]:.3f}", lost[k]) for k, own in enumerate(protocol.scenarios))
        line = self._line(f"{name} on {protocol.name}", score, more, rows)
        return self._page([line], ("scenario", "ratio", "lost runs"), table)

    def costs(self, rows: pd.DataFrame) -> Mapping[str, FloatArray]:
        """Return what ranks are of, and (S, n) logarithms of ratios that each is found from; the first sorts."""
        return {"rank (95 %)": self.of_families(self.ratios(rows))}

    def fields(self, rows: pd.DataFrame) -> list[BoardValue]:
        """Return the fields of an entry on the board."""
        score = self.score(rows)
        return [
            *first_fields(score),
            number_field(score["worst_ratio"], f"{score['worst']} {{:.2f}}"),
            number_field(score["nominal"], "{:.3f}"),
            number_field(100 * score["lost"], "{:.1f}"),
            number_field(score["step_ns"], "{:.0f}"),
        ]


NOTICEABLE = 1.03
"""A ratio above this counts as worse on a drive."""


@dataclass(frozen=True)
class ByDrives(EntryScoring):
    """The position RMSE over random drives.

    Its score is over ``n`` drives; the interval holds for as many entries at once as the suite says. ``nominal`` is the
    ratio over drives without a fault: the price; ``worse`` the share of drives on which the entry is worse by more than
    3 %; ``worst_kind`` the kind of fault among whose drives the ratio is largest, which is ``worst_ratio``.
    """

    kind = "drives"
    protocol: DriveSuite

    @property
    def heads(self) -> tuple[str, ...]:
        """What stands above the fields on the board."""
        ratio = f"ratio to tuned plain [95 % for {self.protocol.entries} entries at once]"
        return "n", ratio, "verdict", "without a fault", "worse by 3 % on [%]", "worst kind", "lost [%]", "ns a step"

    def ratios(self, rows: pd.DataFrame, *, as_given: bool = False) -> FloatArray:
        """Return (n,) the logarithms of ratios of each drive."""
        return np.asarray(entry_log_ratios(rows, self.protocol, as_given=as_given).to_numpy(), dtype=np.float64)

    def members(self) -> dict[str, BoolArray]:
        """Return which drives (n,) have "0 faults", "1 fault" ..., and which each kind of fault; those that occur."""
        dataset = plugins.create("dataset", self.protocol.dataset)
        drawn = [list(dataset.drawn(seed)[2]) for seed in self.protocol.seeds_to_test_on]
        named = [[f"{len(kinds)} fault{'s' * (len(kinds) != 1)}", *kinds] for kinds in drawn]
        names = sorted({name for own in named for name in own})
        return {name: np.array([name in own for own in named]) for name in names}

    def score(self, rows: pd.DataFrame) -> EntryScore:
        """Return the score that the rows show."""
        d, protocol = self.ratios(rows), self.protocol
        low, high = (float(np.exp(end[0])) for end in few_intervals(d[None], 1 - LEVEL / protocol.entries))
        of_members = {name: float(np.exp(d[member].mean())) for name, member in self.members().items()}
        kinds = {name: ratio for name, ratio in of_members.items() if " " not in name}
        worst = max(kinds, key=lambda name: kinds[name])
        return {
            "n": len(d),
            "ratio": float(np.exp(d.mean())),
            "low": low,
            "high": high,
            "verdict": ratio_word(low, high, protocol.margin),
            "given": float(np.exp(self.ratios(rows, as_given=True).mean())),
            "nominal": of_members.get("0 faults", float("nan")),
            "worse": float((d > np.log(NOTICEABLE)).mean()),
            "worst_kind": worst,
            "worst_ratio": kinds[worst],
            **of_runs(rows, protocol),
        }

    def page(self, name: str, rows: pd.DataFrame) -> str:
        """Return the page of an entry: a line, and the ratio by number and by kind of faults."""
        score, d = self.score(rows), self.ratios(rows)
        more = f"without a fault {score['nominal']:.3f}; worst kind {score['worst_kind']} {score['worst_ratio']:.2f}"
        line = self._line(f"{name} on {self.protocol.name} (n = {score['n']} drives)", score, more, rows)
        table = ((kind, of.sum(), f"{np.exp(d[of].mean()):.3f}") for kind, of in self.members().items())
        return self._page([line], ("drives with", "n", "ratio"), table)

    def costs(self, rows: pd.DataFrame) -> Mapping[str, FloatArray]:
        """Return what ranks are of: drives."""
        return {"rank (95 %)": self.ratios(rows)[:, None]}

    def fields(self, rows: pd.DataFrame) -> list[BoardValue]:
        """Return the fields of an entry on the board."""
        score = self.score(rows)
        return [
            BoardValue(f"{score['n']}"),
            *first_fields(score),
            number_field(score["nominal"], "{:.3f}"),
            number_field(100 * score["worse"], "{:.0f}"),
            number_field(score["worst_ratio"], f"{score['worst_kind']} {{:.2f}}"),
            number_field(100 * score["lost"], "{:.1f}"),
            number_field(score["step_ns"], "{:.0f}"),
        ]


LOST_DEG = 180.0
"""What a lost run counts among the errors: the largest that there is."""


@dataclass(frozen=True)
class ByTilt(EntryScoring):
    """The inclination RMSE in each domain.

    Each domain has a score of its own, over ``n`` trials, or drives (a drive has every fault), with a 95 % interval.
    ``median_deg`` is the median error of its runs [deg], ``worst_deg`` that of its worst run, a lost one counts 180;
    ``worst`` is the trial or fault of that run.
    """

    kind = "attitude"
    protocol: AttitudeSuite

    @property
    def heads(self) -> tuple[str, ...]:
        """What stands above the fields on the board: the same for each domain."""
        several = ("ratio to tuned plain [95 %]", "verdict", "median [deg]", "worst [deg]", "lost [%]")
        return tuple(f"{domain}: {head}" for domain in self.protocol.domains for head in several)

    def ratios(self, rows: pd.DataFrame, domain: str, *, as_given: bool = False) -> FloatArray:
        """Return (n,) logarithms of ratios of each trial of a hand, or of each drive as the mean over its faults."""
        here = self._of_domain(rows, domain)
        d = entry_log_ratios(here, self.protocol, as_given=as_given)
        return np.asarray((d if domain == HAND else d.groupby("seed").mean()).to_numpy(), dtype=np.float64)

    def _of_domain(self, rows: pd.DataFrame, domain: str) -> pd.DataFrame:
        """The rows of a domain, with the logarithm of their error [deg]."""
        here = rows[[self.protocol.scenarios[k].noise == domain for k in rows["scenario"]]]
        return here.assign(log_deg=np.log(here[self.protocol.numbers[0]].where(here["status"] == "ok", LOST_DEG)))

    def scores(self, rows: pd.DataFrame) -> dict[str, EntryScore]:
        """Return the score in each domain."""
        return {domain: self._score(rows, domain) for domain in self.protocol.domains}

    def _score(self, rows: pd.DataFrame, domain: str) -> EntryScore:
        d = self.ratios(rows, domain)
        (low,), (high,) = (np.exp(end) for end in few_intervals(d[None], 0.95))
        own = counted(self._of_domain(rows, domain), ENTRY)
        deg = np.exp(own.groupby(["scenario", "seed"])["log_deg"].mean())
        return {
            "n": len(d),
            "ratio": float(np.exp(d.mean())),
            "low": float(low),
            "high": float(high),
            "verdict": str(ratio_verdict(low, high, self.protocol.margin)),
            "given": float(np.exp(self.ratios(rows, domain, as_given=True).mean())),
            "median_deg": float(deg.median()),
            "worst_deg": float(deg.max()),
            "worst": self.protocol.scenarios[deg.idxmax()[0]].fault,
            "lost": float((own["status"] != "ok").mean()),
        }

    def score(self, rows: pd.DataFrame) -> EntryScore:
        """Return the scores of all domains, with the domain before each name."""
        return {f"{domain} {key}": v for domain, own in self.scores(rows).items() for key, v in own.items()}

    def page(self, name: str, rows: pd.DataFrame) -> str:
        """Return the page of an entry: a line for each domain, and the errors in each scenario."""
        protocol = self.protocol
        lines = []
        for domain, own in self.scores(rows).items():
            more = f"median {own['median_deg']:.2f} deg, worst {own['worst_deg']:.2f} deg ({own['worst']})"
            lines.append(self._line(f"{name} on {protocol.name}, {domain} (n = {own['n']})", own, more, rows))
        heads = ("domain", "trial or fault", "error [deg]", "plain [deg]", "lost runs")
        return self._page(lines, heads, [row for domain in protocol.domains for row in self._rows(rows, domain)])

    def _rows(self, rows: pd.DataFrame, domain: str) -> Iterable[tuple[object, ...]]:
        """Domain, trial or fault, error of the entry and of the plain filter [deg], lost runs."""
        known = self._of_domain(rows, domain)
        entry, plain = (counted(known, method).groupby("scenario") for method in (ENTRY, PLAIN))
        deg, plain_deg = (np.exp(of["log_deg"].mean()) for of in (entry, plain))
        lost = entry["status"].agg(lambda status: (status != "ok").sum())
        for k in deg.index:
            yield domain, self.protocol.scenarios[k].fault, f"{deg[k]:.3f}", f"{plain_deg[k]:.3f}", lost[k]

    def costs(self, rows: pd.DataFrame) -> Mapping[str, FloatArray]:
        """Return what ranks are of: trials, and drives."""
        return {f"{domain}: rank (95 %)": self.ratios(rows, domain)[:, None] for domain in self.protocol.domains}

    def fields(self, rows: pd.DataFrame) -> list[BoardValue]:
        """Return the fields of an entry on the board."""
        return [
            field
            for own in self.scores(rows).values()
            for field in (
                *first_fields(own),
                number_field(own["median_deg"], "{:.2f}"),
                number_field(own["worst_deg"], f"{{:.2f}} ({own['worst']})"),
                number_field(100 * own["lost"], "{:.1f}"),
            )
        ]


def entry_scoring(protocol: SuiteProtocol) -> EntryScoring:
    """Return how the entries of a suite are scored."""
    if isinstance(protocol, DriveSuite):
        return ByDrives(protocol)
    return ByTilt(protocol) if isinstance(protocol, AttitudeSuite) else ByPosition(protocol)


def score_as_json(rows: pd.DataFrame, protocol: SuiteProtocol) -> EntryScore:
    """Return the score that the rows show, as JSON has it: what has no value is None."""
    score = entry_scoring(protocol).score(rows)
    return {key: None if isinstance(value, float) and np.isnan(value) else value for key, value in score.items()}
