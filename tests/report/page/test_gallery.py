"""The figures of a page: as many as there is room for."""

import io

import numpy as np
from PIL import Image

from jerkbench.report import page as room
from jerkbench.report.drawings import Picture
from jerkbench.report.page import gallery


def picture(name, scenario):
    noise = np.random.default_rng(len(name)).integers(0, 255, (60, 60, 3), dtype=np.uint8)
    data = io.BytesIO()
    Image.fromarray(noise).save(data, "png")
    return Picture(name, name, scenario, data.getvalue())


def test_scenarios_without_room_are_named(monkeypatch):
    pictures = [picture("bars", ""), *(picture(f"{name}-tilt", name) for name in ("a", "b", "c"))]
    assert gallery(pictures).left_out == []
    one = len(gallery(pictures).overview[0].data)
    monkeypatch.setattr(room, "ROOM", int(3.5 * one))
    shown = gallery(pictures)
    assert [name for name, _ in shown.scenes] == ["a", "b"]
    assert shown.left_out == ["c"]


def test_what_the_page_shows_in_another_way_is_left_out():
    pictures = [picture("a-errors", "a"), picture("a-tilt", "a")]
    assert [one.caption for one in gallery(pictures, ("errors",)).scenes[0][1]] == ["a-tilt"]
