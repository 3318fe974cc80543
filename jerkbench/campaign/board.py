"""The verification of entries of a suite, and their board, a page with the rank of each entry."""

import math
import random
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from jerkbench.campaign.entry import (
    AS_GIVEN,
    ENTRY,
    ENTRY_FILE,
    HASHED,
    NUMBERS,
    PAGE,
    PLAIN,
    Entry,
    about_suite,
    entry_page,
    frozen_part,
    plugins_digest,
    ratios,
    read_entry,
    score_as_json,
    score_of,
)
from jerkbench.campaign.protocol import SuiteProtocol, read_suite
from jerkbench.campaign.runs import CampaignRuns, MethodSpec, tried_settings, tunable_space
from jerkbench.campaign.stored_files import changed_files
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.ranks import rank_range
from jerkbench.files import write_text
from jerkbench.jobs.key import data_fingerprint
from jerkbench.jobs.preflight import require_inputs
from jerkbench.jobs.progress import Progress
from jerkbench.notices import plain
from jerkbench.report.writers import environment

ROW_TOLERANCE = 1e-9
"""Relative tolerance of a number that is computed again."""


@dataclass(frozen=True)
class CheckedEntry:
    """The result of a verification.

    Attributes:
        mistakes: errors of the entry.
        remarks: parts that could not be verified, or differ without being wrong.
        rerun: number of rows of the method that were computed again.
    """

    mistakes: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    rerun: int = 0


def verify(entry: Entry, count: int = 12, *, run_programs: bool = False) -> CheckedEntry:
    """Verify an entry: its digests, hashes, completeness, score, settings, and a sample of its rows.

    Two thirds of the ``count`` rows that are computed again belong to the method, the others to the plain filter. The
    sample differs each time. No row is computed again if the files do not fit their hashes.

    Raises:
        JerkbenchError: The suite is unknown, or the program of the method may not run.
    """
    protocol = read_suite(str(entry.manifest.get("suite")))
    missing = missing_mistakes(entry, protocol)
    mistakes = [
        *frozen_mistakes(entry, protocol),
        *changed_files(entry.folder, entry.manifest["files"], HASHED),
        *missing,
    ]
    if missing:
        return CheckedEntry(tuple(mistakes))
    count = 0 if mistakes else count
    if entry.program and count and not run_programs:
        raise JerkbenchError(
            f"The rows of {entry.folder} come from the program {entry.program}, which does not run unasked; give"
            " --run-programs if you trust it, or --rows 0 to check the files alone."
        )
    own = _checked(entry, ENTRY, entry.method, protocol, count - count // 3)
    plain = _checked(entry, PLAIN, protocol.plain_method, protocol, count // 3)
    mistakes += [*score_mistakes(entry, protocol), *own.mistakes, *plain.mistakes]
    return CheckedEntry(tuple(mistakes), (*own.remarks, *plain.remarks), own.rerun)


def frozen_mistakes(entry: Entry, protocol: SuiteProtocol) -> Iterator[str]:
    """Yield a message for each digest that differs from the frozen one."""
    for key, frozen in frozen_part(str(entry.manifest["suite"]), protocol).items():
        if entry.manifest.get(key) != frozen:
            yield (
                f"The manifest's {key} is {entry.manifest.get(key)}, that of {protocol.name} {frozen}: the entry is of"
                " another suite."
            )


def missing_mistakes(entry: Entry, protocol: SuiteProtocol) -> list[str]:
    """Return a message for each method with missing or additional rows."""
    found = Counter(entry.rows[["method", "scenario", "tuned_on", "seed"]].itertuples(index=False, name=None))
    wanted = Counter(
        (method, 0, tuned_on, seed)
        for method in (ENTRY, PLAIN)
        for tuned_on in dict.fromkeys([AS_GIVEN, *entry.settings.get(method, {})])
        for seed in protocol.seeds_to_test_on
    )
    wrong = Counter(method for method, *_ in ((found - wanted) + (wanted - found)).elements())
    return [
        f"The rows of the {method} are not those that {protocol.name} asks for: {count} are missing or too many."
        for method, count in sorted(wrong.items())
    ]


def score_mistakes(entry: Entry, protocol: SuiteProtocol) -> Iterator[str]:
    """Yield a message for each number of the score, and for the page, that does not follow from the rows."""
    stated = entry.manifest["score"]
    for key, own in score_as_json(entry.rows, protocol).items():
        if not same(own, stated.get(key)):
            yield f"The manifest says {key} = {stated.get(key)}, the rows show {own}."
    page = (entry.folder / PAGE).read_text(encoding="utf-8", errors="replace")
    if page != entry_page(entry.name, entry.rows, protocol):
        yield "entry.md does not say what the rows show."


def same(value: object, other: object) -> bool:
    """Whether two values are equal, numbers to a relative 1e-9; NaN equals NaN."""
    if isinstance(value, float) and isinstance(other, (int, float)):
        return math.isclose(value, other, rel_tol=ROW_TOLERANCE) or (math.isnan(value) and math.isnan(other))
    return value == other


def _checked(entry: Entry, label: str, method: MethodSpec, protocol: SuiteProtocol, count: int) -> CheckedEntry:
    """Verify the settings and ``count`` rows of one of the two methods, if the method can be made here."""
    try:
        digest, job = plugins_digest(method, protocol), protocol.job(method)
        data_fingerprint(job.scenario.dataset, job.scenario.disturbances)
        require_inputs(job, set())
        wrong = tuple(_settings_mistakes(entry, label, method, protocol))
    except JerkbenchError as error:
        return CheckedEntry(
            remarks=(f"The rows of {method.name} cannot be computed here, and are not checked: {error}",)
        )
    if wrong:
        return CheckedEntry(wrong)
    remarks: tuple[str, ...] = ()
    if label == ENTRY and digest != entry.manifest.get("plugins"):
        remarks = (f"The code of {method.name} here is not that of the entry; its rows are compared all the same.",)
    rows = entry.rows[entry.rows["method"] == label]
    sample = rows.iloc[random.SystemRandom().sample(range(len(rows)), min(count, len(rows)))]
    return CheckedEntry(tuple(_row_mistakes(entry, label, method, sample, protocol)), remarks, len(sample))


def _settings_mistakes(entry: Entry, label: str, method: MethodSpec, protocol: SuiteProtocol) -> Iterator[str]:
    """Yield a message for each setting that the search of the suite does not try."""
    space = tunable_space(protocol.job(method))
    tried = tried_settings(protocol.trials, space)
    for tuned_on, values in entry.settings[label].items():
        allowed = tried[:1] if tuned_on == AS_GIVEN else tried
        setting = entry.setting(label, tuned_on)
        if tuple(values) != space.names or not any(all(map(same, setting, own)) for own in allowed):
            where = f"The setting of the {label} ({tuned_on})"
            yield f"{where} is none that the search of {protocol.name} tries: {values}."


def _row_mistakes(
    entry: Entry, label: str, method: MethodSpec, sample: pd.DataFrame, protocol: SuiteProtocol
) -> Iterator[str]:
    """Compute rows again, and yield a message for each row that differs."""
    if sample.empty:
        return
    stored = sample.sort_values("tuned_on").to_dict("records")
    settings = [(entry.setting(label, row["tuned_on"]), [row["seed"]]) for row in stored]
    with TemporaryDirectory(prefix="jerkbench-") as folder:
        runs = CampaignRuns(Path(folder))
        again = runs.rows_of_settings(protocol.job(method), settings, NUMBERS, Progress(0)).to_dict("records")
    for before, own in zip(stored, again, strict=True):
        differing = (key for key in ("status", *NUMBERS) if not same(before[key], own[key]))
        if (key := next(differing, None)) is not None:
            where = f"on seed {before['seed']}, {before['tuned_on']}"
            yield f"The {label} {where}: {key} is stored as {before[key]}, and comes out as {own[key]}."


def write_board(folder: Path, count: int) -> list[Path]:
    """Write board.html and board.md of the entries in ``folder``, each verified with ``count`` rows.

    Raises:
        JerkbenchError: No entry can be verified, or they belong to several suites.
    """
    checked, remarks = [], []
    for path in sorted(folder.glob(f"*/{ENTRY_FILE}")):
        try:
            entry = read_entry(path.parent)
            checked.append((entry, verify(entry, 0 if entry.program else count)))
        except JerkbenchError as error:
            remarks.append(f"{path.parent.name} is left out: {error}")
    suites = {str(entry.manifest["suite"]) for entry, _ in checked}
    if len(suites) != 1:
        content = f"entries of {', '.join(sorted(suites))}" if suites else "no entry that can be checked"
        reason = f" {remarks[0]}" if remarks else ""
        raise JerkbenchError(
            f"In {folder} there is {content}; a board is of the entries of one suite, a folder each.{reason}"
        )
    board = board_of(checked, read_suite(suites.pop()), [plain(remark) for remark in remarks])
    texts = {"board.html": html(board), "board.md": board_markdown(board)}
    for name, text in texts.items():
        write_text(folder / name, text)
    return [folder / name for name in texts]


def board_of(
    checked: Sequence[tuple[Entry, CheckedEntry]], protocol: SuiteProtocol, more: Sequence[str] = ()
) -> dict[str, Any]:
    """Return name, about, heads, lines and remarks of the board. An entry whose rows cannot be scored has no rank."""
    remarks = [plain(f"{entry.name}: {text}") for entry, own in checked for text in (*own.mistakes, *own.remarks)]
    scored = [pair for pair in checked if not missing_mistakes(pair[0], protocol)]
    lines: list[list[str]] = []
    if scored:
        ranks = rank_range(np.stack([ratios(entry.rows) for entry, _ in scored], axis=-1)[:, None])
        for k in np.lexsort([np.arange(len(scored)), ranks.high, ranks.low, ranks.place]).tolist():
            rank = f"{ranks.place[k]} ({ranks.low[k]} to {ranks.high[k]})"
            lines.append([rank, *_cells(scored[k][0], scored[k][1], protocol)])
    ratio = f"ratio to tuned plain [95 % for {protocol.entries} entries at once]"
    heads = ["rank (95 %)", "entry", "n", ratio, "verdict", "without a fault", "worse by 3 % on [%]", "worst kind"]
    return {
        "name": protocol.name,
        "about": " ".join(about_suite(protocol, "board").split()),
        "heads": [*heads, "lost [%]", "ns a step", "tuned", "verified"],
        "lines": lines,
        "remarks": [*remarks, *more],
    }


def _cells(entry: Entry, own: CheckedEntry, protocol: SuiteProtocol) -> list[str]:
    score = score_of(entry.rows, protocol)
    return [
        entry.name,
        f"{score['n']}",
        f"{score['ratio']:.3f} [{score['low']:.3f}, {score['high']:.3f}]",
        score["verdict"],
        f"{score['nominal']:.3f}",
        f"{100 * score['worse']:.0f}",
        f"{score['worst_kind']} {score['worst_ratio']:.2f}",
        f"{100 * score['lost']:.1f}",
        f"{score['step_ns']:.0f}",
        "yes" if entry.manifest.get("tuned") else "no",
        "no: see below" if own.mistakes else f"yes, {own.rerun} rows" if own.rerun else "its files only",
    ]


def board_markdown(board: Mapping[str, Any]) -> str:
    """Return the board as Markdown."""
    heads, lines = board["heads"], board["lines"]
    rows = [heads, ["---"] * len(heads), *([_escaped(cell) for cell in line] for line in lines)]
    table = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    remarks = "".join(f"- {_escaped(text)}\n" for text in board["remarks"])
    return f"# {board['name']}\n\n{board['about']}\n\n{table}\n{remarks}"


def html(board: Mapping[str, Any]) -> str:
    """Return the board as one HTML file. Text of an entry is escaped."""
    from jinja2 import PackageLoader
    from markupsafe import Markup

    template = environment().overlay(loader=PackageLoader("jerkbench.campaign")).get_template("board.html")
    trusted: dict[str, Any] = {
        "styles": Markup(files("jerkbench.report").joinpath("assets/report.css").read_text(encoding="utf-8")),  # noqa: S704
        "script": Markup(files("jerkbench.campaign").joinpath("templates/board.js").read_text(encoding="utf-8")),  # noqa: S704
    }
    return template.render(board=board, **trusted)


def _escaped(text: str) -> str:
    """Text without HTML and without separators of columns in Markdown."""
    from markupsafe import escape

    return str(escape(" ".join(text.split()))).replace("|", "&#124;")
