"""YAML of strangers: a few lines that stand for more than a machine can hold are refused at once."""

import shutil
import time
from pathlib import Path

import pytest
import yaml

from commands import verb
from jerkbench import files
from jerkbench.campaign.entry import SETTINGS, read_entry
from jerkbench.errors import JerkbenchError
from jerkbench.files import MAX_DEPTH, MAX_VALUES, read_yaml

ENTRIES = Path(__file__).parents[1] / "results"
BOMB = "a0: &a0 [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"a{k}: &a{k} [{','.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 12)
)
MERGED = "a0: &a0 {x: 1}\n" + "".join(f"a{k}: &a{k} {{<<: [{','.join([f'*a{k - 1}'] * 9)}]}}\n" for k in range(1, 12))
SELF = "a: &a [*a]\n"
LAUGHS = f"notes: ['{'${study}' * 200}']\nstudy: '{'${results}' * 200}'\nresults: '{'${filter.name}' * 200}'\n"
DEEP = f"a: {'[' * 5000}{']' * 5000}\n"


def count(value):
    """Values with all that they hold, by a walk over what PyYAML made."""
    inner = [*value.values(), *value] if isinstance(value, dict) else value if isinstance(value, list) else []
    return 1 + sum(map(count, inner))


BOUND = "mine.yaml has more than 100000 values, or lists that are nested more than 100"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        *((bomb, BOUND) for bomb in (BOMB, MERGED, SELF, DEEP)),
        (LAUGHS, "mine.yaml has more than 20 interpolations"),
        ("a: [1\nb: }", "mine.yaml cannot be read"),
        ("study: a\nstudy: b", "mine.yaml cannot be read"),
        ("study: !!python/object/apply:os.system [ls]", "mine.yaml cannot be read"),
    ],
    ids=["lists", "merged", "itself", "deep", "interpolated", "no yaml", "twice", "code"],
)
def test_a_preset_that_multiplies_or_is_no_yaml_is_refused_at_once(tmp_path, text, said):
    preset = tmp_path / "presets" / "experiment" / "mine.yaml"
    preset.parent.mkdir(parents=True)
    preset.write_text(f"# @package _global_\n{text}")
    began = time.process_time()
    done = verb("run", "--config-dir", tmp_path / "presets", "experiment=mine", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert said in done.stderr
    assert time.process_time() - began < 20


@pytest.mark.parametrize("loader", [yaml.SafeLoader, files.LOADER], ids=["python", "libyaml"])
@pytest.mark.parametrize("text", [DEEP, DEEP.replace("[", "{").replace("]", "}"), "- " * 900 + "x"])
def test_a_depth_is_one_sentence_whichever_library_refuses_it(tmp_path, monkeypatch, loader, text):
    """libyaml 0.2.6 has a limit of its own, which older ones and the library in Python lack."""
    monkeypatch.setattr(files, "LOADER", loader)
    with pytest.raises(JerkbenchError, match="has more than 100000 values, or lists that are nested more than 100"):
        files.require_small(text, tmp_path / "deep.yaml")


def test_a_bomb_beside_stored_results_is_refused_at_once(tmp_path):
    entry = shutil.copytree(next(ENTRIES.glob("*/*/manifest.json")).parent, tmp_path / "entry")
    (entry / SETTINGS).write_text(BOMB)
    with pytest.raises(JerkbenchError, match="has more than"):
        read_entry(entry)


@pytest.mark.parametrize("extra", [0, 1])
def test_the_bound_counts_what_aliases_repeat(tmp_path, extra):
    path = tmp_path / "file.yaml"
    path.write_text(
        f"a: &a [{','.join(['x'] * 997)}]\nb: [{','.join(['*a'] * 99)}]\nc: [{','.join('x' * (194 + extra))}]\n"
    )
    counted = count(yaml.safe_load(path.read_text()))
    assert counted == MAX_VALUES + extra
    if extra:
        with pytest.raises(JerkbenchError):
            read_yaml(path)
    else:
        assert len(read_yaml(path)["b"]) == 99


def test_what_people_write_is_read(tmp_path):
    path = tmp_path / "file.yaml"
    path.write_text(
        f"a: &a {{x: 1}}\nb: {{<<: *a, y: [*a, ü]}}\nd: {'[' * (MAX_DEPTH - 1)}{']' * (MAX_DEPTH - 1)}\n",
        encoding="utf-8",
    )
    assert read_yaml(path)["b"] == {"x": 1, "y": [{"x": 1}, "ü"]}
