"""Packages that `jerkbench new` writes: small, importable, and right as they are."""

import os
import subprocess
import sys
import tomllib

import pytest

from commands import environment, verb
from jerkbench.plugins.new import EXAMPLES, class_name

MAX_LINES = 40


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

    assert (done.returncode, done.stdout) == (0, f"{EXAMPLES[kind].group} my_{kind}: keeps its contract.\n")


@pytest.mark.parametrize("kind", EXAMPLES)
def test_its_files_of_code_are_small(packages, kind):
    for name in (f"my_{kind}.py", f"test_my_{kind}.py", "pyproject.toml"):
        lines = (packages / f"my_{kind}" / name).read_text(encoding="utf-8").splitlines()
        assert len(lines) <= MAX_LINES
        assert max(map(len, lines)) <= 120


@pytest.mark.slow
def test_its_own_test_runs(packages):
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "my_filter/test_my_filter.py"]
    here = environment(PYTHONPATH=str(packages / "my_filter"))
    done = subprocess.run(command, cwd=packages, env=here, capture_output=True, text=True, timeout=120, check=False)

    assert done.returncode == 0, done.stdout
    assert "1 passed" in done.stdout


@pytest.mark.parametrize("kind", EXAMPLES)
def test_its_entry_point_names_its_class(packages, kind):
    project = tomllib.loads((packages / f"my_{kind}" / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    group = f"jerkbench.{EXAMPLES[kind].group}"

    assert project["name"] == f"my-{kind}"
    assert project["entry-points"] == {group: {f"my_{kind}": f"my_{kind}:{class_name(f'my_{kind}')}"}}


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["adaption", "mine"], "Did you mean 'adaptation'?"),
        (["adaptation", "mtf"], "There is an adaptation 'mtf' already"),
        (["adaptation", "My-Rule"], "'My-Rule' cannot be the name"),
        (["adaptation", "class"], "'class' cannot be the name"),
        (["adaptation", "numpy"], "There is a Python module 'numpy' already"),
        (["adaptation", "mine", "--out", os.curdir], "is there already; give another folder"),
    ],
)
def test_what_cannot_be_written_is_a_sentence(tmp_path, words, sentence):
    (tmp_path / "something").touch()
    done = verb("new", *words, cwd=tmp_path)

    assert done.returncode == 2
    assert sentence in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["something"]
