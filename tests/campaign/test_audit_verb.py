"""`jerkbench audit` with words that leave nothing to do: a sentence at once."""

import json

import pytest

from commands import verb


@pytest.mark.parametrize("word", ["--stored", "--against=other"])
def test_nothing_stored_is_refused_in_a_sentence(tmp_path, word):
    done = verb("audit", word, "--scale", "small", cwd=tmp_path)

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "results/audit-small" in done.stderr
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize("words", [[], ["--stored"]], ids=" ".join)
def test_an_empty_scale_is_refused_and_starts_nothing(tmp_path, monkeypatch, words):
    monkeypatch.setattr("jerkbench.campaign.audit.run_audit", lambda *_, **__: pytest.fail("an audit"))

    done = verb("audit", "--scale", "", *words, cwd=tmp_path)

    assert done.returncode == 2
    assert "There is no preset of audit ''" in done.stderr


def test_the_results_of_another_protocol_are_not_mixed_with_these(tmp_path):
    folder = tmp_path / "results" / "audit-small"
    folder.mkdir(parents=True)
    (folder / "protocol.json").write_text(json.dumps({"digest": "817ceac5945c"}), encoding="utf-8")

    done = verb("audit", "--scale", "small", cwd=tmp_path)

    assert done.returncode == 2
    assert "another protocol (817ceac5945c" in done.stderr
    assert not (folder / "runs").exists()
