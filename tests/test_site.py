"""The documentation's site: it builds without a warning, without the network, with a page and a figure where due."""

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from commands import PATIENCE_S, environment
from jerkbench import plugins

ROOT = Path(__file__).parents[1]
DRAWN = ("disturbance", "adaptation")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    for module in ("mkdocs", "material", "mkdocstrings"):
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"{module} is not installed; pip install 'jerkbench[docs]'")
    built = tmp_path_factory.mktemp("site")
    unreachable = {"http_proxy": "http://127.0.0.1:9", "https_proxy": "http://127.0.0.1:9", "NO_MKDOCS_2_WARNING": "1"}
    here = environment(PYTHONPATH=str(ROOT), **unreachable)
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(built)]
    done = subprocess.run(command, cwd=ROOT, env=here, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")
    return built


@pytest.mark.parametrize("kind", plugins.KINDS)
def test_every_plugin_has_its_page(site, kind):
    for name in plugins.names(kind):
        if not plugins.is_builtin(plugins.get(kind, name)):
            continue
        page = (site / "plugins" / kind / f"{name}.html").read_text(encoding="utf-8")
        assert name in page
        assert (site / "plugins" / kind / f"{name}.png").is_file() == (kind in DRAWN)


def test_pages_have_equations_parameters_escaped_characters_and_the_help_of_commands(site):
    page = (site / "plugins" / "adaptation" / "huber_r.html").read_text(encoding="utf-8")
    assert re.search(r"<code>r_i = r_i max\(1, \|y_i\| / \(k sqrt\(h_i \+ r_i\)\)\)", page)
    assert "<td>k, threshold in standard deviations of the innovation [-].</td>" in page
    assert "<td>0.5 to 5</td>" in page
    assert "Attributes:" not in page
    page = (site / "plugins" / "adaptation" / "mtf.html").read_text(encoding="utf-8")
    assert "With mu = 1, the adapted R satisfies y_i^2 &lt;= S_ii if the test triggers." in page
    page = (site / "adaptive_filters.html").read_text(encoding="utf-8")
    assert page.count('class="arithmatex"') > 20
    assert (site / "katex" / "katex.min.js").is_file()
    assert (site / "katex" / "LICENSE").is_file()
    page = (site / "commands.html").read_text(encoding="utf-8")
    assert all(f'id="{name}"' in page for name in ("run", "table", "tune", "cite"))
    assert "jerkbench run -m experiment=paper" in page


def test_a_page_loads_nothing_from_the_network_and_links_to_copies_of_source_files(site):
    loads = re.compile(r'(?:<script[^>]*src|<link[^>]*rel="(?:stylesheet|icon)"[^>]*href|<img[^>]*src)="https?://')
    assert [page.name for page in site.rglob("*.html") if loads.search(page.read_text(encoding="utf-8"))] == []
    copy = site / "source" / "examples" / "any_language" / "baseline.c.txt"
    assert copy.read_text(encoding="utf-8") == (ROOT / "examples/any_language/baseline.c").read_text(encoding="utf-8")
    assert "source/examples/any_language/baseline.c.txt" in (site / "any_language.html").read_text(encoding="utf-8")


def test_the_search_works_in_a_page_opened_from_a_file(site):
    browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if browser is None:
        pytest.skip("there is no Chromium")
    page = f"file://{site}/plugins/filter/rts.html?q=smoother"
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=20000", "--dump-dom"]
    done = subprocess.run([browser, *options, page], capture_output=True, text=True, timeout=PATIENCE_S, check=True)

    assert re.search(r'md-search-result__meta">[1-9]\d* matching documents', done.stdout)
