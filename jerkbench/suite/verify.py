"""The check of an entry: what its files say of each other, and a sample of its rows once more."""

import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pandas as pd

from jerkbench.campaigns.entrant import Entrant, knobs_of, tried_settings
from jerkbench.campaigns.piece import NUMBERS, Piece
from jerkbench.errors import JerkbenchError
from jerkbench.suite.campaign import ENTRY, GIVEN, PLAIN, plugins_digest
from jerkbench.suite.checks import file_mistakes, frozen_mistakes, missing_mistakes, same, score_mistakes
from jerkbench.suite.entry import Entry
from jerkbench.suite.protocol import SuiteProtocol, read_suite


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
    mistakes = [*frozen_mistakes(entry, protocol), *file_mistakes(entry), *missing]
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
        wrong = list(_settings_mistakes(entry, method, entrant, protocol))
    except JerkbenchError as error:
        return CheckedEntry(
            (), (f"The rows of {entrant.name} cannot be computed here, and are not checked: {error}",), 0
        )
    if wrong:
        return CheckedEntry(tuple(wrong), (), 0)
    remarks: tuple[str, ...] = ()
    if method == ENTRY and digest != entry.manifest.get("plugins"):
        remarks = (f"The code of {entrant.name} here is not that of the entry; its rows are compared all the same.",)
    rows = entry.rows[entry.rows["method"] == method]
    sample = rows.iloc[random.SystemRandom().sample(range(len(rows)), min(count, len(rows)))]
    return CheckedEntry(tuple(_row_mistakes(entry, method, entrant, sample, protocol)), remarks, len(sample))


def _settings_mistakes(entry: Entry, method: str, entrant: Entrant, protocol: SuiteProtocol) -> Iterator[str]:
    """Yield a sentence for each setting that the search of the suite does not try."""
    space = knobs_of(entrant.cell(protocol.scenarios[0], protocol.limits))
    tried = tried_settings(protocol.trials, space)
    for tuned_on, values in entry.settings[method].items():
        allowed = tried[:1] if tuned_on == GIVEN else tried
        setting = entry.setting(method, tuned_on)
        if tuple(values) != space.names or not any(all(map(same, setting, own)) for own in allowed):
            where = f"The setting of the {method} ({tuned_on})"
            yield f"{where} is none that the search of {protocol.name} tries: {values}."


def _row_mistakes(
    entry: Entry, method: str, entrant: Entrant, sample: pd.DataFrame, protocol: SuiteProtocol
) -> Iterator[str]:
    """Compute rows once more, and yield a sentence for each that comes out differently."""
    names = [scenario.name for scenario in protocol.scenarios]
    for _, rows in sample.groupby(["scenario", "tuned_on"]):
        number, tuned_on = int(rows["scenario"].iloc[0]), str(rows["tuned_on"].iloc[0])
        setting, seeds = entry.setting(method, tuned_on), tuple(int(seed) for seed in rows["seed"])
        tries, scenario = ((entrant, (setting,)),), protocol.scenarios[number]
        again = Piece("", number, scenario, tries, seeds, protocol.metrics, "", None, protocol.limits).run()
        for seed, stored, own in zip(seeds, _records(rows), _records(again), strict=True):
            if wrong := _difference(stored, own):
                yield f"The {method} in {names[number]}, seed {seed}, {tuned_on}: {wrong}."


def _records(rows: pd.DataFrame) -> list[dict[str, Any]]:
    return [{str(key): value for key, value in row.items()} for row in rows.to_dict("records")]


def _difference(stored: dict[str, Any], own: dict[str, Any]) -> str:
    for key in ("status", *NUMBERS):
        if not same(stored[key], own[key]):
            return f"{key} is stored as {stored[key]}, and comes out as {own[key]}"
    return ""
