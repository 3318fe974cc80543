"""One method of a study, named behind its folder: ``results/a:jerk+mtf``."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jerkbench.errors import JerkbenchError, unknown
from jerkbench.report.analysis.columns import FACTORS, METHOD
from jerkbench.results.study import Study
from jerkbench.results.titles import bare


class Named(NamedTuple):
    """A study's folder, and what was chosen of it.

    Attributes:
        folder: the folder.
        chosen: values of factors; empty: everything.
    """

    folder: Path
    chosen: Mapping[str, str]


def named_study(words: str) -> Named:
    """Read ``FOLDER`` or ``FOLDER:FILTER+ADAPTATION+NOISE``; a word ``FACTOR=VALUE`` names another factor.

    Raises:
        JerkbenchError: there is no such factor, or one is named twice.
    """
    folder, colon, method = words.rpartition(":")
    if not (colon and folder and method) or set(method) & {"/", "\\"} or Path(words).exists():
        return Named(Path(words), {})
    chosen: dict[str, str] = {}
    for position, word in enumerate(method.split("+")):
        factor, equals, value = word.partition("=")
        factor, value = (factor, value) if equals else (_of_position(position, words), word)
        if factor not in FACTORS:
            raise JerkbenchError(unknown("factor", factor, FACTORS))
        if factor in chosen:
            raise JerkbenchError(f"'{words}' names the {factor} twice; name it once.")
        chosen[factor] = value
    return Named(Path(folder), chosen)


def _of_position(position: int, words: str) -> str:
    if position >= len(METHOD):
        raise JerkbenchError(
            f"'{words}' has more words than {', '.join(METHOD)}; write FACTOR=VALUE for another factor."
        )
    return METHOD[position]


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


def named_part(study: Study, names: Sequence[str], factors: Sequence[str]) -> Study:
    """Return the part of a study that has one of some names.

    A name is a label of one of the factors, with its parameters or without, or several of them joined by ``+``.

    Raises:
        JerkbenchError: nothing has one of the names.
    """
    rows = study.rows[[*factors]].astype(str)
    labels = {label: {label, bare(label)} for label in np.unique(rows)}
    fits = np.zeros(len(rows), dtype=bool)
    for name in names:
        of_name = [
            np.any([rows[factor].map(lambda label, one=one: one in labels[label]) for factor in factors], axis=0)
            for one in ([name] if any(name in known for known in labels.values()) else name.split("+"))
        ]
        if not np.all(of_name, axis=0).any():
            raise JerkbenchError(unknown("method" if "filter" in factors else "scenario", name, labels))
        fits |= np.all(of_name, axis=0)
    return study.only(study.keys[fits])


def in_the_place_of(first: Study, second: Study, chosen: tuple[Mapping[str, str], Mapping[str, str]]) -> Study:
    """Return ``second`` with the chosen method called what it is called in ``first``, so that the two are compared.

    Raises:
        JerkbenchError: one has several methods where the other has one.
    """
    factors = [factor for factor in FACTORS if any(factor in of for of in chosen)]
    names = {factor: _only_value(first, factor) for factor in factors}
    for factor in factors:
        _only_value(second, factor)
    return replace(second, rows=second.rows.assign(**names))


def _only_value(study: Study, factor: str) -> str:
    values = sorted(set(study.rows[factor].astype(str)))
    if len(values) > 1:
        raise JerkbenchError(
            f"{study.folder} has {len(values)} values of the {factor}: {', '.join(values)}. Say which one to compare, "
            f"for example {study.folder}:{factor}={values[0]}."
        )
    return values[0]


def told(first: Study, second: Study, chosen: tuple[Mapping[str, str], Mapping[str, str]]) -> list[str]:
    """Return a sentence about what stands for what, where methods were chosen."""
    if not any(chosen):
        return []
    factors = [factor for factor in FACTORS if any(factor in of for of in chosen)]
    a, b = (" + ".join(_only_value(study, factor) for factor in factors) for study in (first, second))
    return [f"{b} of B is compared with {a} of A, and stands under its name."]
