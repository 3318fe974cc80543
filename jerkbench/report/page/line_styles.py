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
    colours = dict(zip(*_numbered(labels_of["filter"] for labels_of in labels.values()), strict=True))
    dashes = dict(zip(*_numbered(labels_of["adaptation"] for labels_of in labels.values()), strict=True))
    return {
        key: {
            "colour": OKABE_ITO[colours[labels_of["filter"]] % len(OKABE_ITO)],
            "dash": list(DASHES[dashes[labels_of["adaptation"]] % len(DASHES)]),
        }
        for key, labels_of in labels.items()
    }


def _numbered(values: Iterable[str]) -> tuple[list[str], range]:
    different = list(dict.fromkeys(values))
    return different, range(len(different))
