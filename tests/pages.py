"""The pages of docs/ as a reader has them: their commands, their blocks, the files that they say to write."""

import doctest
import re
import shlex
import tomllib
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"


SHORTER = {
    "run": ["dataset.duration_s=60", "seeds=2", "workers=1", "figures=false"],
    "tune": ["dataset.duration_s=60", "trials=2", "tune_seeds=1", "choose_seeds=1", "test_seeds=2", "finalists=1"],
    "figures": ["--methods", "baseline"],
    "report": ["--figures", "none"],
}
"""Words behind those of a page, by verb, with which its commands take less time."""


def text(page):
    """The whole page."""
    return (DOCS / f"{page}.md").read_text(encoding="utf-8")


def blocks(page, language):
    """The content of each block in a language that is no file."""
    return re.findall(rf"(?<!-->\n)```{language}\n(.*?)```", text(page), flags=re.DOTALL)


def lines(page):
    """Every line that is to be typed in a shell."""
    return [line for block in blocks(page, "sh") for line in block.splitlines()]


def commands(page):
    """The words behind `jerkbench` of each line."""
    return [shlex.split(line)[1:] for line in lines(page) if line.startswith("jerkbench ")]


def files(page):
    """The files to write by name: blocks below `<!-- file: NAME -->`."""
    return dict(re.findall(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```", text(page), flags=re.DOTALL))


def outputs(page):
    """What the page shows as the output of a line, by that line: the part between `<!-- output -->` marks below it."""
    marked = r"```sh\n([^`]*)```\n\n<!-- output -->\n(.*?)<!-- /output -->"
    shown = re.findall(marked, text(page), flags=re.DOTALL)
    return {block.splitlines()[-1]: re.sub(r"```\w*\n", "", part) for block, part in shown}


def agree(shown, printed):
    """Whether a command printed what a page shows; `...` in the page stands for anything."""
    want, got = ("".join(f"{line.rstrip()}\n" for line in part.strip().splitlines()) for part in (shown, printed))
    return doctest.OutputChecker().check_output(want, got, doctest.ELLIPSIS)


def install(package):
    """Leave beside a package's module what pip would leave; its folder is then for PYTHONPATH."""
    project = tomllib.loads((package / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    metadata = package / f"{package.name}-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 1.0\n")
    groups = (
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in names.items())
        for group, names in project["entry-points"].items()
    )
    (metadata / "entry_points.txt").write_text("".join(groups))
