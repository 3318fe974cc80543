"""Studies whose rows are kept in the repository: every verb that reads works on them, as on a packed one."""

import shutil
import subprocess
from pathlib import Path

import pytest

from commands import verb
from jerkbench.jobs.store import RowBlock, Store
from jerkbench.jobs.study import load_study
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


def require_answers(study, folder):
    """Ask every verb that needs no run and no figure."""
    for words in (["table"], ["table", "--findings"], ["table", "--format", "csv"]):
        done = verb(words[0], study, *words[1:], cwd=folder)
        assert done.returncode == 0, done.stderr
        assert "damaged" not in done.stdout
    assert verb("compare", study, study, cwd=folder).returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize("study", KEPT, ids=lambda path: path.name)
def test_a_kept_study_is_whole_answers_and_names_no_folder_of_one_machine(study, tmp_path):
    copy = shutil.copytree(study, tmp_path / study.name)
    assert len(list((copy / "cells").iterdir())) == 1
    require_answers(copy, tmp_path)
    for cell in Store(copy).read()[0]:
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
    require_answers(study, tmp_path)
    path.write_bytes(path.read_bytes()[:-1])
    assert Store(study).read() == ([], [path.stem])
