"""The checks of an adaptation."""

import copy
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.conformance.matrices import require_covariance, require_finite, require_shape
from jerkbench.conformance.methods import require_methods
from jerkbench.conformance.require import require
from jerkbench.conformance.same import identical
from jerkbench.contracts import Fading, Remembering
from jerkbench.memory import empty_memory
from jerkbench.random_streams import stream

ROWS = ((0, 1, 2, 3, 4, 5), (0, 1, 2), (3, 4, 5), (4,), (2,), (0, 1, 4))
"""Rows that may be there."""

SCALES = ((1.0, 1.0), (1.0, 1e-6), (1e-4, 1e12), (1e6, 1e-6))
"""Of H P- H' and of R: ordinary, a tiny R, an R that is all but infinite, a prior that knows nothing."""

SIGMAS = (0.0, 1.0, 1.0, 100.0)
"""Size of the innovation in standard deviations; the last is an outlier."""


class Update(NamedTuple):
    """The input of an adaptation in one update, besides its memory."""

    innovation: FloatArray
    HPHt: FloatArray
    R: FloatArray
    rows: IntArray


def check_adaptation(plugin: Any) -> None:  # noqa: ANN401 - the plugin under test
    """Check an adaptation over updates of all kinds: rows that come and go, outliers, a tiny and a huge R.

    Raises:
        AssertionError: it changes its inputs, keeps anything outside its memory, returns something that is no
            covariance, or leaves NaN in the memory.
    """
    subject = type(plugin).__name__
    require_methods("adaptation", plugin)
    size = plugin.memory_size() if isinstance(plugin, Remembering) else 0
    require(isinstance(size, int), f"{subject}.memory_size() is {size!r}; it must be a whole number.")
    require(size >= 0, f"{subject}.memory_size() is {size}; it must not be negative.")
    updates = list(_updates())
    _require_same(subject, _run(plugin, updates, size), _run(plugin, updates, size))


def probe_adaptation(plugin: Any) -> None:  # noqa: ANN401 - as above
    """Check the same over a few ordinary updates: inputs, memory and shapes, not the numbers.

    Raises:
        AssertionError: it changes its inputs, keeps anything outside its memory, or returns a wrong shape.
    """
    random = stream(0, "conformance", "probe")
    updates = [_update(random, rows, SCALES[0], sigma) for sigma in SIGMAS for rows in (*ROWS[:3], ROWS[0])]
    first, second = (_run(plugin, updates, len(empty_memory(plugin)), thorough=False) for _ in range(2))
    _require_same(type(plugin).__name__, first, second)


def _require_same(subject: str, first: list[Any], second: list[Any]) -> None:
    require(
        identical(first, second),
        f"{subject} gives another result in a second run with the same updates; its state must stand in memory.",
    )


def _updates() -> Iterator[Update]:
    random = stream(0, "conformance", "adaptation")
    for scales in SCALES:
        for sigma in SIGMAS:
            for rows in ROWS:
                yield _update(random, rows, scales, sigma)
    for _ in range(40):  # long enough for every window and every counter
        yield _update(random, ROWS[0], SCALES[0], 100.0)


def _update(random: np.random.Generator, rows: tuple[int, ...], scales: tuple[float, float], sigma: float) -> Update:
    m = len(rows)
    half = random.normal(size=(2, m, 2 * m)) / np.sqrt(2 * m)
    HPHt, R = half @ half.transpose(0, 2, 1) * np.array(scales)[:, None, None]
    R = 0.5 * (R + R.T)
    innovation = sigma * np.sqrt(np.diag(HPHt + R)) * random.choice([-1.0, 1.0], size=m)
    return Update(innovation, 0.5 * (HPHt + HPHt.T), R, np.array(rows))


def _run(plugin: Any, updates: list[Update], size: int, *, thorough: bool = True) -> list[Any]:  # noqa: ANN401 - as above
    """Every factor and every R of a run, checked."""
    memory, results = np.zeros(size), []
    for update in updates:
        factor = _faded(plugin, update, memory)
        faded = update._replace(HPHt=update.HPHt * factor)
        results.append((factor, _adapted(plugin, faded, memory, thorough=thorough).copy()))
        if thorough:
            require_finite(f"the memory of {type(plugin).__name__}", memory)
    return results


def _faded(plugin: Any, update: Update, memory: FloatArray) -> float:  # noqa: ANN401 - as above
    if not isinstance(plugin, Fading):
        return 1.0
    subject = f"{type(plugin).__name__}.fade()"
    factor = float(_untouched(subject, plugin.fade, update, memory))
    require(np.isfinite(factor), f"{subject} is {factor}; the factor on the prior covariance must be finite.")
    require(factor > 0, f"{subject} is {factor}; the factor on the prior covariance must be positive.")
    return factor


def _adapted(plugin: Any, update: Update, memory: FloatArray, *, thorough: bool) -> FloatArray:  # noqa: ANN401 - as above
    subject = f"{type(plugin).__name__}.adapt()"
    m = len(update.rows)
    adapted: FloatArray = _untouched(subject, plugin.adapt, update, memory)
    require_shape(subject, adapted, (m, m))
    if not thorough:
        return adapted
    require(not np.isnan(np.diag(adapted)).any(), f"{subject} has NaN as a variance; infinity drops a row.")
    kept = np.diag(adapted) != np.inf
    require_covariance(subject, adapted[np.ix_(kept, kept)])
    return adapted


def _untouched(subject: str, method: Any, update: Update, memory: FloatArray) -> Any:  # noqa: ANN401 - as above
    before = copy.deepcopy(update)
    result = method(*update, memory)
    for name, old, new in zip(Update._fields, before, update, strict=True):
        require(identical(old, new), f"{subject} changes {name} in place; it must work on a copy.")
    return result
