"""The store: whole or not at all."""

import pytest

from jerkbench.results.store import Store
from stored_cells import about, row

ROWS = [row()]
ABOUT = about()


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path)


def test_what_is_written_is_read_to_the_bit(store):
    store.write("abc", ROWS, ABOUT)
    (found,), broken = store.read()

    assert found.key == "abc"
    assert found.rows.to_dict("records") == ROWS
    assert found.metadata["notes"] == ["a note"]
    assert broken == []
    assert store.done("abc")
    assert not store.done("another")


def test_a_cell_with_a_failed_run_is_there_but_not_done(store):
    store.write("abc", [{**ROWS[0], "status": "failed"}], ABOUT)

    assert not store.done("abc")
    assert len(store.read()[0]) == 1


@pytest.mark.parametrize("size", [0, 4, 300])
def test_a_file_that_is_cut_is_not_done_and_is_named(store, size):
    store.write("abc", ROWS, ABOUT)
    store.path("abc").write_bytes(store.path("abc").read_bytes()[:size])

    assert not store.done("abc")
    assert store.read() == ([], ["abc"])


def test_a_flipped_bit_is_noticed_wherever_the_file_is_then_read(store):
    """Also in what pandas stores of its types: it decides what the rows are."""
    store.write("abc", ROWS, ABOUT)
    path, whole, (sound,) = store.path("abc"), store.path("abc").read_bytes(), store.read()[0]
    for place in range(0, len(whole), 5):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1 << place % 8]) + whole[place + 1 :])
        found, broken = store.read()
        assert store.done("abc") == bool(found) == (not broken)
        assert all(one.rows.equals(sound.rows) and one.metadata == sound.metadata for one in found)


def test_a_write_that_fails_leaves_the_old_cell_and_nothing_else(store, monkeypatch):
    store.write("abc", ROWS, ABOUT)

    def full(*_):
        raise OSError("No space left on device")

    monkeypatch.setattr("jerkbench.results.store.pq.write_table", full)
    with pytest.raises(OSError, match="No space"):
        store.write("abc", ROWS, ABOUT)

    assert store.done("abc")
    assert [path.name for path in store.folder.iterdir()] == ["abc.parquet"]


def test_what_an_ended_process_left_half_written_is_forgotten(store):
    store.prepare()
    left = [store.folder / f".abc.{number}.partial" for number in (11, 12)]
    for path in left:
        path.touch()

    store.forget([11, 13])

    assert [path.exists() for path in left] == [False, True]
