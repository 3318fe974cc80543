"""The check of an entry: digests, hashes, completeness, its score from its rows, some rows again; and their board.

The board has every entry with its place, as a page that needs nothing else, and as Markdown.
"""

import math
import random
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.ranks import rank_range
from jerkbench.files import write_text
from jerkbench.jobs.key import data_fingerprint
from jerkbench.jobs.preflight import require_inputs
from jerkbench.jobs.progress import Progress
from jerkbench.notices import plain
from jerkbench.report.writers import environment
from jerkbench.suite.campaign import AS_GIVEN, ENTRY, PLAIN, plugins_digest
from jerkbench.suite.entry import ENTRY_FILE, HASHED, PAGE, Entry, frozen_part, read_entry
from jerkbench.suite.protocol import SuiteProtocol, read_suite
from jerkbench.suite.scores import BoardValue, EntryScoring, score_as_json
from jerkbench.tuning.entrant import NUMBERS, Entrant, Site, Try, knobs_of, tried_settings
from jerkbench.tuning.stored_files import changed_files

_TOLERANCE = 1e-9
"""Relative, of a number that was computed once more."""


class Key(NamedTuple):
    """What tells the rows of an entry apart."""

    method: str
    scenario: int
    tuned_on: str
    seed: int


def frozen_mistakes(entry: Entry, protocol: SuiteProtocol) -> Iterator[str]:
    """Yield a sentence for each digest that is not the frozen one."""
    for key, frozen in frozen_part(str(entry.manifest["suite"]), protocol).items():
        if entry.manifest.get(key) != frozen:
            yield (
                f"The manifest's {key} is {entry.manifest.get(key)}, that of {protocol.name} {frozen}: the entry is of"
                " another suite."
            )


def file_mistakes(entry: Entry) -> list[str]:
    """Return a sentence for each file that was changed after it was made."""
    return changed_files(entry.folder, entry.manifest["files"], HASHED)


def missing_mistakes(entry: Entry, protocol: SuiteProtocol) -> list[str]:
    """Return a sentence for each method whose rows are not all there, or more than once."""
    own = Counter(Key(*key) for key in entry.rows[list(Key._fields)].itertuples(index=False))
    wanted = Counter(_keys(entry, protocol))
    wrong = Counter(key.method for key in ((own - wanted) + (wanted - own)).elements())
    return [
        f"The rows of the {method} are not those that {protocol.name} asks for: {count} are missing or too many."
        for method, count in sorted(wrong.items())
    ]


def score_mistakes(entry: Entry, protocol: SuiteProtocol) -> Iterator[str]:
    """Yield a sentence for each number of the score, and for the page, that the rows do not show."""
    stated = entry.manifest["score"]
    for key, own in score_as_json(entry.rows, protocol).items():
        if not same(own, stated.get(key)):
            yield f"The manifest says {key} = {stated.get(key)}, the rows show {own}."
    page = (entry.folder / PAGE).read_text(encoding="utf-8", errors="replace")
    if page != EntryScoring(protocol).page(entry.name, entry.rows):
        yield "entry.md does not say what the rows show."


def same(value: object, other: object) -> bool:
    """Whether two values are the same, numbers to a relative 1e-9; NaN is NaN."""
    if isinstance(value, float) and isinstance(other, (int, float)):
        return math.isclose(value, other, rel_tol=_TOLERANCE) or (math.isnan(value) and math.isnan(other))
    return value == other


def _keys(entry: Entry, protocol: SuiteProtocol) -> Iterator[Key]:
    """Every row that there has to be."""
    for method in (ENTRY, PLAIN):
        for tuned_on in dict.fromkeys([AS_GIVEN, *entry.settings.get(method, {})]):
            yield from (Key(method, 0, tuned_on, seed) for seed in protocol.seeds_to_test_on)


@dataclass(frozen=True)
class CheckedEntry:
    """What a check found.

    Attributes:
        mistakes: what is wrong, a sentence each.
        remarks: what could not be checked, or differs without being wrong.
        rerun: rows of the entry's own method that were computed once more.
    """

    mistakes: tuple[str, ...]
    remarks: tuple[str, ...]
    rerun: int


def verify(entry: Entry, count: int = 12, *, run_programs: bool = False) -> CheckedEntry:
    """Check an entry; two thirds of ``count`` rows are its own, the rest are the plain filter's.

    The rows that are computed once more are drawn anew each time; of an entry that does not fit its hashes, none is.

    Raises:
        JerkbenchError: its suite is not known here, or its program may not run.
    """
    protocol = read_suite(str(entry.manifest.get("suite")))
    missing = missing_mistakes(entry, protocol)
    mistakes = [
        *frozen_mistakes(entry, protocol),
        *file_mistakes(entry),
        *missing,
    ]
    if missing:
        return CheckedEntry(tuple(mistakes), (), 0)
    if mistakes:
        count = 0
    if entry.program and count and not run_programs:
        raise JerkbenchError(
            f"The rows of {entry.folder} come from the program {entry.program}, which does not run unasked; give"
            " --run-programs if you trust it, or --rows 0 to check the files alone."
        )
    own = _checked(entry, ENTRY, entry.entrant, protocol, count - count // 3)
    plain = _checked(entry, PLAIN, protocol.plain_entrant, protocol, count // 3)
    mistakes += [*score_mistakes(entry, protocol), *own.mistakes, *plain.mistakes]
    return CheckedEntry(tuple(mistakes), (*own.remarks, *plain.remarks), own.rerun)


def _checked(entry: Entry, method: str, entrant: Entrant, protocol: SuiteProtocol, count: int) -> CheckedEntry:
    """Check settings and rows of one of the two methods of an entry, where it can be made here."""
    try:
        digest = plugins_digest(entrant, protocol)
        _require_data(entrant, protocol)
        wrong = list(_settings_mistakes(entry, method, entrant, protocol))
    except JerkbenchError as error:
        sentence = f"The rows of {entrant.name} cannot be computed here, and are not checked: {error}"
        return CheckedEntry((), (sentence,), 0)
    if wrong:
        return CheckedEntry(tuple(wrong), (), 0)
    remarks: tuple[str, ...] = ()
    if method == ENTRY and digest != entry.manifest.get("plugins"):
        remarks = (f"The code of {entrant.name} here is not that of the entry; its rows are compared all the same.",)
    rows = entry.rows[entry.rows["method"] == method]
    sample = rows.iloc[random.SystemRandom().sample(range(len(rows)), min(count, len(rows)))]
    return CheckedEntry(tuple(_row_mistakes(entry, method, entrant, sample, protocol)), remarks, len(sample))


def _require_data(entrant: Entrant, protocol: SuiteProtocol) -> None:
    """Require that what the rows are computed with is on this machine.

    Raises:
        JerkbenchError: a recording was not fetched, or a package is not installed.
    """
    job = entrant.job(protocol.scenario, protocol.limits)
    data_fingerprint(job.scenario.dataset, job.scenario.disturbances)
    require_inputs(job, set())


def _settings_mistakes(entry: Entry, method: str, entrant: Entrant, protocol: SuiteProtocol) -> Iterator[str]:
    """Yield a sentence for each setting that the search of the suite does not try."""
    space = knobs_of(entrant.job(protocol.scenario, protocol.limits))
    tried = tried_settings(protocol.trials, space)
    for tuned_on, values in entry.settings[method].items():
        allowed = tried[:1] if tuned_on == AS_GIVEN else tried
        setting = entry.setting(method, tuned_on)
        if tuple(values) != space.names or not any(all(map(same, setting, own)) for own in allowed):
            where = f"The setting of the {method} ({tuned_on})"
            yield f"{where} is none that the search of {protocol.name} tries: {values}."


def _row_mistakes(
    entry: Entry, method: str, entrant: Entrant, sample: pd.DataFrame, protocol: SuiteProtocol
) -> Iterator[str]:
    """Compute rows once more, and yield a sentence for each that comes out differently."""
    if sample.empty:
        return
    stored = sample.sort_values("tuned_on").to_dict("records")
    settings = (entry.setting(method, own["tuned_on"]) for own in stored)
    tries = [
        Try(0, protocol.scenario, entrant, setting, k, [own["seed"]])
        for k, (own, setting) in enumerate(zip(stored, settings, strict=True))
    ]
    with TemporaryDirectory(prefix="jerkbench-") as folder:
        again = Site(Path(folder)).rows(tries, protocol.rules(), Progress(0)).to_dict("records")
    for before, own in zip(stored, again, strict=True):
        differing = (key for key in ("status", *NUMBERS) if not same(before[key], own[key]))
        if (key := next(differing, None)) is not None:
            where = f"on seed {before['seed']}, {before['tuned_on']}"
            yield f"The {method} {where}: {key} is stored as {before[key]}, and comes out as {own[key]}."


# The board: every entry with its place.

BoardRank = tuple[int, int, int]
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
    for path in sorted(folder.glob(f"*/{ENTRY_FILE}")):
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
    scoring = EntryScoring(protocol)
    scored = sorted(zip(_places([scoring.ratios(entries[k].rows) for k in whole]), whole, strict=True))
    lines = [_line(own, entries[k], scoring, checks[k]) for own, k in scored]
    heads = ("rank (95 %)", "entry", *scoring.heads, "tuned", "verified")
    return Board(protocol.name, scoring.about, heads, lines, remarks)


def _places(ratios: Sequence[FloatArray]) -> list[BoardRank]:
    """The place of each entry, with its range, by the ratios of each drive."""
    if not ratios:
        return []
    ranks = rank_range(np.stack(ratios, axis=-1)[:, None])
    return list(zip(*(each.tolist() for each in (ranks.place, ranks.low, ranks.high)), strict=True))


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

    styles = files("jerkbench.report").joinpath("assets/report.css").read_text(encoding="utf-8")
    script = files("jerkbench.suite").joinpath("templates/board.js").read_text(encoding="utf-8")
    template = environment().overlay(loader=PackageLoader("jerkbench.suite")).get_template("board.html")
    return template.render(
        board=board,
        styles=Markup(styles),  # noqa: S704 - our own file
        script=Markup(script),  # noqa: S704 - our own file
    )


def _line(place: BoardRank, entry: Entry, scoring: EntryScoring, own: CheckedEntry) -> list[BoardValue]:
    first, low, high = place
    rank = BoardValue(f"{first} ({low} to {high})", f"{first}")
    tuned = BoardValue("yes" if entry.manifest.get("tuned") else "no")
    verified = "no: see below" if own.mistakes else f"yes, {own.rerun} rows" if own.rerun else "its files only"
    return [rank, BoardValue(entry.name), *scoring.fields(entry.rows), tuned, BoardValue(verified)]


def _escaped(text: str) -> str:
    """Text that is neither HTML nor a column of a table in Markdown."""
    from markupsafe import escape

    return str(escape(" ".join(text.split()))).replace("|", "&#124;")
