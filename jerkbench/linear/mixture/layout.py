"""Sizes of a mixture; a compilation replaces them by those of the filters at hand."""

from jerkbench.kinematic.layout import S


def sizes(count: int, states: int) -> dict[str, int]:
    """Return the sizes for ``count`` filters with so many states."""
    return {"COUNT": count, "JOINTS": count * count, "MEANS": count * states, "SIXES": 6 * count}


_SIZES = sizes(2, S)
COUNT, JOINTS, MEANS, SIXES = (_SIZES[name] for name in ("COUNT", "JOINTS", "MEANS", "SIXES"))
