"""The checks of an adaptation."""

import copy
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.conformance.requirements import (
    Plugin,
    identical,
    require_covariance,
    require_finite,
    require_methods,
    require_shape,
    require_that,
)
from jerkbench.conformance.samples import ROWS, SIGMAS, STATES, Prior, Update, every_kind, ordinary
from jerkbench.contracts import AdaptingGain, AdaptingPrior, Fading, Remembering, RememberingStates
from jerkbench.optional import empty_memory
from jerkbench.random_streams import stream


def check_adaptation(plugin: Plugin) -> None:
    """Check an adaptation over updates of all kinds: rows that come and go, outliers, a tiny and a huge R.

    Raises:
        AssertionError: it changes its inputs, keeps anything outside its memory, returns something that is no
            covariance, or leaves NaN in the memory.
    """
    subject = type(plugin).__name__
    require_methods("adaptation", plugin)
    size = _memory_size(subject, plugin)
    updates = list(every_kind())
    _require_same(subject, _run(plugin, updates, size), _run(plugin, updates, size))


def _memory_size(subject: str, plugin: Plugin) -> int:
    name, size = "memory_size()", 0
    if isinstance(plugin, RememberingStates):
        name, size = f"memory_size_of({STATES})", plugin.memory_size_of(STATES)
    elif isinstance(plugin, Remembering):
        size = plugin.memory_size()
    require_that(isinstance(size, int), f"{subject}.{name} is {size!r}; it must be a whole number.")
    require_that(size >= 0, f"{subject}.{name} is {size}; it must not be negative.")
    return size


def probe_adaptation(plugin: Plugin) -> None:
    """Check the same over a few ordinary updates: inputs, memory, shapes and NaN, no other number.

    Raises:
        AssertionError: it changes its inputs, keeps anything outside its memory, or returns a wrong shape or NaN.
    """
    random = stream(0, "conformance", "probe")
    updates = [ordinary(random, rows, sigma) for sigma in SIGMAS for rows in (*ROWS[:3], ROWS[0])]
    first, second = (_run(plugin, updates, len(empty_memory(plugin, STATES)), thorough=False) for _ in range(2))
    _require_same(type(plugin).__name__, first, second)


def _require_same(subject: str, first: list[Any], second: list[Any]) -> None:
    require_that(
        identical(first, second),
        f"{subject} gives another result in a second run with the same updates; its state must stand in memory.",
    )


def _run(
    plugin: Plugin,
    updates: list[tuple[Update, Prior]],
    size: int,
    *,
    thorough: bool = True,
) -> list[Any]:
    """All that it says in a run, checked."""
    memory, results = np.zeros(size), []
    for update, prior in updates:
        factor = _faded(plugin, update, memory)
        P = _adapted_prior(plugin, prior._replace(P=prior.P * factor), update, memory, thorough=thorough)
        seen = update._replace(HPHt=P[np.ix_(update.rows, update.rows)])
        R = _adapted(plugin, seen, memory, thorough=thorough)
        gain = _adapted_gain(plugin, prior._replace(P=P), update._replace(R=R), memory)
        results.append((factor, P.copy(), R.copy(), gain.copy()))
        if thorough:
            require_finite(f"the memory of {type(plugin).__name__}", memory)
    return results


def _faded(plugin: Plugin, update: Update, memory: FloatArray) -> float:
    if not isinstance(plugin, Fading):
        return 1.0
    subject = f"{type(plugin).__name__}.fade()"
    factor = float(_untouched(subject, plugin.fade, update._asdict(), memory))
    require_that(np.isfinite(factor), f"{subject} is {factor}; the factor on the prior covariance must be finite.")
    require_that(factor > 0, f"{subject} is {factor}; the factor on the prior covariance must be positive.")
    return factor


def _adapted_prior(plugin: Plugin, prior: Prior, update: Update, memory: FloatArray, *, thorough: bool) -> FloatArray:
    if not isinstance(plugin, AdaptingPrior):
        return prior.P
    subject = f"{type(plugin).__name__}.adapt_prior()"
    P: FloatArray = _untouched(subject, plugin.adapt_prior, {**prior._asdict(), **_measured(update)}, memory)
    require_shape(subject, P, (STATES, STATES))
    if thorough:
        require_covariance(subject, P)
    return P


def _adapted_gain(plugin: Plugin, prior: Prior, update: Update, memory: FloatArray) -> FloatArray:
    kept = np.isfinite(np.diag(update.R))
    if not (isinstance(plugin, AdaptingGain) and kept.any()):
        return np.zeros(0)
    subject = f"{type(plugin).__name__}.adapt_gain()"
    few = Update(update.innovation[kept], update.HPHt, update.R[np.ix_(kept, kept)], update.rows[kept])
    K: FloatArray = _untouched(subject, plugin.adapt_gain, {"x": prior.x, "P": prior.P, **_measured(few)}, memory)
    require_shape(subject, K, (STATES, int(kept.sum())))
    require_finite(subject, K)
    return K


def _measured(update: Update) -> dict[str, Any]:
    return {"innovation": update.innovation, "R": update.R, "rows": update.rows}


def _adapted(plugin: Plugin, update: Update, memory: FloatArray, *, thorough: bool) -> FloatArray:
    subject = f"{type(plugin).__name__}.adapt()"
    m = len(update.rows)
    adapted: FloatArray = _untouched(subject, plugin.adapt, update._asdict(), memory)
    require_shape(subject, adapted, (m, m))
    require_that(not np.isnan(np.diag(adapted)).any(), f"{subject} has NaN as a variance; infinity drops a row.")
    if not thorough:
        return adapted
    kept = np.diag(adapted) != np.inf
    require_covariance(subject, adapted[np.ix_(kept, kept)])
    return adapted


def _untouched(subject: str, method: Any, inputs: dict[str, Any], memory: FloatArray) -> Any:  # noqa: ANN401 - as above
    before = copy.deepcopy(inputs)
    result = method(*inputs.values(), memory)
    for name, array in inputs.items():
        require_that(identical(before[name], array), f"{subject} changes {name} in place; it must work on a copy.")
    return result
