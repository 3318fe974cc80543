"""The models of all lengths of a step, each made once by the plugin."""

from collections.abc import Hashable, Sequence
from functools import cache, lru_cache
from typing import NamedTuple, cast

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.contracts import Filter
from jerkbench.kinematic.arguments import Model
from jerkbench.optional import axis_models


def model_of(models: Sequence[Filter], lengths_s: FloatArray, dt0_s: float) -> Model:
    """Ask the filter of each run for A, b, Q of each length, and for the start; all have as many states."""
    arrays = [_arrays_of(model, lengths_s.tobytes(), dt0_s) for model in models]
    shared = all(model is models[0] or model == models[0] for model in models)
    A, b, Q = (np.stack(parts[:1] if shared else parts, axis=-1) for parts in list(zip(*arrays, strict=True))[:3])
    extra = np.stack([own.extra for own in arrays], axis=-1)
    return Model(A, b, Q, extra, all(own.triangular for own in arrays))


class _Arrays(NamedTuple):
    """A (k, n n), b (k, n), Q (k, n n), initial variances (n - 2,), and as in `Model`."""

    A: FloatArray
    b: FloatArray
    Q: FloatArray
    extra: FloatArray
    triangular: bool


def _arrays_of(model: Filter, lengths_s: bytes, dt0_s: float) -> _Arrays:
    """Ask a filter; one that cannot change is asked once."""
    params = getattr(model, "__dataclass_params__", None)
    frozen = params is not None and params.frozen
    return _known(cast("Hashable", model), lengths_s, dt0_s) if frozen else _asked(model, lengths_s, dt0_s)


def _asked(model: Filter, lengths_s: bytes, dt0_s: float) -> _Arrays:
    """Ask for the arrays of each length; of one that is not positive A is the identity."""
    extra, lengths = np.array(model.initial_variances(), dtype=np.float64), np.frombuffer(lengths_s)
    A, b, Q = axis_models(model, lengths, dt0_s)
    k, n = b.shape
    return _Arrays(A.reshape(k, n * n), b, Q.reshape(k, n * n), extra, triangular(A))


@lru_cache(maxsize=32)  # even steps: the same for all packs; uneven ones: each seed has its own, for all adaptations
def _known(model: Hashable, lengths_s: bytes, dt0_s: float) -> _Arrays:
    return _asked(cast("Filter", model), lengths_s, dt0_s)


def triangular(A: FloatArray) -> bool:
    """Whether each of (k, n, n) is upper triangular with ones on its diagonal."""
    (rows, columns), identity = _lower(A.shape[1])
    return bool((A[:, rows, columns] == identity).all())


@cache
def _lower(n: int) -> tuple[tuple[IntArray, ...], FloatArray]:
    """Where the lower triangle is, and what the identity has there."""
    below = np.tril_indices(n)
    return below, np.eye(n)[below]
