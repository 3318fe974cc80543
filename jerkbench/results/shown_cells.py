"""The cells of a study that are shown: of those with the same labels one, or several that are shards of one."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from jerkbench.results.content import Content


class Current(NamedTuple):
    """The cells that are shown.

    Attributes:
        places: of the cells; those of one label follow each other, by their seeds.
        outdated: how many others there are of the same labels.
        overlapping: how many of these differ in nothing but their seeds, some of which are in both.
    """

    places: list[int]
    outdated: int
    overlapping: int


def current(content: Content, order: Mapping[str, int], preferred: Collection[str]) -> Current:
    """Choose the cells that are shown: of the same labels a preferred one, else the newest, with its other shards.

    Args:
        content: all cells.
        order: place of each key in the sweeps; cells that are not in it come last, by their labels.
        preferred: keys that are taken before others.
    """
    places: list[int] = []
    overlapping = 0
    for group in _of_one_name(content, order):
        group.sort(key=lambda place: _rank(content, place, preferred), reverse=True)
        shards, others = _shards(content, group) if len(group) > 1 else (group, 0)
        places += shards
        overlapping += others
    return Current(places, len(content.keys) - len(places), overlapping)


def _of_one_name(content: Content, order: Mapping[str, int]) -> Iterable[list[int]]:
    names = [tuple(cell["labels"].values()) for cell in content.metadata]
    ordered = sorted(range(len(names)), key=lambda place: (order.get(content.keys[place], len(order)), names[place]))
    groups: dict[tuple[str, ...], list[int]] = {}
    for place in ordered:
        groups.setdefault(names[place], []).append(place)
    return groups.values()


def _rank(content: Content, place: int, preferred: Collection[str]) -> tuple[bool, str]:
    return content.keys[place] in preferred, content.metadata[place]["created"]


def _shards(content: Content, group: Sequence[int]) -> tuple[list[int], int]:
    """The first of a group with all that can be joined to it, by their seeds; how many have seeds that are there."""
    shards, overlapping = [group[0]], 0
    seeds = _seeds(content, group[0])
    identity = content.metadata[group[0]].get("identity")
    for place in group[1:]:
        if identity and content.metadata[place].get("identity") == identity:
            own = _seeds(content, place)
            overlapping += not seeds.isdisjoint(own)
            if seeds.isdisjoint(own):
                shards.append(place)
                seeds |= own
    return sorted(shards, key=lambda place: min(_seeds(content, place))), overlapping


def _seeds(content: Content, place: int) -> set[int]:
    return set(content.rows_of(place)["seed"].to_pylist())
