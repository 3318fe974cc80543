"""Two studies side by side: whether their cells were measured alike, and which of them lacks what."""

from collections.abc import Iterator, Mapping

from jerkbench.errors import JerkbenchError
from jerkbench.report.analysis.comparison import Combination
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.results.conditions import MEASURED, PARTS, Values, differences
from jerkbench.results.study import Study

METHOD = tuple(part for part in PARTS if part not in MEASURED)
"""Parts that a comparison of two versions may be about."""

Conditions = Mapping[str, Values]


def require_alike(first: Study, second: Study) -> None:
    """Refuse to compare what differs in data, protocol or engine.

    Raises:
        JerkbenchError: which cells do, and in what.
    """
    shared = list(_shared(first, second))
    mixed = [f"In {one.folder}: {words}" for one in (first, second) for words in one.unlike]
    if mixed and not shared:
        raise JerkbenchError(f"{first.folder} and {second.folder} have no combination in common. {' '.join(mixed)}")
    unlike = {name: found for name, a, b in shared if (found := differences(a, b, MEASURED))}
    if not unlike:
        return
    what = " and ".join(dict.fromkeys(one for found in unlike.values() for one in found))
    raise JerkbenchError(
        f"{first.folder} and {second.folder} were not measured alike, so they are not compared: {len(unlike)} of their "
        f"combinations differ in {what}, first {', '.join(next(iter(unlike)))}. Run both with the same."
    )


def other_methods(first: Study, second: Study) -> list[str]:
    """Return a sentence about the parameters of methods that differ although the names are the same."""
    found = [one for _, a, b in _shared(first, second) for one in differences(a, b, METHOD)]
    return [f"A and B differ in {', '.join(dict.fromkeys(found))}."] if found else []


def _shared(first: Study, second: Study) -> Iterator[tuple[Combination, Conditions, Conditions]]:
    """Combinations that both have; a single one of each, whatever they are called."""
    ours, theirs = _keys(first), _keys(second)
    pairs = [(name, ours[name], theirs[name]) for name in ours if name in theirs]
    if not pairs and len(ours) == len(theirs) == 1:
        pairs = [(name, key, other) for (name, key), other in zip(ours.items(), theirs.values(), strict=True)]
    for name, a, b in pairs:
        yield name, first.conditions[a], second.conditions[b]


def _keys(study: Study) -> dict[Combination, str]:
    named = study.rows[[*FACTORS]].astype(str).itertuples(index=False, name=None)
    return dict(zip(named, study.keys, strict=True))
