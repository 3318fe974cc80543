"""Whether two results are the same to the bit, and copies to compare with later."""

import copy
import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from jerkbench.conformance.require import require


def same(a: Any, b: Any) -> bool:  # noqa: ANN401 - whatever a plugin takes or returns
    """Return whether ``a`` and ``b`` are equal: dataclasses field by field, arrays to the bit, NaN equal to NaN."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return a.shape == b.shape and a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if dataclasses.is_dataclass(a):
        return all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, dict):
        return list(a) == list(b) and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (tuple, list)):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b) or (a != a and b != b)  # noqa: PLR0124 - only NaN is unequal to itself


def pure_result(what: str, call: Callable[..., Any], *given: Any) -> Any:  # noqa: ANN401 - as above
    """Return ``call(*given)``, called twice.

    Raises:
        AssertionError: it changes what it is given, gives something else the second time, or draws from NumPy's
            global random numbers.
    """
    before, state = copy.deepcopy(given), _global_random_state()
    first = call(*given)
    second = call(*given)
    require(same(before, given), f"{what} changes its input in place; it must work on a copy.")
    require(same(first, second), f"{what} gives another result the second time with the same input.")
    require(
        state == _global_random_state(),
        f"{what} draws from NumPy's global random numbers; they must come from jerkbench.random_streams.stream.",
    )
    return first


def _global_random_state() -> str:
    name, keys, place, *_ = np.random.get_state()  # noqa: NPY002 - it is looked at, not used
    return f"{name} {hash(np.asarray(keys).tobytes())} {place}"
