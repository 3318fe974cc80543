"""Hostile input in small numbers; `benchmarks/hostile.py` tries it by the hundred."""

from time import sleep

import pytest

COUNT, SEED = 50, 20240514


@pytest.fixture
def hostile(script, monkeypatch):
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    return script("hostile")


@pytest.mark.slow
def test_random_command_lines_end_in_words(hostile, tmp_path, monkeypatch):
    monkeypatch.setattr(hostile, "MAX_CHORD_S", 600)  # a busy machine is no fault of theirs
    outcomes = list(hostile.command_lines(COUNT, SEED, tmp_path))

    assert [outcome for outcome in outcomes if outcome.kind == "broken"] == []
    assert {outcome.kind for outcome in outcomes} == {"refused", "survived"}


@pytest.mark.parametrize("family", ["tracks", "arrays"])
def test_damaged_recordings_end_in_words(hostile, tmp_path, monkeypatch, family):
    monkeypatch.setattr(hostile, "MAX_CHORD_S", 600)
    monkeypatch.setattr(hostile, "SMOOTHED", COUNT + 1)  # the search takes seconds
    outcomes = list(hostile.FAMILIES[family](COUNT, SEED, tmp_path))

    assert [outcome for outcome in outcomes if outcome.kind == "broken"] == []
    assert {outcome.kind for outcome in outcomes} == {"refused", "survived"}


@pytest.mark.parametrize(
    ("raised", "why"),
    [(ValueError("x"), "ValueError: x"), (SystemExit(1), "without a word"), (RecursionError("deep"), "deep")],
)
def test_what_ends_without_words_is_broken(hostile, tmp_path, monkeypatch, raised, why):
    def fail(_):
        raise raised

    monkeypatch.setattr(hostile, "jerkbench", fail)
    outcome = hostile.attempt(["run"], tmp_path)
    assert outcome.kind == "broken"
    assert why in outcome.why


@pytest.mark.parametrize(
    ("limit", "work"), [("SILENT_S", lambda _: all(iter(lambda: True, 0))), ("MAX_CHORD_S", lambda _: sleep(9))]
)
def test_silence_is_broken(hostile, tmp_path, monkeypatch, limit, work):
    monkeypatch.setattr(hostile, limit, 0.05)
    monkeypatch.setattr(hostile, "jerkbench", work)
    assert "silent" in hostile.attempt(["run"], tmp_path).why
