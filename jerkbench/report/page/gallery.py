"""The figures of a report: those of all rows, then each scenario's behind a fold, as many as the file has room for."""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass

from jerkbench.report.drawings import Picture

ROOM = 600_000
"""Letters that all figures of a page take together: the file stays below 2 MB."""


@dataclass(frozen=True)
class Shown:
    """A figure on the page.

    Attributes:
        caption: what it shows.
        data: the picture, as an address that holds it.
        width: in pixels.
        height: in pixels.
    """

    caption: str
    data: str
    width: int
    height: int


@dataclass(frozen=True)
class Gallery:
    """The figures of a page.

    Attributes:
        overview: those of all rows.
        scenes: name of each scenario, with its figures.
        left_out: scenarios for which there was no room.
    """

    overview: list[Shown]
    scenes: list[tuple[str, list[Shown]]]
    left_out: list[str]


def gallery(pictures: Sequence[Picture], without: Sequence[str] = ()) -> Gallery:
    """Return the figures of a page.

    Args:
        pictures: all that there are.
        without: ends of the names of those that the page shows in another way.
    """
    scenes: dict[str, list[Picture]] = {"": []}
    for picture in pictures:
        if not picture.name.endswith(tuple(f"-{end}" for end in without)):
            scenes.setdefault(picture.scenario, []).append(picture)
    overview = [_shown(picture) for picture in scenes.pop("")]
    room = ROOM - _length(overview)
    shown: list[tuple[str, list[Shown]]] = []
    for name, ones in scenes.items():
        if room <= 0:
            break
        figures = [_shown(picture) for picture in ones]
        room -= _length(figures)
        if room >= 0 or not shown:
            shown.append((name, figures))
    return Gallery(overview, shown, list(scenes)[len(shown) :])


def _length(shown: Sequence[Shown]) -> int:
    return sum(len(picture.data) for picture in shown)


def _shown(picture: Picture) -> Shown:
    """Return a picture as WebP, without a loss: two thirds of a PNG."""
    from PIL import Image

    data = io.BytesIO()
    with Image.open(io.BytesIO(picture.png)) as image:
        image.convert("RGB").save(data, "webp", lossless=True, quality=50, method=3)
        width, height = image.size
    encoded = base64.b64encode(data.getvalue()).decode()
    return Shown(picture.caption, f"data:image/webp;base64,{encoded}", width, height)
