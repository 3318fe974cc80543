"""A part of a study, selected by names (``results/a:jerk+mtf``), and whether two studies can be compared."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from jerkbench.errors import JerkbenchError, NotComparableError, unknown
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.jobs.study import Study
from jerkbench.renamed import new_label
from jerkbench.report.columns import FACTORS, METHOD, require_factors
from jerkbench.report.conditions import (
    DECIDING_SCORES,
    LABELLED_PARTS,
    Conditions,
    conditions,
    differing_conditions,
)

COMPARED = tuple(part for part in LABELLED_PARTS if part not in DECIDING_SCORES)
"""Parts in which two studies that are compared may differ."""


def named_study(words: str) -> tuple[Path, Mapping[str, str]]:
    """Read ``FOLDER`` or ``FOLDER:FILTER+ADAPTATION+NOISE``; a word ``FACTOR=VALUE`` names another factor.

    Returns:
        The folder, and values of factors; without any, everything is meant.

    Raises:
        JerkbenchError: there is no such factor, or one is named twice.
    """
    folder, colon, method = words.rpartition(":")
    if not (colon and folder and method) or set(method) & {"/", "\\"} or Path(words).exists():
        return Path(words), {}
    chosen: dict[str, str] = {}
    for position, word in enumerate(method.split("+")):
        factor, equals, value = word.partition("=")
        if not equals:
            if position >= len(METHOD):
                raise JerkbenchError(
                    f"'{words}' has more words than {', '.join(METHOD)}; write FACTOR=VALUE for another factor."
                )
            factor, value = METHOD[position], word
        require_factors([factor])
        if factor in chosen:
            raise JerkbenchError(f"'{words}' names the {factor} twice; name it once.")
        chosen[factor] = new_label(factor, value)
    return Path(folder), chosen


def selected(study: Study, chosen: Mapping[str, str]) -> Study:
    """Return the part of a study with these values.

    Raises:
        JerkbenchError: it has no such value, or not with the others.
    """
    for factor, value in chosen.items():
        values = study.rows[factor].astype(str)
        if value not in set(values):
            raise JerkbenchError(f"{study.folder}: {unknown(factor, value, sorted(set(values)))}")
        study = study.only(study.keys[(values == value).to_numpy()])
    return study


def in_the_place_of(first: Study, second: Study, chosen: Mapping[str, str]) -> tuple[Study, list[str]]:
    """Return ``second`` with the chosen method called what it is called in ``first``, and a sentence about it.

    Args:
        first: a study.
        second: what is compared with it.
        chosen: values of factors in either; empty: no method was chosen.

    Raises:
        JerkbenchError: one has several methods where the other has one.
    """
    factors = [factor for factor in FACTORS if factor in chosen]
    names, own = ({factor: _only_value(study, factor) for factor in factors} for study in (first, second))
    a, b = (" + ".join(several.values()) for several in (names, own))
    told = [f"{b} of B is compared with {a} of A, and stands under its name."] if chosen else []
    return replace(second, rows=second.rows.assign(**names)), told


def _only_value(study: Study, factor: str) -> str:
    values = sorted(set(study.rows[factor].astype(str)))
    if len(values) > 1:
        raise JerkbenchError(
            f"{study.folder} has {len(values)} values of the {factor}: {', '.join(values)}. Say which one to compare, "
            f"for example {study.folder}:{factor}={values[0]}."
        )
    return values[0]


def require_alike(first: Study, second: Study) -> None:
    """Refuse to compare what differs in data, protocol or engine.

    Raises:
        NotComparableError: which cells do, and in what.
    """
    shared = list(_shared(first, second))
    mixed = [f"In {study.folder}: {words}" for study in (first, second) for words in study.unlike]
    if mixed and not shared:
        raise NotComparableError(f"{first.folder} and {second.folder} have no combination in common. {' '.join(mixed)}")
    unlike = {name: differing for name, a, b in shared if (differing := differing_conditions(a, b, DECIDING_SCORES))}
    if not unlike:
        return
    conditions = " and ".join(dict.fromkeys(name for names in unlike.values() for name in names))
    raise NotComparableError(
        f"{first.folder} and {second.folder} were not measured alike, so they are not compared: {len(unlike)} of their "
        f"combinations differ in {conditions}, first {', '.join(next(iter(unlike)))}. Run both with the same."
    )


def other_methods(first: Study, second: Study) -> list[str]:
    """Return a sentence about the parameters of methods that differ although the names are the same."""
    names = [name for _, a, b in _shared(first, second) for name in differing_conditions(a, b, COMPARED)]
    return [f"A and B differ in {', '.join(dict.fromkeys(names))}."] if names else []


def _shared(first: Study, second: Study) -> Iterator[tuple[Combination, Conditions, Conditions]]:
    """Combinations that both have; a single one of each, whatever they are called."""
    first_keys, second_keys = _keys(first), _keys(second)
    pairs = [(name, first_keys[name], second_keys[name]) for name in first_keys if name in second_keys]
    if not pairs and len(first_keys) == len(second_keys) == 1:
        (name, key), (second_key,) = *first_keys.items(), second_keys.values()
        pairs = [(name, key, second_key)]
    for name, a, b in pairs:
        yield name, conditions(first.metadata[a]), conditions(second.metadata[b])


def _keys(study: Study) -> dict[Combination, str]:
    named = study.rows[[*FACTORS]].astype(str).itertuples(index=False, name=None)
    return dict(zip(map(Combination._make, named), study.keys, strict=True))
