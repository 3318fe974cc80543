"""The comparability of two studies: conditions that differ, and combinations that one of them lacks."""

from collections.abc import Iterator, Mapping

from jerkbench.errors import NotComparableError
from jerkbench.report.analysis.columns import FACTORS
from jerkbench.report.analysis.runs import Combination
from jerkbench.results.conditions import MEASURED, PARTS, Values, differing_conditions
from jerkbench.results.study import Study

METHOD = tuple(part for part in PARTS if part not in MEASURED)
"""Parts that a comparison of two versions may be about."""

Conditions = Mapping[str, Values]


def require_alike(first: Study, second: Study) -> None:
    """Refuse to compare what differs in data, protocol or engine.

    Raises:
        NotComparableError: which cells do, and in what.
    """
    shared = list(_shared(first, second))
    mixed = [f"In {study.folder}: {words}" for study in (first, second) for words in study.unlike]
    if mixed and not shared:
        raise NotComparableError(f"{first.folder} and {second.folder} have no combination in common. {' '.join(mixed)}")
    unlike = {name: differing for name, a, b in shared if (differing := differing_conditions(a, b, MEASURED))}
    if not unlike:
        return
    conditions = " and ".join(dict.fromkeys(name for names in unlike.values() for name in names))
    raise NotComparableError(
        f"{first.folder} and {second.folder} were not measured alike, so they are not compared: {len(unlike)} of their "
        f"combinations differ in {conditions}, first {', '.join(next(iter(unlike)))}. Run both with the same."
    )


def other_methods(first: Study, second: Study) -> list[str]:
    """Return a sentence about the parameters of methods that differ although the names are the same."""
    names = [name for _, a, b in _shared(first, second) for name in differing_conditions(a, b, METHOD)]
    return [f"A and B differ in {', '.join(dict.fromkeys(names))}."] if names else []


def _shared(first: Study, second: Study) -> Iterator[tuple[Combination, Conditions, Conditions]]:
    """Combinations that both have; a single one of each, whatever they are called."""
    first_keys, second_keys = _keys(first), _keys(second)
    pairs = [(name, first_keys[name], second_keys[name]) for name in first_keys if name in second_keys]
    if not pairs and len(first_keys) == len(second_keys) == 1:
        (name, key), (second_key,) = *first_keys.items(), second_keys.values()
        pairs = [(name, key, second_key)]
    for name, a, b in pairs:
        yield name, first.conditions[a], second.conditions[b]


def _keys(study: Study) -> dict[Combination, str]:
    named = study.rows[[*FACTORS]].astype(str).itertuples(index=False, name=None)
    return dict(zip(named, study.keys, strict=True))
