"""The board of a suite: every entry with its place, as a page that needs nothing else, and as Markdown."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from jerkbench.campaigns.ratios import of_families
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.statistics.ranks import rank_range
from jerkbench.files import write_text
from jerkbench.plain import plain
from jerkbench.report.markup import environment
from jerkbench.suite.entry import MANIFEST, Entry, read_entry
from jerkbench.suite.protocol import SuiteProtocol, read_suite
from jerkbench.suite.scores import EntryScore, entry_log_ratios, entry_score
from jerkbench.suite.verify import CheckedEntry, verify

HEADS = (
    "rank (95 %)",
    "entry",
    "ratio to tuned plain [95 %]",
    "verdict",
    "worst scenario",
    "nothing wrong",
    "lost [%]",
    "ns a step",
    "tuned",
    "verified",
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


@dataclass(frozen=True)
class Board:
    """The entries of one suite.

    Attributes:
        protocol: of the suite.
        lines: the fields of each entry, the best first.
        remarks: sentences under the table.
    """

    protocol: SuiteProtocol
    lines: list[list[BoardValue]]
    remarks: list[str]


def write_board(folder: Path, count: int) -> list[Path]:
    """Write board.html and board.md of the entries below ``folder``, each verified with ``count`` rows.

    Raises:
        JerkbenchError: there is none that can be checked, or they are of several suites.
    """
    entries, checks, remarks = [], [], []
    for path in sorted(folder.glob(f"*/{MANIFEST}")):
        try:
            entry = read_entry(path.parent)
            checks.append(verify(entry, 0 if entry.program else count))
            entries.append(entry)
        except JerkbenchError as error:
            remarks.append(f"{path.parent.name} is left out: {error}")
    suites = {str(entry.manifest["suite"]) for entry in entries}
    if len(suites) != 1:
        content = f"entries of {', '.join(sorted(suites))}" if suites else "no entry that can be checked"
        reason = f" {remarks[0]}" if remarks else ""
        raise JerkbenchError(
            f"In {folder} there is {content}; a board is of the entries of one suite, a folder each.{reason}"
        )
    board = board_of(entries, checks, read_suite(suites.pop()))
    board.remarks.extend(map(plain, remarks))
    texts = {"board.html": html(board), "board.md": board_markdown(board)}
    for name, text in texts.items():
        write_text(folder / name, text)
    return [folder / name for name in texts]


def board_of(entries: Sequence[Entry], checks: Sequence[CheckedEntry], protocol: SuiteProtocol) -> Board:
    """Return the board; an entry whose rows cannot be scored has no place."""
    whole = [k for k, entry in enumerate(entries) if _whole(entry, protocol)]
    remarks = [
        plain(f"{entry.name}: {text}") for entry, own in zip(entries, checks, strict=True) for text in _said(own)
    ]
    lines = []
    if whole:
        costs = [of_families(entry_log_ratios(entries[k].rows, protocol), protocol.scenarios) for k in whole]
        ranks = rank_range(np.stack(costs, axis=-1))
        places = zip(ranks.place, ranks.low, ranks.high, strict=True)
        scored = [(place, entries[k], checks[k]) for place, k in zip(places, whole, strict=True)]
        scored.sort(key=lambda line: int(line[0][0]))
        lines = [
            _line((int(place), int(low), int(high)), entry, entry_score(entry.rows, protocol), own)
            for (place, low, high), entry, own in scored
        ]
    return Board(protocol, lines, remarks)


def board_markdown(board: Board) -> str:
    """Return the board as Markdown."""
    rows = [HEADS, ["---"] * len(HEADS), *([_escaped(value.text) for value in line] for line in board.lines)]
    table = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    remarks = "".join(f"- {_escaped(text)}\n" for text in board.remarks)
    return f"# {board.protocol.name}\n\n{_about(board.protocol)}\n\n{table}\n{remarks}"


def html(board: Board) -> str:
    """Return the board as one HTML file; all that an entry says of itself is escaped."""
    from jinja2 import PackageLoader
    from markupsafe import Markup

    styles = files("jerkbench.report.page").joinpath("report.css").read_text(encoding="utf-8")
    script = files("jerkbench.suite").joinpath("templates/board.js").read_text(encoding="utf-8")
    template = environment().overlay(loader=PackageLoader("jerkbench.suite")).get_template("board.html")
    return template.render(
        board=board,
        heads=HEADS,
        about=_about(board.protocol),
        styles=Markup(styles),  # noqa: S704 - our own file
        script=Markup(script),  # noqa: S704 - our own file
    )


def _whole(entry: Entry, protocol: SuiteProtocol) -> bool:
    from jerkbench.suite.verify import missing_mistakes

    return not missing_mistakes(entry, protocol)


def _about(protocol: SuiteProtocol) -> str:
    plain = " + ".join(protocol.plain.values())
    return (
        f"{protocol.name} (digest {protocol.digest}): {len(protocol.scenarios)} scenarios, {protocol.test_seeds} seeds"
        f" each. Ratios of the position RMSE to {plain}, tuned with the same {protocol.trials} settings on the other"
        " half of the faults; below 1 is better. Times are those of the machine that made the entry."
    )


def _said(checked: CheckedEntry) -> tuple[str, ...]:
    return (*checked.mistakes, *checked.remarks)


def _line(places: tuple[int, int, int], entry: Entry, score: EntryScore, checked: CheckedEntry) -> list[BoardValue]:
    place, low, high = places
    return [
        BoardValue(f"{place} ({low} to {high})", f"{place}"),
        BoardValue(entry.name),
        BoardValue(f"{score.ratio:.3f} [{score.low:.3f}, {score.high:.3f}]", f"{score.ratio:.9g}"),
        BoardValue(score.verdict),
        BoardValue(f"{score.worst} {score.worst_ratio:.2f}", f"{score.worst_ratio:.9g}"),
        _number(score.nominal, ".3f"),
        _number(100 * score.lost, ".1f"),
        _number(score.step_ns, ".0f"),
        BoardValue("yes" if entry.manifest.get("tuned") else "no"),
        BoardValue(_verified(checked)),
    ]


def _number(value: float, form: str) -> BoardValue:
    return BoardValue(f"{value:{form}}", f"{value:.9g}")


def _verified(checked: CheckedEntry) -> str:
    if checked.mistakes:
        return "no: see below"
    return f"yes, {checked.rerun} rows" if checked.rerun else "its files only"


def _escaped(text: str) -> str:
    """Text that is neither HTML nor a column of a table in Markdown."""
    from markupsafe import escape

    return str(escape(" ".join(text.split()))).replace("|", "&#124;")
