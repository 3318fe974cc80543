"""The comparison of two results to the bit, and copies to compare with later."""

import copy
import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from jerkbench.conformance.require import require


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
    require(identical(before, arguments), f"{subject} changes its input in place; it must work on a copy.")
    require(identical(first, second), f"{subject} gives another result the second time with the same input.")
    require(
        state == _global_random_state(),
        f"{subject} draws from NumPy's global random numbers; they must come from jerkbench.random_streams.stream.",
    )
    return first


def _global_random_state() -> str:
    name, keys, place, *_ = np.random.get_state()  # noqa: NPY002 - it is looked at, not used
    return f"{name} {hash(np.asarray(keys).tobytes())} {place}"
