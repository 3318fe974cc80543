"""The checks of an entry that run nothing: digests, hashes, completeness, its score from its rows."""

import math
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

from jerkbench.suite.campaign import ENTRY, GIVEN, PLAIN, half_settings
from jerkbench.suite.enter import frozen_part
from jerkbench.suite.entry import PAGE, Entry, file_hashes, plain_score
from jerkbench.suite.page import entry_page
from jerkbench.suite.protocol import SuiteProtocol
from jerkbench.suite.scores import entry_score
from jerkbench.tuning.space import Setting

TOLERANCE = 1e-9
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


def file_mistakes(entry: Entry) -> Iterator[str]:
    """Yield a sentence for each file that was changed after it was made."""
    stated = entry.manifest["files"]
    for name, own in file_hashes(entry.folder).items():
        if stated.get(name) != own:
            yield f"{name} was changed after it was made: its hash is not that of the manifest."


def missing_mistakes(entry: Entry, protocol: SuiteProtocol) -> list[str]:
    """Return a sentence for each scenario whose rows are not all there, or more than once."""
    own = Counter(Key(*key) for key in entry.rows[list(Key._fields)].itertuples(index=False))
    wanted = Counter(_keys(entry, protocol))
    wrong = Counter((key.scenario, key.method) for key in ((own - wanted) + (wanted - own)).elements())
    names = dict(enumerate(scenario.name for scenario in protocol.scenarios))
    return [
        f"The rows of the {method} in {names.get(number, number)} are not those that {protocol.name} asks for: {count}"
        " are missing or too many."
        for (number, method), count in sorted(wrong.items())
    ]


def score_mistakes(entry: Entry, protocol: SuiteProtocol) -> Iterator[str]:
    """Yield a sentence for each number of the score, and for the page, that the rows do not show."""
    score = entry_score(entry.rows, protocol)
    stated = entry.manifest["score"]
    for key, own in plain_score(score).items():
        if not same(own, stated.get(key)):
            yield f"The manifest says {key} = {stated.get(key)}, the rows show {own}."
    page = (entry.folder / PAGE).read_text(encoding="utf-8", errors="replace")
    if page != entry_page(entry.name, score, entry.rows, protocol):
        yield "entry.md does not say what the rows show."


def same(value: object, other: object) -> bool:
    """Whether two values are the same, numbers to a relative 1e-9; NaN is NaN."""
    if isinstance(value, float) and isinstance(other, (int, float)):
        return math.isclose(value, other, rel_tol=TOLERANCE) or (math.isnan(value) and math.isnan(other))
    return value == other


def _keys(entry: Entry, protocol: SuiteProtocol) -> Iterator[Key]:
    """Every row that there has to be."""
    for method in (ENTRY, PLAIN):
        settings: dict[str, Setting] = dict.fromkeys([GIVEN, *entry.settings.get(method, {})], ())
        for number, scenario in enumerate(protocol.scenarios):
            for tuned_on in half_settings(settings, scenario.half):
                yield from (Key(method, number, tuned_on, seed) for seed in protocol.seeds_to_test_on)
