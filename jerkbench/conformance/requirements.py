"""What a check requires, and its report as JUnit XML."""

import copy
import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import FrozenInstanceError
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Estimator, Filter
from jerkbench.errors import article
from jerkbench.optional import REQUIRED

Plugin = Any
"""A plugin of any kind, which is asked what it is."""


class Unfit(AssertionError):  # noqa: N818 - pytest shows an assertion's sentence best
    """Something that a plugin promises and does not keep; other assertions are the plugin's own."""


def require_that(ok: object, sentence: str) -> None:
    """Raise an `Unfit` with ``sentence`` unless ``ok``; unlike `assert` also under ``python -O``."""
    if not ok:
        raise Unfit(sentence)


def changes_itself(plugin: object, error: FrozenInstanceError) -> str:
    """Return the sentence about a plugin that sets an attribute of its own while it runs."""
    name = str(error).rpartition(" ")[2].strip("'")
    return (
        f"{type(plugin).__name__} sets self.{name} while it runs, but a plugin never changes; what an adaptation keeps"
        " from one update to the next stands in memory, all else in local variables."
    )


# The comparison of two results to the bit, and copies to compare with later.


def identical(a: Any, b: Any) -> bool:  # noqa: ANN401 - whatever a plugin takes or returns
    """Return whether ``a`` and ``b`` are equal: dataclasses field by field, arrays to the bit, NaN equal to NaN."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return a.shape == b.shape and a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if dataclasses.is_dataclass(a):
        return all(identical(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, dict):
        return list(a) == list(b) and all(identical(a[key], b[key]) for key in a)
    if isinstance(a, (tuple, list)):
        return len(a) == len(b) and all(map(identical, a, b))
    return bool(a == b) or (a != a and b != b)  # noqa: PLR0124 - only NaN is unequal to itself


def pure_result(subject: str, call: Callable[..., Any], *arguments: Any) -> Any:  # noqa: ANN401 - as above
    """Return ``call(*arguments)``, called twice.

    Raises:
        AssertionError: it changes its arguments, gives another result the second time, or draws from NumPy's
            global random numbers.
    """
    before, state = copy.deepcopy(arguments), _global_random_state()
    first = call(*arguments)
    second = call(*arguments)
    require_that(identical(before, arguments), f"{subject} changes its input in place; it must work on a copy.")
    require_that(identical(first, second), f"{subject} gives another result the second time with the same input.")
    require_that(
        state == _global_random_state(),
        f"{subject} draws from NumPy's global random numbers; they must come from jerkbench.random_streams.stream.",
    )
    return first


def _global_random_state() -> str:
    name, keys, place, *_ = np.random.get_state()  # noqa: NPY002 - it is looked at, not used
    return f"{name} {hash(np.asarray(keys).tobytes())} {place}"


# Checks of arrays: shape, finite, covariance.

TOLERANCE = 1e-8
"""Of symmetry and of eigenvalues, with the diagonal scaled to one."""


def require_shape(
    subject: str,
    array: Any,  # noqa: ANN401 - what a plugin returned
    shape: tuple[int, ...],
) -> None:
    """Raise an AssertionError unless ``array`` is a float64 array of ``shape``."""
    require_that(isinstance(array, np.ndarray), f"{subject} is a {type(array).__name__}; it must be a NumPy array.")
    require_that(array.dtype == np.float64, f"{subject} is of {array.dtype}; it must be float64.")
    require_that(array.shape == shape, f"{subject} has shape {array.shape}; it must be {shape}.")


def require_finite(subject: str, array: FloatArray) -> None:
    """Raise an AssertionError where ``array`` holds NaN or infinity."""
    require_that(np.isfinite(array).all(), f"{subject} holds NaN or infinity.")


def require_covariance(subject: str, matrix: FloatArray) -> None:
    """Raise an AssertionError unless ``matrix`` is finite, symmetric and positive semidefinite."""
    require_finite(subject, matrix)
    variances = np.diag(matrix)
    require_that((variances >= 0).all(), f"{subject} has a negative variance, {variances.min(initial=0.0):.3g}.")
    sigma = np.sqrt(np.where(variances > 0, variances, 1.0))
    scaled = matrix / np.outer(sigma, sigma)
    require_that(np.abs(scaled - scaled.T).max(initial=0.0) <= TOLERANCE, f"{subject} is not symmetric.")
    lowest = np.linalg.eigvalsh(scaled).min(initial=0.0)
    require_that(
        lowest >= -TOLERANCE * len(matrix), f"{subject} is not positive semidefinite (eigenvalue {lowest:.3g})."
    )


# The methods and attributes that a plugin of each kind cannot do without.


def require_methods(kind: str, plugin: Plugin) -> None:
    """Check that ``plugin`` has the methods of its ``kind``; a filter those of one of the two sorts.

    Raises:
        AssertionError: one is not there.
    """
    subject = type(plugin).__name__
    sorts = {kind: REQUIRED[kind][0]} if kind != "filter" else {"kinematic filter": Filter, "estimator": Estimator}
    having = [sort for sort, contract in sorts.items() if kind != "filter" or hasattr(plugin, _methods(contract)[0])]
    require_that(having, f"{subject} has neither axis_model() nor estimate(); it needs one of them.")
    sort = having[0]
    for name in _methods(sorts[sort]):
        has = callable(getattr(plugin, name, None))
        require_that(
            has, f"{subject} has no method {name}(); {article(sort)} {sort} needs it (see jerkbench.contracts)."
        )
    if sort in ("dataset", "disturbance"):
        seeded = getattr(plugin, "seeded", None)
        require_that(isinstance(seeded, bool), f"{subject}.seeded is {seeded!r}; it must be True or False.")
    if sort == "estimator":
        require_that(
            hasattr(plugin, "adaptations"), f"{subject} has no adaptations; it must name those that it accepts."
        )


def _methods(contract: type) -> list[str]:
    return [name for name, value in vars(contract).items() if callable(value) and not name.startswith("_")]


# Results of checks as JUnit XML, which machines that build software read.


class JunitCase(NamedTuple):
    """One thing that was checked.

    Attributes:
        group: what it belongs to.
        name: of it.
        failures: sentences; none: it went well.
        remarks: sentences that are no failure.
    """

    group: str
    name: str
    failures: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


def junit(suite: str, cases: Sequence[JunitCase]) -> str:
    """Return the text of a JUnit file with one suite."""
    failed = sum(bool(case.failures) for case in cases)
    root = ET.Element("testsuite", name=suite, tests=str(len(cases)), failures=str(failed), errors="0")
    for case in cases:
        element = ET.SubElement(root, "testcase", classname=case.group, name=case.name)
        for sentence in case.failures:
            ET.SubElement(element, "failure", message=sentence).text = sentence
        if case.remarks:
            ET.SubElement(element, "system-out").text = "\n".join(case.remarks)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"
