"""Text of strangers stays text: in spreadsheets, in Markdown, in a terminal and in a page."""

import base64
import hashlib
import re

import pandas as pd
import pytest

from commands import SHORT, verb
from jerkbench.errors import PluginError, plain
from jerkbench.files import write_text
from jerkbench.presets import _VARIABLES_ALLOWED, environment_variable
from jerkbench.report.writers import csv_text, inert, latex_escaped, markdown_grid, policy, write_rows_csv


@pytest.mark.parametrize("text", ["=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1", "\r=1"])
def test_a_cell_is_no_formula(text):
    assert inert(text) == f"'{text}"
    assert csv_text(text).startswith("'")


@pytest.mark.parametrize("text", ["-1", "-1.5e-3", "+2", "-inf", "-", "", "jerk", "a=b"])
def test_numbers_and_names_stay_as_they_are(text):
    assert csv_text(text) == text


@pytest.mark.parametrize(
    "text",
    [
        "<script>x</script>",
        r"\<img src=x>",
        "![a](http://x/y.png)",
        "![a[b]](http://x)",
        "[a](javascript:x)",
        "![a][b]",
    ],
)
def test_markdown_shows_tags_images_and_links_as_text(text):
    markdown_it = pytest.importorskip("markdown_it")
    page = markdown_it.MarkdownIt().enable("table").render(markdown_grid("title", ["name"], [[text]], [text]))
    assert not re.search("<(script|img|a) ?", page)


def test_files_latex_and_pages_hold_nothing_that_steers_or_ends_a_line(tmp_path):
    assert plain("a\u2028b\u2029") == r"a\u2028b\u2029"
    write_text(tmp_path / "page.html", "a\u2028b\u202e\x1b[2J\tc\n")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == "a\\u2028b\\u202e\\x1b[2J\tc\n"
    write_rows_csv(pd.DataFrame({"filter": ["a\u2028b", "=1"], "x\x1b": [1.0, 2.0]}), tmp_path / "rows.csv")
    assert (tmp_path / "rows.csv").read_text(encoding="utf-8") == "filter,x\\x1b\na\\u2028b,1.0\n'=1,2.0\n"
    assert latex_escaped("a\x1b\u202e") == r"a\textbackslash{}x1b\textbackslash{}u202e"
    digest = base64.b64encode(hashlib.sha256(b"own()").digest()).decode()
    assert f"default-src 'none'; script-src 'sha256-{digest}';" in policy(["own()"])


def test_the_environment_is_read_on_request_only(tmp_path, monkeypatch):
    monkeypatch.setenv("A_SECRET", "xyzzy")
    words = ("run", *SHORT, "engine=filterpy", "notes=['${oc.env:A_SECRET}']", "--dry")
    done = verb(*words, cwd=tmp_path)
    assert done.returncode == 2
    assert "A_SECRET" in done.stderr
    assert "xyzzy" not in done.stdout + done.stderr
    monkeypatch.setenv(_VARIABLES_ALLOWED, "A_SECRET")
    assert verb(*words, cwd=tmp_path).returncode == 0


@pytest.mark.parametrize("word", ["+foo=1", "++foo=1", "+x={a:1}", "+noise.foo=1", "++noise.foo=1", "+cluster.foo=2"])
@pytest.mark.parametrize("mode", [[], ["-m"]])
def test_an_option_that_there_is_not_cannot_be_added(tmp_path, word, mode):
    done = verb("run", *mode, *SHORT, word, "--dry", cwd=tmp_path)
    assert done.returncode == 2
    assert "There is no option" in done.stderr


@pytest.mark.parametrize(
    ("words", "printed"),
    [([], "usage: jerkbench"), (["help"], "usage: jerkbench"), (["help", "table"], "usage: jerkbench table"),
     (["help", "run"], "jerkbench run [-m]")],
)  # fmt: skip
def test_help_is_printed(tmp_path, words, printed):
    done = verb(*words, cwd=tmp_path)
    assert done.returncode == 0
    assert printed in done.stdout


def test_a_named_variable_that_is_not_set_is_no_text(monkeypatch):
    monkeypatch.setenv("JERKBENCH_ENV", "NOT_SET")
    monkeypatch.delenv("NOT_SET", raising=False)

    with pytest.raises(PluginError, match="NOT_SET, which is not set"):
        environment_variable("NOT_SET")
    assert environment_variable("NOT_SET", None) is None
    assert environment_variable("NOT_SET", "data") == "data"
