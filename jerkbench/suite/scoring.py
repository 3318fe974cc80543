"""The ways in which suites score: of filters that navigate, by their position; of attitude filters, by the tilt."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.campaigns.ratios import of_families
from jerkbench.suite.attitude_scores import attitude_log_ratios, attitude_page, attitude_score
from jerkbench.suite.protocol import HAND, AttitudeSuite, DriveSuite, SuiteProtocol
from jerkbench.suite.scores import (
    drive_log_ratios,
    drive_page,
    drive_score,
    entry_log_ratios,
    entry_page,
    entry_score,
)


@dataclass(frozen=True)
class BoardValue:
    """One field of the board.

    Attributes:
        text: what is shown.
        sorting: the number to sort by; empty: by the text.
    """

    text: str
    sorting: str = ""


class EntryScoring(Protocol):
    """How the entries of a suite are scored and shown."""

    @property
    def heads(self) -> tuple[str, ...]:
        """What stands above the fields of an entry on the board."""

    @property
    def about(self) -> str:
        """What a reader of the board has to know."""

    def score(self, rows: pd.DataFrame) -> dict[str, Any]:
        """Return the score that the rows show, as JSON has it: what has no value is null."""

    def page(self, name: str, rows: pd.DataFrame) -> str:
        """Return the page of an entry as Markdown."""

    def costs(self, rows: pd.DataFrame) -> Mapping[str, FloatArray]:
        """Return what ranks are of, and (S, n) logarithms of ratios that each is found from; the first sorts."""

    def fields(self, rows: pd.DataFrame) -> list[BoardValue]:
        """Return the fields of an entry."""


@dataclass(frozen=True)
class ByPosition:
    """The position RMSE over scenarios of faults."""

    protocol: SuiteProtocol

    @property
    def heads(self) -> tuple[str, ...]:
        """Ratio, its verdict, and where it is worst."""
        ratio = "ratio to tuned plain [95 %]"
        return ratio, "verdict", "worst scenario", "nothing wrong", "lost [%]", "ns a step"

    @property
    def about(self) -> str:
        """What is compared with what."""
        protocol = self.protocol
        return (
            f"{protocol.name} (digest {protocol.digest}): {len(protocol.scenarios)} scenarios, {protocol.test_seeds}"
            f" seeds each. Ratios of the position RMSE to {' + '.join(protocol.plain.values())}, tuned with the same"
            f" {protocol.trials} settings on the other half of the faults; below 1 is better. Times are those of the"
            " machine that made the entry."
        )

    def score(self, rows: pd.DataFrame) -> dict[str, Any]:
        """Return the fields of an `EntryScore`."""
        return _plain(asdict(entry_score(rows, self.protocol)))

    def page(self, name: str, rows: pd.DataFrame) -> str:
        """Return a line and the ratio in each scenario."""
        return entry_page(name, entry_score(rows, self.protocol), rows, self.protocol)

    def costs(self, rows: pd.DataFrame) -> Mapping[str, FloatArray]:
        """Return families and seeds."""
        return {"rank (95 %)": of_families(entry_log_ratios(rows, self.protocol), self.protocol.scenarios)}

    def fields(self, rows: pd.DataFrame) -> list[BoardValue]:
        """Return the score's numbers."""
        score = entry_score(rows, self.protocol)
        return [
            BoardValue(f"{score.ratio:.3f} [{score.low:.3f}, {score.high:.3f}]", f"{score.ratio:.9g}"),
            BoardValue(score.verdict),
            BoardValue(f"{score.worst} {score.worst_ratio:.2f}", f"{score.worst_ratio:.9g}"),
            _number(score.nominal, ".3f"),
            _number(100 * score.lost, ".1f"),
            _number(score.step_ns, ".0f"),
        ]


@dataclass(frozen=True)
class ByDrives:
    """The position RMSE over random drives."""

    protocol: DriveSuite

    @property
    def heads(self) -> tuple[str, ...]:
        """Count, ratio and verdict, and where it is worst."""
        ratio = f"ratio to tuned plain [95 % for {self.protocol.entries} entries at once]"
        return "n", ratio, "verdict", "without a fault", "worse by 3 % on [%]", "worst kind", "lost [%]", "ns a step"

    @property
    def about(self) -> str:
        """What is compared with what."""
        protocol = self.protocol
        return (
            f"{protocol.name} (digest {protocol.digest}): n = {protocol.test_seeds} random drives, each with a field, a"
            f" speed and up to three faults of its own. Ratios of the position RMSE to"
            f" {' + '.join(protocol.plain.values())}, tuned with the same {protocol.trials} settings on"
            f" {protocol.tune_seeds} other drives; below 1 is better. One rule for all verdicts: the interval over"
            f" drives, at 5 % for {protocol.entries} entries at once; within {100 * protocol.margin:g} % is equal. The"
            " luck of the one tuning is not in the interval. Times are those of the machine that made the entry."
        )

    def score(self, rows: pd.DataFrame) -> dict[str, Any]:
        """Return the fields of a `DriveScore`."""
        return _plain(asdict(drive_score(rows, self.protocol)))

    def page(self, name: str, rows: pd.DataFrame) -> str:
        """Return a line, and the ratio by number and by kind of faults."""
        return drive_page(name, rows, self.protocol)

    def costs(self, rows: pd.DataFrame) -> Mapping[str, FloatArray]:
        """Return drives."""
        return {"rank (95 %)": drive_log_ratios(rows, self.protocol)[:, None]}

    def fields(self, rows: pd.DataFrame) -> list[BoardValue]:
        """Return the score's numbers."""
        score = drive_score(rows, self.protocol)
        return [
            BoardValue(f"{score.n}"),
            BoardValue(f"{score.ratio:.3f} [{score.low:.3f}, {score.high:.3f}]", f"{score.ratio:.9g}"),
            BoardValue(score.verdict),
            _number(score.nominal, ".3f"),
            _number(100 * score.worse, ".0f"),
            BoardValue(f"{score.worst_kind} {score.worst_ratio:.2f}", f"{score.worst_ratio:.9g}"),
            _number(100 * score.lost, ".1f"),
            _number(score.step_ns, ".0f"),
        ]


@dataclass(frozen=True)
class ByTilt:
    """The inclination RMSE in each domain."""

    protocol: AttitudeSuite

    @property
    def heads(self) -> tuple[str, ...]:
        """The same for each domain."""
        several = ("ratio to tuned plain [95 %]", "verdict", "median [deg]", "worst [deg]", "lost [%]")
        return tuple(f"{domain}: {head}" for domain in self.protocol.domains for head in several)

    @property
    def about(self) -> str:
        """What is compared with what."""
        protocol = self.protocol
        trials = sum(map(len, protocol.hand.values()))
        counts = {domain: f"n = {trials} trials of BROAD" for domain in [HAND] if trials}
        counts |= dict.fromkeys(protocol.fields, f"n = {protocol.test_seeds} simulated drives")
        domains = ", ".join(f"{domain} ({count})" for domain, count in counts.items())
        return (
            f"{protocol.name} (digest {protocol.digest}). Tuned and scored apart: {domains}. Ratios of the inclination"
            f" RMSE to {protocol.plain_entrant.name}, tuned with the same {protocol.trials} settings on the other half;"
            " below 1 is better."
        )

    def score(self, rows: pd.DataFrame) -> dict[str, Any]:
        """Return the fields of each `DomainScore`, with the domain before their names."""
        scores = attitude_score(rows, self.protocol)
        return _plain({f"{domain} {key}": v for domain, own in scores.items() for key, v in asdict(own).items()})

    def page(self, name: str, rows: pd.DataFrame) -> str:
        """Return a line for each domain, and the errors in each scenario."""
        return attitude_page(name, rows, self.protocol)

    def costs(self, rows: pd.DataFrame) -> Mapping[str, FloatArray]:
        """Return trials, and drives."""
        return {
            f"{domain}: rank (95 %)": attitude_log_ratios(rows, self.protocol, domain)[:, None]
            for domain in self.protocol.domains
        }

    def fields(self, rows: pd.DataFrame) -> list[BoardValue]:
        """Return the numbers of each domain."""
        return [
            field
            for own in attitude_score(rows, self.protocol).values()
            for field in (
                BoardValue(f"{own.ratio:.3f} [{own.low:.3f}, {own.high:.3f}]", f"{own.ratio:.9g}"),
                BoardValue(own.verdict),
                _number(own.median_deg, ".2f"),
                BoardValue(f"{own.worst_deg:.2f} ({own.worst})", f"{own.worst_deg:.9g}"),
                _number(100 * own.lost, ".1f"),
            )
        ]


def entry_scoring(protocol: SuiteProtocol) -> EntryScoring:
    """Return how the entries of a suite are scored."""
    if isinstance(protocol, DriveSuite):
        return ByDrives(protocol)
    return ByTilt(protocol) if isinstance(protocol, AttitudeSuite) else ByPosition(protocol)


def _plain(score: Mapping[str, Any]) -> dict[str, Any]:
    return {key: None if isinstance(v, float) and math.isnan(v) else v for key, v in score.items()}


def _number(value: float, form: str) -> BoardValue:
    return BoardValue(f"{value:{form}}", f"{value:.9g}")
