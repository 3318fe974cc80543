r"""Untrusted text in the labels of a stored study, which should not be active in any file that a command writes.

    python benchmarks/hostile_labels.py [LABELS]

Each text is written into one label of a combination, into its notes and into the notes of the manifest. Examples of the
texts are HTML, Markdown, LaTeX, spreadsheet formulas, terminal escapes, line separators, direction marks,
interpolations and paths. Commands then write every format. The following content counts as active: a tag, attribute,
address or script that the page of the original study does not contain; a tag, image or link of Markdown; a cell that
starts like a formula; a control word of LaTeX; a character that controls a terminal.
"""

import csv
import io
import json
import os
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from html.parser import HTMLParser
from pathlib import Path

import pyarrow.parquet as pq
from hostile_entries import HangError, hang
from hostile_programs import with_text
from hostile_results import QUIET, SWEEP, answered, sign
from markdown_it import MarkdownIt

from jerkbench.errors import is_plain
from jerkbench.report.labels import Labels

PATIENCE_S = 120
"""A command that takes longer counts as hung."""

SECRET = "xyzzy"  # noqa: S105 - not a password
"""The value of an environment variable that no file may contain."""

TEXTS = (
    "<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "<svg/onload=alert(1)>",
    "</td></table><iframe src=//x>",
    "' onmouseover='alert(1)", "<a href=javascript:alert(1)>x</a>", "</style><style>*{display:none}",
    "--><script>1</script>",
    "<base href=//x>", "<meta http-equiv=refresh content=0;url=//x>", "&lt;script&gt;", "]]><x/>", "{{ 7 * 7 }}",
    "![x](http://x/y.png)", "[x](javascript:alert(1))", "![a][b]", "<http://x.y>", "| a | b |", "`x`<b>", "# head",
    "a\n\n<b>x</b>",
    r"\input{/etc/passwd}", r"\immediate\write18{touch x}", r"$\frac{$", "%}{", "x^^5cinput{y}", "~#&_{}",
    "=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1",
    "\x1b[2J\x1b]0;x\x07", "a\u2028b\u2029c", "\u202egnp.exe\u2066", "${oc.env:STRANGERS_SECRET}", "../../../outside",
)  # fmt: skip
"""37 texts. With six labels, this results in 222 inputs."""

CHARACTERS = ("backslash", "asciitilde", "asciicircum", "less", "greater", "bar", "quotesingle", "quotedbl")
ALLOWED = {f"text{name}" for name in CHARACTERS}
"""Control words of LaTeX that print a character."""

TAGS = frozenset(
    {"script", "img", "iframe", "object", "embed", "base", "meta", "link", "form", "a", "style", "svg", "b"}
)
NUMBER = re.compile(r"[+-]?(\d|inf|nan|\.\d)|[+-]?$")


class Active(HTMLParser):
    """Collects the active content of a page: scripts, addresses, handlers, and tags that load resources.

    Attributes:
        found: number of occurrences of each kind of active content.
    """

    def __init__(self) -> None:
        """Initialise the counter."""
        super().__init__()
        self.found: Counter[str] = Counter()
        self._within = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Count the active content of a tag."""
        self._within = tag
        self.found.update([tag] if tag in TAGS else [])
        for name, value in attrs:
            if name.startswith("on"):
                self.found[f"{tag} {name}"] += 1
            if name in ("src", "href", "action", "data") and not (value or "").startswith(("#", "data:")):
                self.found[f"{tag} {name}={value}"] += 1

    def handle_data(self, data: str) -> None:
        """Count a script or a style."""
        if self._within in ("script", "style"):
            self.found[f"{self._within}: {len(data)} characters"] += 1
        self._within = ""


def active_in(page: str) -> Counter[str]:
    """Return the active content of a page."""
    parser = Active()
    parser.feed(page)
    return parser.found


def html_faults(text: str, clean: str) -> list[str]:
    """Return the active content of a page that the page of the original study does not contain, without scripts."""
    return [
        f"active: {what}" for what in set(active_in(text)) - set(active_in(clean)) if not what.startswith("script:")
    ]


def scripts_of(page: str) -> Counter[str]:
    """Return the scripts of a page."""
    return Counter(what for what in active_in(page).elements() if what == "script" or what.startswith("meta"))


def report_faults(text: str, clean: str) -> list[str]:
    """Return the additional active content of a report, including scripts and refreshes."""
    more = scripts_of(text) - scripts_of(clean)
    return [*html_faults(text, clean), *(f"one more: {what}" for what in more)]


def markdown_faults(text: str, _: str) -> list[str]:
    """Return tags, images and links of Markdown."""
    return [f"active: {what}" for what in active_in(MarkdownIt().enable("table").render(text))]


def csv_faults(text: str, _: str) -> list[str]:
    """Return the cells that start like a formula."""
    cells = (cell for line in csv.reader(io.StringIO(text)) for cell in line)
    return [f"formula: {cell!r}" for cell in cells if cell[:1] in tuple("=+-@\t\r") and not NUMBER.match(cell)]


def latex_faults(text: str, clean: str) -> list[str]:
    """Return the control words that the original table does not contain, and unescaped mathematics."""
    words = set(re.findall(r"\\([a-zA-Z]+)", text)) - set(re.findall(r"\\([a-zA-Z]+)", clean)) - ALLOWED
    loose = "^^" in text or text.replace(r"\$", "").count("$") % 2
    return [f"control word: {word}" for word in words] + (["loose $ or ^^"] if loose else [])


def json_faults(text: str, _: str) -> list[str]:
    """Raise an exception if the text is not valid JSON."""
    json.loads(text)
    return []


FORMATS: Mapping[str, tuple[list[str], Callable[[str, str], list[str]]]] = {
    "terminal": ([], lambda *_: []),
    "md": (["--format", "md"], markdown_faults),
    "csv": (["--format", "csv"], csv_faults),
    "tex": (["--format", "tex"], latex_faults),
    "html": (["--format", "html"], html_faults),
    "json": (["--format", "json"], json_faults),
}
"""Formats of `jerkbench table`: options, and a function that returns the active content of the text."""


def injected(study: Path, text: str, place: int) -> None:
    """Write the text into one label and the notes of the first combination, and into the notes of the manifest."""
    path = min((study / "cells").glob("*.parquet"))
    table = with_text(pq.read_table(path), Labels._fields[place], text)
    key = table["cell.key"][0].as_py()
    sign(path, with_text(table, "cell.notes", json.dumps([text])))
    manifest = study / "manifest.json"
    content = json.loads(manifest.read_text(encoding="utf-8"))
    manifest.write_text(json.dumps(content | {"notes": {key: [text]}}), encoding="utf-8")


class Files:
    """The texts that the commands print or write for a study.

    Attributes:
        texts: text of each file and of each printed output.
        endings: ending of each command.
        longest_s: time of the longest command.
    """

    def __init__(self, study: Path, whole: Path) -> None:
        """Run every command."""
        self.texts: dict[str, str] = {}
        self.endings: dict[str, str] = {}
        self.longest_s = 0.0
        folder = str(study)
        for name, (words, _) in FORMATS.items():
            self.ask(f"table {name}", ["table", folder, *words])
        self.ask("findings", ["table", folder, "--findings", "--all"])
        self.ask("compare md", ["compare", folder, str(whole), "--format", "md"])
        self.ask("cite", ["cite", folder])
        self.ask("report", ["report", folder, "--scenarios", "0"])
        for path in sorted(study.rglob("*")):
            if path.suffix in (".html", ".csv", ".md", ".tex", ".bib", ".svg"):
                self.texts[path.name] = path.read_text(encoding="utf-8")
            self.texts.setdefault("names of files", "")
            self.texts["names of files"] += f"{path.name} "

    def ask(self, name: str, words: list[str]) -> None:
        """Run one command and store its ending and its output."""
        began = time.perf_counter()
        signal.alarm(PATIENCE_S)
        try:
            self.endings[name], self.texts[name] = answered(words)
        except HangError as error:
            self.endings[name], self.texts[name] = f"HangError: {error}", ""
        signal.alarm(0)
        self.longest_s = max(self.longest_s, time.perf_counter() - began)


def faults_of(files: Files, clean: Files) -> list[str]:
    """Return the active content of all files, and the commands that ended with a traceback."""
    found = [f"{name}: {ending}" for name, ending in files.endings.items() if ":" in ending or ending == "?"]
    for name, text in files.texts.items():
        before, kind = clean.texts.get(name, ""), name.removeprefix("table ")
        if name == "compare md" or name.endswith(".md"):
            kind = "md"
        test = report_faults if name.endswith(".html") else FORMATS.get(kind, FORMATS["terminal"])[1]
        if files.endings.get(name, "survived") != "refused":
            found += [f"{name}: {fault}" for fault in test(text, before)]
        found += [f"{name}: control characters"] if not is_plain(text) else []
        found += [f"{name}: the value of the environment variable"] if SECRET in text else []
        found += [f"{name}: a traceback"] if "Traceback" in text else []
    return found


def attack(count: int, place: Path) -> int:
    """Test ``count`` labels, print the faults, and return their number."""
    os.chdir(place)
    os.sched_setaffinity(0, set(list(os.sched_getaffinity(0))[:1]))  # draws the figures in this process
    os.environ["STRANGERS_SECRET"] = SECRET
    signal.signal(signal.SIGALRM, hang)
    answered(["run", "-m", *SWEEP, *QUIET])
    study, copy = place / "results" / "small", place / "deep" / "er" / "copy"
    shutil.copytree(study, copy)
    clean, faults, endings, longest_s = Files(copy, study), 0, Counter[str](), 0.0
    for number in range(count):
        text, label = TEXTS[number // len(Labels._fields) % len(TEXTS)], number % len(Labels._fields)
        shutil.rmtree(copy)
        shutil.copytree(study, copy)
        injected(copy, text, label)
        files = Files(copy, study)
        endings.update(files.endings.values())
        longest_s = max(longest_s, files.longest_s)
        outside = sorted(path.name for path in place.rglob("*") if "outside" in path.name)
        for fault in [*faults_of(files, clean), *outside]:
            faults += 1
            print(f"{text!r} as {Labels._fields[label]}: {fault}"[:400], flush=True)
    print(f"{count} labels, {len(clean.texts)} texts each: {faults} faults; {dict(endings)}; longest {longest_s:.1f} s")
    return faults


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        raise SystemExit(1 if attack(int(sys.argv[1]) if len(sys.argv) > 1 else 222, Path(folder)) else 0)
