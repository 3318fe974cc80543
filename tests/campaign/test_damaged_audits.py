"""`jerkbench audit --stored` over damaged audits: one sentence, and exit code 2."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest

from commands import verb
from jerkbench.campaign.audit import TABLE_COLUMNS, write_audit_manifest, write_protocol, write_rows
from made_rows import made_rows

COMMIT = {"git_commit": "abc"}
TABLE_FILES = [f"{name}.parquet" for name in TABLE_COLUMNS]
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


def refused(folder):
    """What is said of a damaged audit."""
    done = verb("audit", "--scale", "small", "--results", folder.parent, "--stored", cwd=folder.parent)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    return done.stderr


def test_a_whole_audit_is_judged(copy):
    done = verb("audit", "--stored", "--scale", "small", "--results", copy.parent, cwd=copy.parent)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(("name", "damage", "how"), DAMAGES)
def test_damage_is_refused_in_one_sentence(copy, name, damage, how):
    damage(copy / name, how)

    assert name in refused(copy)


def test_an_earlier_manifest_is_refused(copy):
    (copy / "manifest.json").write_text(json.dumps(COMMIT, indent=1) + "\n")
    assert "an earlier version of jerkbench wrote the file" in refused(copy)
