"""A study from Python runs damaged cells again, as the command line does."""

from jerkbench import api


def test_a_damaged_file_is_set_aside_and_its_cells_run_again(tmp_path, capsys):
    first = api.sweep(tmp_path, filter="gnss_only", seeds=2)
    for part in (tmp_path / "cells").glob("part-*"):
        part.write_bytes(part.read_bytes()[:-40])

    again = api.sweep(tmp_path, filter="gnss_only", seeds=2)

    assert not again.damaged
    assert len(again.rows) == len(first.rows) == 2
    assert "set aside" in capsys.readouterr().err
