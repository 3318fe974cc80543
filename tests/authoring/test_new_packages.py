"""Packages that `jerkbench new` makes, and a plugin written for version 0.2.0."""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pandas as pd
import pytest

from commands import environment, jerkbench, swept, verb
from jerkbench.plugins.new import EXAMPLES, class_name


def group_of(kind):
    return "filter" if kind == "estimator" else kind


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """A folder with a package of each kind."""
    folder = tmp_path_factory.mktemp("packages")
    for kind in EXAMPLES:
        done = verb("new", kind, f"my_{kind}", cwd=folder)
        assert done.returncode == 0, done.stderr
        assert len(done.stdout.splitlines()) == 4
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("kind", EXAMPLES)
def test_a_package_keeps_its_contract_unchanged(packages, kind):
    done = verb("check", f"my_{kind}", cwd=packages)

    assert (done.returncode, done.stdout) == (0, f"{group_of(kind)} my_{kind}: satisfies its contract.\n")


@pytest.mark.parametrize("kind", EXAMPLES)
def test_its_files_of_code_are_small_and_its_entry_point_names_its_class(packages, kind):
    for name in (f"my_{kind}.py", f"test_my_{kind}.py", "pyproject.toml"):
        lines = (packages / f"my_{kind}" / name).read_text(encoding="utf-8").splitlines()
        assert len(lines) <= 40
        assert max(map(len, lines)) <= 120
    project = tomllib.loads((packages / f"my_{kind}" / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    group = f"jerkbench.{group_of(kind)}"
    assert project["name"] == f"my-{kind}"
    assert project["entry-points"] == {group: {f"my_{kind}": f"my_{kind}:{class_name(f'my_{kind}')}"}}


@pytest.mark.slow
def test_its_own_test_runs(packages):
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "my_filter/test_my_filter.py"]
    here = environment(PYTHONPATH=str(packages / "my_filter"))
    done = subprocess.run(command, cwd=packages, env=here, capture_output=True, text=True, timeout=120, check=False)

    assert done.returncode == 0, done.stdout
    assert "1 passed" in done.stdout


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["adaption", "mine"], "Did you mean 'adaptation'?"),
        (["adaptation", "mtf"], "The name 'mtf' is already used by an adaptation"),
        (["adaptation", "My-Rule"], "Invalid name 'My-Rule'"),
        (["adaptation", "class"], "Invalid name 'class'"),
        (["adaptation", "numpy"], "The name 'numpy' is already used by a Python module"),
        (["adaptation", "mine", "--out", os.curdir], "already exists; give another folder"),
    ],
)
def test_what_cannot_be_written_is_a_sentence(tmp_path, words, sentence):
    (tmp_path / "something").touch()
    done = verb("new", *words, cwd=tmp_path)

    assert done.returncode == 2
    assert sentence in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["something"]


MADE = Path(__file__).parent / "made_with_020"


@pytest.mark.slow
def test_its_package_is_installed_found_and_swept_with_the_number_that_it_had(tmp_path):
    source, target = shutil.copytree(MADE, tmp_path / "source"), tmp_path / "installed"
    words = ["install", "--quiet", "--no-deps", "--no-build-isolation", "--target", str(target), str(source)]
    subprocess.run([sys.executable, "-m", "pip", *words], check=True, capture_output=True, timeout=120)

    checked = jerkbench("check", "jerkbench-geman-mcclure", cwd=tmp_path, PYTHONPATH=str(target))
    assert (checked.returncode, checked.stdout) == (0, "adaptation geman_mcclure: satisfies its contract.\n")
    swept("adaptation=none,geman_mcclure", "disturbance=outliers", cwd=tmp_path, PYTHONPATH=str(target))
    rows = pd.read_csv(tmp_path / "results" / "adhoc" / "rows.csv").set_index("adaptation")
    of_020_m = 0.03189500018518018
    assert rows.loc["geman_mcclure", "position_rmse_m"] == pytest.approx(of_020_m, rel=1e-9)
