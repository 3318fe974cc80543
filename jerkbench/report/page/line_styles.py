"""How the lines of a page look: one colour a filter, one kind of dashes an adaptation."""

from collections.abc import Iterable, Mapping
from typing import Any

from jerkbench.report.plots.style import OKABE_ITO

DASHES = ((), (8, 4), (2, 3), (10, 3, 2, 3), (4, 2), (1, 2))
"""Lengths of dashes and gaps, in pixels; the first is a full line."""


def line_styles(labels: Mapping[str, Mapping[str, str]]) -> dict[str, dict[str, Any]]:
    """Return colour and dashes of each cell, by its key.

    Args:
        labels: of each cell, by its key.
    """
    colours = dict(zip(*_numbered(one["filter"] for one in labels.values()), strict=True))
    dashes = dict(zip(*_numbered(one["adaptation"] for one in labels.values()), strict=True))
    return {
        key: {
            "colour": OKABE_ITO[colours[one["filter"]] % len(OKABE_ITO)],
            "dash": list(DASHES[dashes[one["adaptation"]] % len(DASHES)]),
        }
        for key, one in labels.items()
    }


def _numbered(values: Iterable[str]) -> tuple[list[str], range]:
    different = list(dict.fromkeys(values))
    return different, range(len(different))
