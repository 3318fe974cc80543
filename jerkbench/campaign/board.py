"""Verification of the entries of a benchmark suite, and the board (a page that ranks the entries)."""

import random
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

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
from jerkbench.errors import JerkbenchError, plain
from jerkbench.evaluation.drives_and_tunings import rank_range
from jerkbench.files import write_text
from jerkbench.jobs.key import data_fingerprint
from jerkbench.jobs.plan import require_inputs
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.study import SAME_WITHIN, relative_difference


@dataclass(frozen=True)
class CheckedEntry:
    """The result of the verification of an entry of a suite.

    Attributes:
        mistakes: Messages about errors in the entry.
        remarks: Messages about parts that could not be verified, and about differences that are not errors.
        rerun: Number of rows of the method that were computed again.
    """

    mistakes: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    rerun: int = 0


def verify(entry: Entry, count: int = 12, *, run_programs: bool = False) -> CheckedEntry:
    """Verify an entry: its digests, hashes, completeness, score, settings, and a sample of its rows.

    The function computes ``count`` randomly selected rows again. Two thirds of these rows are runs of the method, and
    one third are runs of the plain filter. If a digest, a hash or the set of rows is wrong, no row is computed again.

    Raises:
        JerkbenchError: The suite is unknown, or the method runs a program and ``run_programs`` is False.
    """
    protocol = read_suite(str(entry.manifest.get("suite")))
    missing = missing_mistakes(entry, protocol)
    changed = changed_files(entry.folder, entry.manifest["files"], HASHED)
    mistakes = [*frozen_mistakes(entry, protocol), *changed, *missing]
    if missing:
        return CheckedEntry(tuple(mistakes))
    count = 0 if mistakes else count
    if entry.program and count and not run_programs:
        choice = "give --run-programs if you trust the program, or --rows 0 to check only the files"
        raise JerkbenchError(f"The rows of {entry.folder} need the program {entry.program}; {choice}.")
    checked = _checked(entry, ENTRY, entry.method, protocol, count - count // 3)
    plain = _checked(entry, PLAIN, protocol.plain_method, protocol, count // 3)
    mistakes += [*score_mistakes(entry, protocol), *checked.mistakes, *plain.mistakes]
    return CheckedEntry(tuple(mistakes), (*checked.remarks, *plain.remarks), checked.rerun)


def frozen_mistakes(entry: Entry, protocol: SuiteProtocol) -> Iterator[str]:
    """Yield a message for each digest in the manifest that differs from the frozen digest of the suite."""
    for key, frozen in frozen_part(str(entry.manifest["suite"]), protocol).items():
        if entry.manifest.get(key) != frozen:
            stated = f"The {key} in the manifest is {entry.manifest.get(key)}, but {protocol.name} has {frozen}"
            yield f"{stated}: the entry belongs to another suite."


def missing_mistakes(entry: Entry, protocol: SuiteProtocol) -> list[str]:
    """Return a message for each of the two methods (entry and plain filter) that has missing or superfluous rows."""
    found = Counter(entry.rows[["method", "scenario", "tuned_on", "seed"]].itertuples(index=False, name=None))
    wanted = Counter(
        (method, 0, tuned_on, seed)
        for method in (ENTRY, PLAIN)
        for tuned_on in dict.fromkeys([AS_GIVEN, *entry.settings.get(method, {})])
        for seed in protocol.seeds_to_test_on
    )
    wrong = Counter(method for method, *_ in ((found - wanted) + (wanted - found)).elements())
    return [
        f"The rows of the {method} are not the rows of {protocol.name}: {count} are missing or superfluous."
        for method, count in sorted(wrong.items())
    ]


def score_mistakes(entry: Entry, protocol: SuiteProtocol) -> Iterator[str]:
    """Yield a message for each number of the stored score that contradicts the rows, and a message for a wrong page."""
    stated = entry.manifest["score"]
    for key, computed in score_as_json(entry.rows, protocol).items():
        if not same(computed, stated.get(key)):
            yield f"The manifest says {key} = {stated.get(key)}, the rows show {computed}."
    page = (entry.folder / PAGE).read_text(encoding="utf-8", errors="replace")
    if page != entry_page(entry.name, entry.rows, protocol):
        yield "entry.md does not follow from the rows."


def same(value: object, other: object) -> bool:
    """Return whether two values are equal. The relative tolerance of numbers is 1e-9, and NaN equals NaN."""
    if isinstance(value, float) and isinstance(other, (int, float)):
        return relative_difference(value, other) <= SAME_WITHIN
    return value == other


def _checked(entry: Entry, label: str, method: MethodSpec, protocol: SuiteProtocol, count: int) -> CheckedEntry:
    """Verify the settings and ``count`` rows of the entry or the plain filter, if the method can run on this host."""
    try:
        digest, job = plugins_digest(method, protocol), protocol.job(method)
        data_fingerprint(job.scenario.dataset, job.scenario.disturbances)
        require_inputs(job, set())
        wrong = tuple(_settings_mistakes(entry, label, method, protocol))
    except JerkbenchError as error:
        note = f"The rows of {method.name} cannot be computed here, and are not checked: {error}"
        return CheckedEntry(remarks=(note,))
    if wrong:
        return CheckedEntry(wrong)
    remarks: tuple[str, ...] = ()
    if label == ENTRY and digest != entry.manifest.get("plugins"):
        remarks = (f"The installed code of {method.name} differs from the code of the entry. The rows were compared.",)
    rows = entry.rows[entry.rows["method"] == label]
    sample = rows.iloc[random.SystemRandom().sample(range(len(rows)), min(count, len(rows)))]
    return CheckedEntry(tuple(_row_mistakes(entry, label, method, sample, protocol)), remarks, len(sample))


def _settings_mistakes(entry: Entry, label: str, method: MethodSpec, protocol: SuiteProtocol) -> Iterator[str]:
    """Yield a message for each setting of the entry that the search of the suite does not evaluate."""
    space = tunable_space(protocol.job(method))
    tried = tried_settings(protocol.trials, space)
    for tuned_on, values in entry.settings[label].items():
        allowed = tried[:1] if tuned_on == AS_GIVEN else tried
        setting = entry.setting(label, tuned_on)
        if tuple(values) != space.names or not any(all(map(same, setting, candidate)) for candidate in allowed):
            where = f"The setting of the {label} ({tuned_on})"
            yield f"{where} is not among the settings that the search of {protocol.name} tries: {values}."


def _row_mistakes(
    entry: Entry, label: str, method: MethodSpec, sample: pd.DataFrame, protocol: SuiteProtocol
) -> Iterator[str]:
    """Compute the rows of ``sample`` again, and yield a message for each row that differs from the stored row."""
    if sample.empty:
        return
    stored = sample.sort_values("tuned_on").to_dict("records")
    settings = [(entry.setting(label, row["tuned_on"]), [row["seed"]]) for row in stored]
    with TemporaryDirectory(prefix="jerkbench-") as folder:
        runs = CampaignRuns(Path(folder))
        again = runs.rows_of_settings(protocol.job(method), settings, NUMBERS, Progress(0)).to_dict("records")
    for before, computed in zip(stored, again, strict=True):
        differing = (key for key in ("status", *NUMBERS) if not same(before[key], computed[key]))
        if (key := next(differing, None)) is not None:
            where = f"on seed {before['seed']}, {before['tuned_on']}"
            yield f"The {label} {where}: the stored {key} is {before[key]}, the computed one is {computed[key]}."


def write_board(folder: Path, count: int) -> Path:
    """Verify the entries in ``folder``, and write the board of these entries to board.md.

    For each entry, ``count`` rows are computed again. For an entry that runs a program, no row is computed again.

    Raises:
        JerkbenchError: No entry can be verified, or the entries belong to several suites.
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
        raise JerkbenchError(f"{folder} contains {content}; give the parent folder of entries of one suite.{reason}")
    write_text(folder / "board.md", board_text(checked, read_suite(suites.pop()), remarks))
    return folder / "board.md"


def board_text(checked: Sequence[tuple[Entry, CheckedEntry]], protocol: SuiteProtocol, left_out: Sequence[str]) -> str:
    """Return the board as a Markdown document. An entry with missing or superfluous rows is not ranked.

    The remarks below the table consist of the results of the verification and of the texts in ``left_out``.
    """
    found = [f"{entry.name}: {text}" for entry, result in checked for text in (*result.mistakes, *result.remarks)]
    scored = [pair for pair in checked if not missing_mistakes(pair[0], protocol)]
    lines = list[list[str]]()
    if scored:
        ranks = rank_range(np.stack([ratios(entry.rows) for entry, _ in scored], axis=-1)[:, None])
        for k in np.lexsort([np.arange(len(scored)), ranks.high, ranks.low, ranks.rank]).tolist():
            rank = f"{ranks.rank[k]} ({ranks.low[k]} to {ranks.high[k]})"
            entry, result = scored[k]
            lines.append([_escaped(cell) for cell in (rank, *_cells(entry, result, protocol))])
    ratio = f"ratio to tuned plain [95 % for {protocol.entries} entries at once]"
    heads = ["rank (95 %)", "entry", "n", ratio, "verdict", "without a fault", "worse by 3 % on [%]", "worst kind"]
    heads += ["lost [%]", "ns a step", "tuned", "verified"]
    table = "".join(f"| {' | '.join(row)} |\n" for row in (heads, ["---"] * len(heads), *lines))
    remarks = "".join(f"- {_escaped(plain(text))}\n" for text in (*found, *left_out))
    about = " ".join(about_suite(protocol, "board").split())
    return f"# {protocol.name}\n\n{about}\n\n{table}\n{remarks}"


def _cells(entry: Entry, result: CheckedEntry, protocol: SuiteProtocol) -> list[str]:
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
        "no: see below" if result.mistakes else f"yes, {result.rerun} rows" if result.rerun else "its files only",
    ]


def _escaped(text: str) -> str:
    """Escape HTML and the column separators of Markdown tables."""
    from markupsafe import escape

    return str(escape(" ".join(text.split()))).replace("|", "&#124;")
