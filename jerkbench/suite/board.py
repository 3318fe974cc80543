"""The board of a suite: every entry with its place, as a page that needs nothing else, and as Markdown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.statistics.ranks import rank_range
from jerkbench.files import write_text
from jerkbench.plain import plain
from jerkbench.report.markup import environment
from jerkbench.suite.entry import MANIFEST, Entry, read_entry
from jerkbench.suite.protocol import SuiteProtocol, read_suite
from jerkbench.suite.scores import BoardValue, EntryScoring, entry_scoring
from jerkbench.suite.verify import CheckedEntry, missing_mistakes, verify

Places = Sequence[tuple[int, int, int]]
"""A place, and the best and the worst within its range."""


@dataclass(frozen=True)
class Board:
    """The entries of one suite.

    Attributes:
        name: of the suite.
        about: what a reader has to know.
        heads: what stands above the fields.
        lines: the fields of each entry, the best first.
        remarks: sentences under the table.
    """

    name: str
    about: str
    heads: tuple[str, ...]
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
    whole = [k for k, entry in enumerate(entries) if not missing_mistakes(entry, protocol)]
    said = ((entry, (*own.mistakes, *own.remarks)) for entry, own in zip(entries, checks, strict=True))
    remarks = [plain(f"{entry.name}: {text}") for entry, texts in said for text in texts]
    scoring = entry_scoring(protocol)
    places = _places([scoring.costs(entries[k].rows) for k in whole])
    scored = sorted(zip(zip(*places.values(), strict=True), whole, strict=True))
    lines = [_line(own, entries[k], scoring, checks[k]) for own, k in scored]
    heads = (*places, "entry", *scoring.heads, "tuned", "verified")
    return Board(protocol.name, scoring.about, heads, lines, remarks)


def _places(costs: Sequence[Mapping[str, FloatArray]]) -> dict[str, Places]:
    """The place of each entry in each ranking, with its range."""
    places: dict[str, Places] = {}
    for name in costs[0] if costs else ():
        ranks = rank_range(np.stack([own[name] for own in costs], axis=-1))
        places[name] = list(zip(*(each.tolist() for each in (ranks.place, ranks.low, ranks.high)), strict=True))
    return places


def board_markdown(board: Board) -> str:
    """Return the board as Markdown."""
    fields = ([_escaped(value.text) for value in line] for line in board.lines)
    rows = [board.heads, ["---"] * len(board.heads), *fields]
    table = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    remarks = "".join(f"- {_escaped(text)}\n" for text in board.remarks)
    return f"# {board.name}\n\n{board.about}\n\n{table}\n{remarks}"


def html(board: Board) -> str:
    """Return the board as one HTML file; all that an entry says of itself is escaped."""
    from jinja2 import PackageLoader
    from markupsafe import Markup

    styles = files("jerkbench.report.page").joinpath("report.css").read_text(encoding="utf-8")
    script = files("jerkbench.suite").joinpath("templates/board.js").read_text(encoding="utf-8")
    template = environment().overlay(loader=PackageLoader("jerkbench.suite")).get_template("board.html")
    return template.render(
        board=board,
        styles=Markup(styles),  # noqa: S704 - our own file
        script=Markup(script),  # noqa: S704 - our own file
    )


def _line(places: Places, entry: Entry, scoring: EntryScoring, own: CheckedEntry) -> list[BoardValue]:
    ranks = [BoardValue(f"{place} ({low} to {high})", f"{place}") for place, low, high in places]
    tuned = BoardValue("yes" if entry.manifest.get("tuned") else "no")
    verified = "no: see below" if own.mistakes else f"yes, {own.rerun} rows" if own.rerun else "its files only"
    return [*ranks, BoardValue(entry.name), *scoring.fields(entry.rows), tuned, BoardValue(verified)]


def _escaped(text: str) -> str:
    """Text that is neither HTML nor a column of a table in Markdown."""
    from markupsafe import escape

    return str(escape(" ".join(text.split()))).replace("|", "&#124;")
