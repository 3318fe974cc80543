"""The score of an entry from its rows, and its page: compared with the plain filter, tuned alike, on unseen drives."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.evaluation.intervals import few_intervals
from jerkbench.evaluation.judgement import LEVEL, Verdict
from jerkbench.files import filled_template
from jerkbench.report.writers import passive
from jerkbench.suite.campaign import AS_GIVEN, ENTRY, PLAIN, suite_levels, suite_losses
from jerkbench.suite.protocol import SuiteProtocol

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


NOTICEABLE = 1.03
"""A ratio above this counts as worse on a drive."""


@dataclass(frozen=True)
class EntryScoring:
    """How the entries of a suite are scored and shown: by the position RMSE over random drives.

    The score is over ``n`` drives; the interval holds for as many entries at once as the suite says. ``nominal`` is the
    ratio over drives without a fault: the price; ``worse`` the share of drives on which the entry is worse by more than
    3 %; ``worst_kind`` the kind of fault among whose drives the ratio is largest, which is ``worst_ratio``.

    Attributes:
        protocol: of the suite.
    """

    protocol: SuiteProtocol

    @property
    def about(self) -> str:
        """What is compared with what, on the board."""
        return " ".join(self._about("board").split())

    def _about(self, where: str) -> str:
        template = Path(__file__).with_name("about.md.jinja")
        return filled_template(template, p=self.protocol, plain=self.protocol.plain_entrant.name, where=where)

    @property
    def heads(self) -> tuple[str, ...]:
        """What stands above the fields on the board."""
        ratio = f"ratio to tuned plain [95 % for {self.protocol.entries} entries at once]"
        return "n", ratio, "verdict", "without a fault", "worse by 3 % on [%]", "worst kind", "lost [%]", "ns a step"

    def ratios(self, rows: pd.DataFrame, *, as_given: bool = False) -> FloatArray:
        """Return (n,) log(entry / tuned plain) of each drive; a lost run counts a hundred times the level.

        The level of a drive is the error of the plain filter at its defaults. With ``as_given`` the entry has the
        setting that it came with, also where it was tuned.
        """
        start = rows[(rows["method"] == PLAIN) & (rows["tuned_on"] == AS_GIVEN)].assign(trial=0)
        known = rows.assign(loss=suite_losses(rows, suite_levels(start)))
        own = counted(known, ENTRY, as_given=as_given), counted(known, PLAIN)
        entry, plain = (rows.set_index("seed")["loss"].sort_index() for rows in own)
        return np.asarray((entry - plain).to_numpy(), dtype=np.float64)

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
        tuned = (rows.loc[rows["method"] == ENTRY, "tuned_on"] != AS_GIVEN).any()
        line = passive(
            f"{name} on {self.protocol.name} (n = {score['n']} drives): {score['ratio']:.3f} of the tuned plain filter"
            f" [{score['low']:.3f}, {score['high']:.3f}], {score['verdict']}; {more}; lost {100 * score['lost']:.1f} %;"
            f" {f'tuned, {self.protocol.trials} settings' if tuned else 'not tuned'}."
        )
        kinds = ((kind, of.sum(), f"{np.exp(d[of].mean()):.3f}") for kind, of in self.members().items())
        rows_of_kinds = "".join(f"| {' | '.join(map(str, kind))} |\n" for kind in kinds)
        return f"{line}\n\n{self._about('page')}\n| drives with | n | ratio |\n|---|---|---|\n{rows_of_kinds}"

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


def score_as_json(rows: pd.DataFrame, protocol: SuiteProtocol) -> EntryScore:
    """Return the score that the rows show, as JSON has it: what has no value is None."""
    score = EntryScoring(protocol).score(rows)
    return {key: None if isinstance(value, float) and np.isnan(value) else value for key, value in score.items()}
