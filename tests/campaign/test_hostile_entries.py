"""`suite verify` and `suite board` over damaged entries: a sentence each, and the whole entries stay on the board."""

import json
import shutil
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml

from commands import verb
from jerkbench.campaign.entry import read_entry
from jerkbench.errors import JerkbenchError

ROOT = Path(__file__).parents[2]
COMPLETE_ENTRY = ROOT / "results" / "suite-v2" / "jerk-none"


@pytest.fixture(scope="module")
def hostile():
    sys.path.insert(0, str(ROOT / "benchmarks"))
    yield import_module("hostile_entries")
    sys.path.remove(str(ROOT / "benchmarks"))


@pytest.fixture
def entry(tmp_path):
    return shutil.copytree(COMPLETE_ENTRY, tmp_path / "damaged")


@pytest.mark.filterwarnings("default::RuntimeWarning")  # forged values overflow: on the command line that is a line
def test_every_kind_of_damage_to_every_file_ends_in_a_sentence(hostile, tmp_path):
    rng, codes = np.random.default_rng(2), []
    for number in range(len(hostile.KINDS) * len(hostile.FILES)):
        damaged = hostile.surroundings(COMPLETE_ENTRY, tmp_path / "entries")
        what = hostile.damage(damaged, number, rng)

        done = verb("suite", "verify", str(damaged), "--rows", "0", cwd=tmp_path)

        assert done.returncode in (0, 1, 2), what
        assert (done.stderr.count("\n") == 1) == (done.returncode == 2), (what, done.stderr)
        assert "\x1b" not in done.stdout + done.stderr, what
        codes.append(done.returncode)
    assert codes.count(0) < len(codes) / 4


MANIFESTS = [
    ("entry", None),
    ("entry", "\x1b[2J"),
    ("suite", 3),
    ("protocol", []),
    ("data", {}),
    ("method", None),
    ("method", {"filter": {}, "adaptation": {"name": "none"}, "r_scale": {}}),
    ("method", {"filter": {"name": "${oc.env:HOME}"}, "adaptation": {"name": "none"}, "r_scale": {}}),
    ("method", {"filter": {"name": "jerk"}, "adaptation": {"name": "none"}, "r_scale": {"position": float("nan")}}),
    ("tuned", "yes"),
    ("score", {"ratio": 10**400}),
    ("files", []),
]


@pytest.mark.parametrize(("key", "value"), MANIFESTS)
def test_a_manifest_of_other_types_is_refused_and_names_the_part(entry, key, value):
    manifest = json.loads((entry / "manifest.json").read_text())
    (entry / "manifest.json").write_text(json.dumps(manifest | {key: value}))

    with pytest.raises(JerkbenchError, match=rf"manifest.json is damaged: '{key}' must be "):
        read_entry(entry)


NUMBERS = [float("nan"), float("inf"), "0.1", None, True, [1.0], 10**400]
WRONG = [{"entry": {"given": {}, "drives": {"filter.accel_mps2": value}}} for value in NUMBERS]


@pytest.mark.parametrize("wrong", [*WRONG, {"entry": {}}, {"plain": {"drives": {}}}], ids=str)
def test_settings_that_are_missing_or_not_finite_numbers_are_refused(entry, wrong):
    settings = yaml.safe_load((entry / "settings.yaml").read_text())
    (entry / "settings.yaml").write_text(yaml.safe_dump(settings | wrong))

    with pytest.raises(JerkbenchError, match=r"settings.yaml is damaged: it must be under 'entry' and 'plain'"):
        read_entry(entry)


@pytest.mark.parametrize(
    ("column", "values"),
    [
        ("seed", ["1"]),
        ("seed", [None]),
        ("scenario", [1.5]),
        ("status", [3]),
        ("anees", ["x"]),
        ("position_rmse_m", [float("inf")]),
        ("position_rmse_m", [-1.0]),
        ("seconds", [float("nan")]),
    ],
)
def test_rows_of_other_types_are_refused_and_name_the_column(entry, column, values):
    table = pq.read_table(entry / "rows.parquet")
    place = table.column_names.index(column)
    array = pa.array(values * table.num_rows, table.schema.field(column).type if values == [None] else None)
    pq.write_table(table.set_column(place, column, array), entry / "rows.parquet")

    with pytest.raises(JerkbenchError, match=rf"rows.parquet is damaged: column '{column}' must be "):
        read_entry(entry)


def test_a_damaged_entry_is_a_remark_on_the_board_and_the_others_have_their_places(entry, tmp_path):
    (entry / "settings.yaml").write_text("[]")
    unknown = shutil.copytree(COMPLETE_ENTRY, tmp_path / "unknown")
    manifest = json.loads((unknown / "manifest.json").read_text())
    (unknown / "manifest.json").write_text(json.dumps(manifest | {"suite": "v9"}))
    alone = verb("suite", "board", str(tmp_path), "--rows", "0", cwd=tmp_path)
    shutil.copytree(COMPLETE_ENTRY, tmp_path / "whole")

    done = verb("suite", "board", str(tmp_path), "--rows", "0", cwd=tmp_path)

    assert alone.returncode == 2
    assert "no entry that can be checked" in alone.stderr
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "board.md").read_text(encoding="utf-8")
    assert "1 (1 to 1)" in page
    assert "damaged is left out: " in page
    assert "unknown is left out: There is no suite" in page
