"""Mistakes of an author: each is a sentence of `jerkbench check`, and most are one before a sweep begins."""

import pytest

from commands import jerkbench, verb

PACKAGE = '''"""A package with one mistake."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class {name}:
    """Doubts every measurement.

    Attributes:
        factor: on R [-].
    """

    {parameter}

    def adapt(self, innovation, HPHt, R, rows, memory):
        """Return R, inflated."""
        {body}
{more}
'''
PARAMETER, BODY = "factor: float = 4.0", "return self.factor * R"
MISTAKES = {
    "wrong_shape": ({"body": "return self.factor * np.diag(R)"}, "adapt() has shape (6,); it must be (6, 6)"),
    "state_on_self": ({"body": "self.seen = 1; return R"}, "sets self.seen while it runs, but a plugin never changes"),
    "misspelt": (
        {"more": "\n    def fades(self, *update):\n        return 2.0\n"},
        ".fades is not used. Did you mean fade?",
    ),
    "missing_type": ({"parameter": "factor = 4.0"}, "has no type, so it is not a parameter; write factor: float = 4.0"),
    "not_found": ({"name": "Elsewhere"}, "cannot be imported: AttributeError: module 'not_found' has no attribute"),
    "raises": ({"body": "return R * (1 / 0)"}, "raises ZeroDivisionError"),
}
REFUSED = ("misspelt", "not_found")
"""Mistakes of a class, with which nothing at all runs; the check finds missing types in the same way."""

TOLD = ("wrong_shape", "state_on_self")
"""Mistakes of a method, which are told before the first cell."""


def write(folder, module, mistake):
    """Write a package whose plugin has the name of its module."""
    class_name = "".join(word.capitalize() for word in module.split("_"))
    values = {"name": class_name, "parameter": PARAMETER, "body": BODY, "more": ""} | mistake
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{module}.py").write_text(PACKAGE.format(**values))
    entry = f'[project.entry-points."jerkbench.adaptation"]\n{module} = "{module}:{class_name}"\n'
    (folder / "pyproject.toml").write_text(entry)
    return class_name


@pytest.mark.parametrize("module", MISTAKES)
def test_check_finds_it(tmp_path, module):
    mistake, sentence = MISTAKES[module]
    write(tmp_path, module, mistake)
    done = verb("check", str(tmp_path), cwd=tmp_path)

    assert done.returncode == 1
    assert done.stdout.startswith(f"adaptation {module}: error: ")
    assert sentence in done.stdout


def test_what_cannot_be_compiled_is_a_notice(tmp_path):
    write(tmp_path, "not_compiled", {"body": 'return R * {"a": self.factor}.get("b", eval("2.0"))'})
    done = verb("check", str(tmp_path), cwd=tmp_path)

    assert done.returncode == 0
    assert "notice: NotCompiled cannot be compiled and runs on the engine filterpy, many times slower: " in done.stdout
    assert done.stdout.endswith("adaptation not_compiled: satisfies its contract.\n")


def install(folder, module, mistake):
    """The same, as an installer would leave it in ``folder``."""
    class_name = write(folder, module, mistake)
    metadata = folder / f"{module}-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    name = class_name if "name" not in mistake else "Lost"
    (metadata / "entry_points.txt").write_text(f"[jerkbench.adaptation]\n{module} = {module}:{name}\n")


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with each of the packages installed."""
    folder = tmp_path_factory.mktemp("installed")
    for module, (mistake, _) in MISTAKES.items():
        install(folder, module, mistake)
    return str(folder)


@pytest.mark.parametrize("module", REFUSED)
def test_a_sweep_with_a_broken_class_is_refused(installed, tmp_path, module):
    words = ["dataset.duration_s=12", "seeds=1", "workers=1", f"adaptation=none,{module}"]
    done = jerkbench("run", "-m", *words, cwd=tmp_path, PYTHONPATH=installed)

    assert done.returncode == 2
    assert f"adaptation '{module}' of {module} 1.0 cannot be loaded and is left out: " in done.stderr
    assert module == "not_found" or MISTAKES[module][1] in done.stderr
    assert not list(tmp_path.rglob("*.parquet"))


def test_the_others_are_told_before_the_first_cell_runs(installed, tmp_path):
    words = ["dataset.duration_s=12", "seeds=1", "workers=1", f"adaptation={','.join(TOLD)}"]
    done = jerkbench("run", "-m", *words, cwd=tmp_path, PYTHONPATH=installed)

    assert done.returncode == 1
    for module in TOLD:
        line = next(line for line in done.stderr.splitlines() if MISTAKES[module][1] in line)
        assert line.startswith(f"Every run with the adaptation {module} will fail: ")


@pytest.mark.parametrize(
    ("package", "sentence"),
    [
        ("nothing_of_that_name", "nothing_of_that_name has no plugin. Add an entry point"),
        ("json", "json has no plugin. Add an entry point"),
        (".", "has no pyproject.toml"),
    ],
)
def test_what_is_no_package_is_a_sentence(tmp_path, package, sentence):
    done = verb("check", package, cwd=tmp_path)

    assert done.returncode == 2
    assert sentence in done.stderr
