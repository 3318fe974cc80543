"""The studies of the repository: their rows, their pages, and the commands of their READMEs."""

import contextlib
import io
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

import pytest

from commands import verb
from jerkbench.jobs.store import RowBlock, Store
from jerkbench.jobs.study import load_study
from jerkbench.report.columns import varying_factors
from jerkbench.report.findings import finding, study_verdicts
from stored_cells import about, put, row, write_blocks

ROOT = Path(__file__).parents[1]
PARTS = "results/*/cells/part-*.parquet"


def kept_studies():
    """Those of the repository: what a user has run beside them is not kept. Without git, all that are there."""
    if (git := shutil.which("git")) and (ROOT / ".git").exists():
        listed = subprocess.check_output([git, "ls-files", "--", PARTS], cwd=ROOT, text=True)
        return sorted({(ROOT / line).parents[1] for line in listed.splitlines()})
    return sorted({path.parents[1] for path in ROOT.glob(PARTS)})


KEPT = kept_studies()


def require_answers(study, folder, formats):
    """Run the commands that need no run and no figure."""
    for words in formats:
        done = verb("table", study, *words.split(), cwd=folder)
        assert done.returncode == 0, done.stderr
        assert "damaged" not in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("study", KEPT, ids=lambda path: path.name)
def test_a_kept_study_is_whole_and_names_no_folder_of_one_machine(study, tmp_path):
    copy = shutil.copytree(study, tmp_path / study.name)
    assert len(list((copy / "cells").iterdir())) == 1
    cells, damaged = Store(copy).read()
    assert damaged == []
    assert len(set(load_study(copy).keys)) == len(cells) > 0
    for cell in cells:
        assert not Path(cell.metadata["spec"]["dataset"].get("folder", "")).is_absolute()
    assert "=/" not in (study / "manifest.json").read_text(encoding="utf-8")


def test_a_compacted_study_has_the_same_rows_in_one_file_and_answers(tmp_path):
    study = tmp_path / "study"
    for key, rmse_m, name in (("a", 0.5, "jerk"), ("b", 0.25, "baseline"), ("b", 0.25, "baseline")):
        put(study, key, rmse_m, filter=name, seeds=8)
    write_blocks(Store(study), [RowBlock("c", 2, [row()], about())])  # a cell that was begun
    before, known = load_study(study), Store(study).known("abc")
    Store(study).compact()

    (path,) = (study / "cells").iterdir()
    after = load_study(study)
    assert before.rows.equals(after.rows)
    assert list(before.keys) == list(after.keys)
    assert Store(study).known("abc") == known
    require_answers(study, tmp_path, ("", "--findings", "--format csv"))
    assert verb("compare", study, study, cwd=tmp_path).returncode == 0
    path.write_bytes(path.read_bytes()[:-1])
    assert Store(study).read() == ([], [path.stem])


def page(study):
    return (ROOT / "experiments" / study / "README.md").read_text(encoding="utf-8")


def test_what_the_page_of_the_paper_quotes_is_said_by_the_rows():
    """Compared with every comparison of the study's family, as either side sees it, and "equal" in either order."""
    rows = load_study(ROOT / "results" / "paper20").rows
    varying = varying_factors(rows)
    judged = study_verdicts(rows, "position_rmse_m").judged.values()
    sentences = "\n".join(finding(seen, varying) for own in judged for seen in (own, own.swapped))
    text = page("paper").replace("\n", " ")
    quoted = [words for words in re.findall(r'"([^"]+)"', text) if re.search(r"\d times|equal within", words)]
    assert len(quoted) > 5
    for words in quoted:
        assert re.sub(r"\s+", " ", words) in sentences, words


SCRIPTS = {"replayed": "summary.py", "drive": "best.py", "filters": "verdicts.py"}
"""Pages whose tables, and lists of sentences, a script of the study prints from the rows."""


@pytest.mark.parametrize("study", SCRIPTS)
def test_what_a_script_prints_stands_on_the_page_and_every_interval_in_the_table(study):
    printed = run_python(f"experiments/{study}/{SCRIPTS[study]}", str(ROOT / "results" / study), cwd=ROOT)
    made = [line for line in printed.splitlines() if line.startswith(("| ", "- "))]
    assert len(made) > 4
    assert [line for line in made if line not in page(study).splitlines()] == []
    table = (ROOT / "results" / study / "table.md").read_text(encoding="utf-8").replace("**", "")
    for words in re.findall(r"\d[\d.]* \[[\d., ]+\]", page(study)):
        assert words in table, words


STUDIES = sorted(path.parent.name for path in (ROOT / "experiments").glob("*/README.md"))
RECORDINGS = {
    "drive": "rtklib_drive_0708",
    "replayed": "rtklib_drive_0708",
    **dict.fromkeys(("attitude", "journeys", "vehicles"), ""),
}
"""Folder of a study's recording, where it is not called as the study is."""

BLOCK = re.compile(r"((?:<!-- small: [^\n]* -->\n)+)```sh\n(.*?)```", flags=re.DOTALL)


def commands(study):
    """Every command of the study's README with its more words."""
    text = (ROOT / "experiments" / study / "README.md").read_text(encoding="utf-8")
    blocks = BLOCK.findall(text)
    assert len(blocks) == text.count("```sh\n"), f"experiments/{study}/README.md has commands without <!-- small: -->"
    for more, block in blocks:
        yield from zip(block.splitlines(), re.findall("<!-- small: (.*) -->", more), strict=True)


def words(command, more):
    return [*shlex.split(command), *([] if more == "-" else shlex.split(more))]


def run_python(script, *arguments, cwd):
    """Run a script in this process, as `python SCRIPT ARGUMENTS` does in ``cwd``; returns what it prints."""
    script, modules, out = ROOT / script, set(sys.modules), io.StringIO()
    with (
        contextlib.chdir(cwd),
        contextlib.redirect_stdout(out),
        patch.object(sys, "argv", [str(script), *arguments]),
        patch.object(sys, "path", [str(script.parent), *sys.path]),
    ):
        runpy.run_path(str(script), run_name="__main__")
    for name in set(sys.modules) - modules:  # other studies have modules of the same name
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(ROOT / "experiments")):
            del sys.modules[name]
    return out.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize("study", STUDIES)
def test_the_commands_of_a_study_go_well(study, tmp_path, request):
    if study == "attitude":
        pytest.importorskip("vqf")
    folder = ""
    for command, more in commands(study):
        if "FOLDER" in command:
            data = request.getfixturevalue("shared_folder") / "data" / RECORDINGS.get(study, study)
            folder = str(data)
        program, *arguments = words(command.replace("FOLDER", folder), more)
        if program == "python":
            assert len(run_python(*arguments, cwd=tmp_path)) > 100
        else:
            alone = ["--workers", "1"] if arguments[0] == "audit" else ["workers=1"]
            done = verb(*arguments, *alone, cwd=tmp_path)
            assert done.returncode == 0, done.stderr
