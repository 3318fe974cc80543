"""`jerkbench audit` with --stored and --against over damaged audits: one sentence, and exit code 2."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest

from commands import verb
from jerkbench.campaign.audit import TABLE_COLUMNS, TABLES, write_audit_manifest, write_protocol, write_rows
from made_rows import made_rows

COMMIT = {"git_commit": "abc"}
TABLE_FILES = [f"{name}.parquet" for name in TABLES]
JSON_FILES = ["protocol.json", "manifest.json"]


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    rows, folder = made_rows(), tmp_path_factory.mktemp("whole") / "audit-small"
    write_protocol(rows.protocol, folder)
    rows.write(folder)
    write_audit_manifest(folder, COMMIT)
    return folder


@pytest.fixture
def copy(stored, tmp_path):
    return shutil.copytree(stored, tmp_path / "audit-small")


def cut(path, fraction):
    content = path.read_bytes()
    path.write_bytes(content[: int(fraction * len(content))])


def flip(path, fraction):
    content = bytearray(path.read_bytes())
    content[int(fraction * len(content))] ^= 1
    path.write_bytes(content)


def replace(path, text):
    path.unlink()
    path.mkdir() if text is None else path.write_text(text)


def remove(path, _):
    path.unlink()


def change_rows(path, how):
    """Change half of the rows of a table, or a column."""
    rows, number = pd.read_parquet(path), TABLE_COLUMNS[path.stem][-1]
    half = np.arange(len(rows)) % 2 == 0
    changed = {
        "delete": lambda: rows[half],
        "double": lambda: pd.concat([rows, rows[half]], ignore_index=True),
        "empty": lambda: rows.assign(**{number: rows[number].mask(half)}),
        "drop the number": lambda: rows.drop(columns=number),
        "drop the key": lambda: rows.drop(columns="tuning"),
        "halve": lambda: rows.assign(**{number: rows[number].mask(half, rows[number] / 2)}),
    }
    write_rows(changed[how]().reset_index(drop=True), path)


HOW = ["delete", "double", "empty", "drop the number", "drop the key", "halve"]
DAMAGES = [
    *[(name, cut, fraction) for name in TABLE_FILES + JSON_FILES for fraction in (0, 0.5, 0.999)],
    *[(name, flip, fraction) for name in TABLE_FILES + JSON_FILES for fraction in (0.1, 0.6, 0.9)],
    *[(name, remove, None) for name in TABLE_FILES + JSON_FILES],
    *[(name, replace, text) for name in JSON_FILES for text in ("[]", "{}", "null", "[" * 100_000, None)],
    *[(name, change_rows, how) for name in TABLE_FILES for how in HOW],
]


def refused(folder, stored=None):
    """What is said of a damaged audit, alone or next to a whole one."""
    words = ["audit", "--scale", "small", "--results", (stored or folder).parent]
    done = verb(*words, *(["--against", folder] if stored else ["--stored"]), cwd=folder.parent)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    return done.stderr


def test_a_whole_audit_is_judged(copy, stored):
    where = ["--scale", "small", "--results", copy.parent]
    for words in (["--stored"], ["--against", stored]):
        done = verb("audit", *words, *where, cwd=copy.parent)
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(("name", "damage", "how"), DAMAGES)
def test_damage_is_refused_in_one_sentence(copy, stored, name, damage, how):
    damage(copy / name, how)

    assert name in refused(copy, stored if damage is remove else None)


@pytest.mark.parametrize("name", TABLE_FILES)
@pytest.mark.parametrize("how", HOW[:-1])
def test_rows_that_are_not_complete_are_refused_although_the_hashes_fit(copy, name, how):
    change_rows(copy / name, how)
    write_audit_manifest(copy, COMMIT)

    assert f"{name} is damaged: " in refused(copy)


def test_a_run_that_is_said_to_be_another_one_and_an_earlier_manifest_are_refused(copy):
    rows = pd.read_parquet(copy / "judged.parquet")
    write_rows(rows.assign(trial=rows["trial"].mask(rows.index == 0, rows["trial"] + 1)), copy / "judged.parquet")
    write_audit_manifest(copy, COMMIT)
    assert "judged.parquet is damaged: the rows of " in refused(copy)
    (copy / "manifest.json").write_text(json.dumps(COMMIT, indent=1) + "\n")
    assert "an earlier version of jerkbench wrote the file" in refused(copy)
