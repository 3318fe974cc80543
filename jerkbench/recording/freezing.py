"""The fields of a recording's parts as checked, read-only arrays."""

from typing import Any

from jerkbench.arrays import frozen


def freeze(owner: object, **shapes: tuple[int | None, ...]) -> None:
    """Replace each named field of a frozen dataclass by its checked read-only array."""
    for name, shape in shapes.items():
        value: Any = getattr(owner, name)
        if value is not None:
            object.__setattr__(owner, name, frozen(owner, name, value, shape))
