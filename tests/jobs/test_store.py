"""The store: whole or not at all, and the same rows however they are spread over files."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jerkbench.errors import JerkbenchError
from jerkbench.jobs.key import read_manifest, write_manifest
from jerkbench.jobs.store import RowBlock, Store
from stored_cells import about, row, store_cell, write_blocks

ROWS = [row()]
ABOUT = about()


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path)


def done(store, key="abc"):
    """The seeds that need not run again."""
    return sorted(store.known([key]).get(key, ()))


def files(store):
    return sorted(store.folder.iterdir())


def test_what_is_written_is_read_to_the_bit_and_what_two_processes_stored_is_there_once(store):
    store_cell(store, "abc", ROWS, ABOUT)
    (cell,), broken = store.read()

    assert cell.key == "abc"
    assert cell.rows.to_dict("records") == ROWS
    assert cell.metadata == ABOUT
    assert broken == []
    assert (done(store), done(store, "abd")) == ([0], [])
    store_cell(store, "abc", ROWS, ABOUT)  # by another process
    assert len(files(store)) == 2
    assert store.read()[0][0].rows.to_dict("records") == ROWS


def test_many_cells_of_one_part_keep_their_own_columns_in_their_own_order(store):
    first = [{**row(seed=seed), "lost": seed, "velocity_rmse_mps": 0.5 * seed} for seed in (3, 1)]
    second = [{**row(), "height_m": 1.0, "lost": 0.5}]
    write_blocks(
        store, [RowBlock("a", 2, first, about(notes=["of a"])), RowBlock("b", 1, second, about(notes=["of b"]))]
    )
    a, b = store.read()[0]

    assert list(a.rows.columns[10:]) == ["position_rmse_m", "lost", "velocity_rmse_mps"]
    assert list(b.rows.columns[10:]) == ["position_rmse_m", "height_m", "lost"]
    pd.testing.assert_frame_equal(a.rows, pd.DataFrame(first[::-1]), check_exact=True, check_dtype=False)
    pd.testing.assert_frame_equal(b.rows, pd.DataFrame(second), check_exact=True)
    assert [cell.metadata["notes"] for cell in (a, b)] == [["of a"], ["of b"]]


def test_a_cell_is_whole_when_its_last_block_is_there(store):
    last, first = ([row(0.1 * k, k) for k in seeds] for seeds in ((3, 4), (0, 1, 2)))
    blocks = [
        RowBlock("abc", 5, rows, about(notes=[name, "both"], seconds=2.0))
        for name, rows in (("second", last), ("first", first))
    ]
    write_blocks(store, blocks[:1])
    assert store.read() == ([], [])
    assert done(store) == [3, 4]

    write_blocks(store, blocks[1:])
    assert done(store) == [0, 1, 2, 3, 4]
    (cell,), _ = store.read()
    assert list(cell.rows["seed"]) == [0, 1, 2, 3, 4]
    assert list(cell.rows["position_rmse_m"]) == [0.1 * k for k in range(5)]
    assert cell.metadata["notes"] == ["first", "both", "second"]
    assert cell.metadata["seconds"] == 4.0


def test_a_cell_with_a_failed_run_is_there_but_not_done_until_that_run_went_well(store):
    failed = [row(seed=0), {**row(seed=1), "status": "failed"}]
    store_cell(store, "abc", failed, about(created="2026-03-01T00:00:00Z"))

    assert done(store) == [0]
    assert store.known(["abc"], failed=True) == {"abc": {0, 1}}
    assert list(store.read()[0][0].rows["status"]) == ["ok", "failed"]
    write_blocks(store, [RowBlock("abc", 2, [row(0.7, seed=1)], about(created="2026-02-01T00:00:00Z"))])
    assert done(store) == [0, 1]
    (cell,), _ = store.read()
    assert list(cell.rows["position_rmse_m"]) == [0.1 + 0.2, 0.7]


@pytest.mark.parametrize("size", [0, 4, 300])
def test_a_file_that_is_cut_is_not_done_and_is_named_until_it_is_set_aside(store, size):
    store_cell(store, "abc", ROWS, ABOUT)
    (path,) = files(store)
    path.write_bytes(path.read_bytes()[:size])

    assert done(store) == []
    assert store.read() == ([], [path.stem])
    assert store.prepare() == [path.stem]
    assert store.read() == ([], [])
    assert [left.name for left in files(store)] == [f"{path.name}.damaged"]


def test_what_another_process_has_just_finished_or_set_aside_is_no_error(store, monkeypatch):
    store_cell(store, "abc", ROWS, ABOUT)
    (path,) = files(store)
    path.write_bytes(b"cut")
    rename = Path.rename
    monkeypatch.setattr(Path, "rglob", lambda folder, _: [folder / ".part-gone.1.partial"])
    monkeypatch.setattr(Path, "rename", lambda source, target: (rename(source, target), rename(source, target)))

    assert store.prepare() == [path.stem]
    assert [left.name for left in files(store)] == [f"{path.name}.damaged"]


def test_a_flipped_bit_anywhere_is_noticed(store):
    store_cell(store, "abc", [row(v, k) for k, v in enumerate(np.random.default_rng(1).normal(size=30))], ABOUT)
    (path,) = files(store)
    whole = path.read_bytes()
    for place in range(0, len(whole), 37):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1 << place % 8]) + whole[place + 1 :])
        assert store.read() == ([], [path.stem])
        assert done(store) == []


def test_a_write_that_fails_leaves_the_old_cell_and_nothing_else(store, monkeypatch):
    store_cell(store, "abc", ROWS, ABOUT)
    before = files(store)

    def full(*_):
        raise OSError("No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        store_cell(store, "abd", ROWS, ABOUT)

    assert files(store) == before


@pytest.mark.parametrize("value", ["a text", [1.0], "cell.key"])
def test_what_is_no_number_is_not_stored(store, value):
    name = value if value == "cell.key" else "metric"
    with pytest.raises(JerkbenchError, match=r"stored|called"):
        store_cell(store, "abc", [{**ROWS[0], name: value}], ABOUT)
    assert not store.folder.exists()


def test_a_cell_has_the_columns_of_all_its_parts(store):
    """The seeds of a random drive draw different numbers."""
    store_cell(store, "abc", [{**ROWS[0], "drawn.a": 1.0}], about())
    store_cell(store, "abc", [{**row(seed=1), "drawn.b": 2.0}], about())
    (cell,), _ = store.read(["abc"], shown={"abc": [[0, 2]]})

    assert cell.rows[["drawn.a", "drawn.b"]].sum().tolist() == [1.0, 2.0]


def test_many_small_parts_become_one_with_the_same_cells(store):
    for k in range(16):
        store_cell(store, f"a{k:x}", [row(0.1 * k), row(0.3, seed=1)], about(notes=[f"of {k}"]))
    before, _ = store.read()
    store.compact()

    assert len(files(store)) == 1
    after, broken = store.read()
    assert broken == []
    for old, new in zip(before, after, strict=True):
        assert (old.key, old.metadata) == (new.key, new.metadata)
        pd.testing.assert_frame_equal(old.rows, new.rows, check_exact=True)
    store.compact()
    assert len(files(store)) == 1


def test_a_file_that_is_joined_while_the_store_is_read_is_found_again(store, monkeypatch):
    for k in range(16):
        store_cell(store, f"a{k:x}", ROWS, ABOUT)
    load, calls = Store.load, []

    def joined_meanwhile(opened, name, columns=None):
        calls.append(name)
        if len(calls) == 3:
            Store(store.folder).compact()
        return load(opened, name, columns)

    monkeypatch.setattr(Store, "load", joined_meanwhile)
    assert len(store.read()[0]) == 16


def test_the_manifest_says_which_seeds_are_shown_and_a_cell_that_lacks_one_is_not_whole(store):
    store_cell(store, "abc", [row(0.1 * k, k) for k in range(5)], ABOUT)
    seeds = {"abc": range(1, 4)}
    write_manifest(store.folder.parent, seeds, [], ["jerkbench"])
    (cell,), _ = store.read()

    assert list(cell.rows["seed"]) == [1, 2, 3]
    assert cell.others == 2
    assert store.read(shown={"abc": [[0, 6]]}) == ([], [])
    assert list(store.read(shown={})[0][0].rows["seed"]) == [0, 1, 2, 3, 4]
    store.compact()
    assert done(store) == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("before", "own", "shown"),
    [
        (range(5), range(20), [[0, 20]]),
        (range(20), range(5), [[0, 5]]),
        (range(5), range(5, 9), [[0, 5], [5, 4]]),
        ([*range(5), *range(50, 55)], range(50, 55), [[0, 5], [50, 5]]),
        (range(5), (), [[0, 5]]),
    ],
)
def test_seeds_of_a_new_command_take_the_place_of_those_that_they_overlap_and_join_the_others(
    tmp_path, before, own, shown
):
    for seeds in (before, own):
        write_manifest(tmp_path, {"abc": seeds}, [], ["jerkbench"])

    assert read_manifest(tmp_path)["seeds"] == {"abc": shown}
