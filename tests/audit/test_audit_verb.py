"""`jerkbench audit` with words that leave nothing to do: a sentence at once."""

import pytest

from commands import verb


@pytest.mark.parametrize("content", [{}, {"tune-000-baseline.parquet": b"damaged"}], ids=["nothing", "damaged"])
def test_nothing_stored_is_refused_in_a_sentence(tmp_path, content):
    runs = tmp_path / "results" / "audit-small" / "runs"
    for name, data in content.items():
        runs.mkdir(parents=True)
        (runs / name).write_bytes(data)

    done = verb("audit", "--stored", "--scale", "small", cwd=tmp_path)

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "No run of this audit is stored in results/audit-small/runs" in done.stderr
    assert (tmp_path / "results").exists() == bool(content)


@pytest.mark.parametrize("words", [[], ["--stored"]], ids=" ".join)
def test_an_empty_scale_is_refused_and_starts_nothing(tmp_path, monkeypatch, words):
    monkeypatch.setattr("jerkbench.audit.study.run_audit", lambda *_, **__: pytest.fail("an audit"))

    done = verb("audit", "--scale", "", *words, cwd=tmp_path)

    assert done.returncode == 2
    assert "There is no preset of audit ''" in done.stderr
