"""The page for everybody: axe-core finds nothing serious, and nothing is wider than the screen.

Of another report than the small one that is made here: ``JERKBENCH_REPORT=report.html AXE_CORE=axe.min.js pytest ...``.
"""

import os
from pathlib import Path

import pytest

AXE_S = 300
"""The page of a large study takes 5 s; a busy machine is no finding."""

SCREENS = [(width, scheme) for width in (1400, 400) for scheme in ("light", "dark")]


@pytest.fixture
def report(request):
    given = os.environ.get("JERKBENCH_REPORT")
    return Path(given).resolve() if given else request.getfixturevalue("sweep")[0] / "report.html"


@pytest.fixture(params=SCREENS, ids=str)
def screen(request, opened):
    width, scheme = request.param
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    opened.refresh()
    return opened


@pytest.mark.slow
def test_nothing_is_wider_than_the_screen_and_no_column_is_cut(screen):
    page = "return [document.documentElement.scrollWidth, innerWidth]"
    width, room = screen.execute_script(page)
    assert width <= room
    tables = "return [...document.querySelectorAll('.wide')].map((one) => [one.scrollWidth, one.clientWidth])"
    assert all(width <= room for width, room in screen.execute_script(tables))


@pytest.mark.slow
def test_axe_finds_nothing_serious(screen):
    path = os.environ.get("AXE_CORE", "")
    if not path:
        pytest.skip("AXE_CORE does not name axe.min.js (npm pack axe-core)")
    screen.set_script_timeout(AXE_S)
    screen.execute_script(Path(path).read_text(encoding="utf-8"))
    checks = (
        "const done = arguments[0];"
        "axe.run(document, { resultTypes: ['violations'] }).then(({ violations, passes }) =>"
        " done([violations.map((one) => [one.impact, one.id, one.nodes[0].html]), passes.length]));"
    )
    violations, passes = screen.execute_async_script(checks)
    assert passes > 10
    assert [one for one in violations if one[0] in {"serious", "critical"}] == []


PAGE_PX = 1047
"""Height of the text on A4, as Chromium prints it."""


@pytest.mark.slow
def test_on_paper_the_table_stands_before_the_details_and_each_figure_fits_a_page(opened):
    a4 = {"width": 718, "height": PAGE_PX, "deviceScaleFactor": 1, "mobile": False}
    opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", a4)
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    opened.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    measured = (
        "const top = (id) => document.getElementById(id).getBoundingClientRect().top;"
        "const open = [...document.querySelectorAll('main details[open]')];"
        "return [top('section-table'), open.map((one) => one.getBoundingClientRect().top),"
        " [...document.querySelectorAll('figure')].map((one) => one.getBoundingClientRect().height),"
        " document.querySelectorAll('#section-findings details:not([open])').length]"
    )
    table, details, figures, closed = opened.execute_script(measured)
    assert closed == 0
    assert details
    assert all(table < top for top in details)
    assert len(figures) > 4
    assert all(0 < height < PAGE_PX for height in figures)
