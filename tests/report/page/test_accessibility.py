"""The page for everybody: axe-core finds nothing serious, and nothing is wider than the screen."""

import os
from pathlib import Path

import pytest

SCREENS = [(width, scheme) for width in (1400, 400) for scheme in ("light", "dark")]


@pytest.fixture(params=SCREENS, ids=str)
def screen(request, opened):
    width, scheme = request.param
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    opened.refresh()
    yield opened
    opened.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_nothing_is_wider_than_the_screen_and_no_column_is_cut(screen):
    page = "return [document.documentElement.scrollWidth, innerWidth]"
    width, room = screen.execute_script(page)
    assert width <= room
    tables = "return [...document.querySelectorAll('.wide, .scroll')].map((one) => [one.scrollWidth, one.clientWidth])"
    assert all(width <= room for width, room in screen.execute_script(tables))


def test_axe_finds_nothing_serious(screen):
    path = os.environ.get("AXE_CORE", "")
    if not path:
        pytest.skip("AXE_CORE does not name axe.min.js (npm pack axe-core)")
    screen.execute_script(Path(path).read_text(encoding="utf-8"))
    checks = (
        "const done = arguments[0];"
        "axe.run(document).then(({ violations, passes }) => done([violations.map((one) => "
        "[one.impact, one.id, one.nodes[0].html]), passes.length]));"
    )
    violations, passes = screen.execute_async_script(checks)
    assert passes > 10
    assert [one for one in violations if one[0] in {"serious", "critical"}] == []
