"""The part of the report with the figures: those of all rows, then each scenario's behind a fold."""

import base64
from collections.abc import Sequence
from html import escape

from jerkbench.report.page.text import fold
from jerkbench.report.plots.picture import Picture


def gallery(pictures: Sequence[Picture]) -> str:
    """Return the figures; the first scenario's are open."""
    if not pictures:
        return "<p>None was drawn.</p>"
    scenes: dict[str, list[Picture]] = {}
    for one in pictures:
        scenes.setdefault(one.scenario, []).append(one)
    overview = "".join(_figure(one, "whole") for one in scenes.pop("", []))
    folds = [_fold(name, ones, opened=k == 0) for k, (name, ones) in enumerate(scenes.items())]
    return overview + "\n".join(folds)


def _fold(scenario: str, pictures: Sequence[Picture], *, opened: bool) -> str:
    pairs = f'<div class="pair">{"".join(map(_figure, pictures))}</div>'
    return fold(f"{scenario} ({len(pictures)} figures)", pairs, opened=opened)


def _figure(picture: Picture, style: str = "") -> str:
    encoded = base64.b64encode(picture.png).decode()
    text = escape(picture.caption)
    return (
        f'<figure class="{style}"><img loading="lazy" src="data:image/png;base64,{encoded}" alt="{text}">'
        f"<figcaption>{text}</figcaption></figure>"
    )
