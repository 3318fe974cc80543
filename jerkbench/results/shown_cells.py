"""The cells of a study that are shown: of those with the same labels one."""

from collections.abc import Collection, Iterable, Mapping
from typing import NamedTuple

from jerkbench.results.content import Content


class Current(NamedTuple):
    """The cells that are shown.

    Attributes:
        places: of the cells.
        outdated: how many others there are of the same labels.
        others: how many runs there are of the stored cells besides, with seeds that are not shown.
    """

    places: list[int]
    outdated: int
    others: int


def current(content: Content, order: Mapping[str, int], preferred: Collection[str]) -> Current:
    """Choose the cells that are shown: of the same labels a preferred one, else the newest.

    Args:
        content: all cells.
        order: place of each key in the sweeps; cells that are not in it come last, by their labels.
        preferred: keys that are taken before others.
    """
    groups = _of_one_name(content, order)
    places = [max(group, key=lambda place: _rank(content, place, preferred)) for group in groups]
    return Current(places, len(content.keys) - len(places), content.others)


def _of_one_name(content: Content, order: Mapping[str, int]) -> Iterable[list[int]]:
    names = [tuple(cell["labels"].values()) for cell in content.metadata]
    ordered = sorted(range(len(names)), key=lambda place: (order.get(content.keys[place], len(order)), names[place]))
    groups: dict[tuple[str, ...], list[int]] = {}
    for place in ordered:
        groups.setdefault(names[place], []).append(place)
    return groups.values()


def _rank(content: Content, place: int, preferred: Collection[str]) -> tuple[bool, str]:
    return content.keys[place] in preferred, content.metadata[place]["created"]
