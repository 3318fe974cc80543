"""`jerkbench audit --scale small`: killed and gone on with by two processes, against one that was left alone."""

import os
import signal
import subprocess
import sys
import time

import pandas as pd
import pytest
from test_audit_answer import same_as_in_pandas

from commands import PATIENCE_S, environment
from jerkbench.campaign.answer import answered, judged_audit
from jerkbench.campaign.audit import read_rows, run_audit
from jerkbench.campaign.protocol import read_protocol
from jerkbench.errors import JerkbenchError
from jerkbench.jobs.executors import LOCAL

COMMAND = [sys.executable, "-m", "jerkbench", "audit", "--scale", "small", "--workers"]


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """An audit of one process that was left alone."""
    folder = tmp_path_factory.mktemp("alone") / "audit-small"
    run_audit(read_protocol("small"), folder, LOCAL, workers=1)
    judged_audit(folder)
    return folder


def runs_of(folder):
    """The stored runs of an audit."""
    columns = ["cell.key", "seed", "cell.created"]
    return pd.concat([pd.read_parquet(path, columns=columns) for path in folder.glob("runs/*/*.parquet")])


@pytest.mark.slow
def test_a_killed_audit_goes_on_and_comes_out_the_same(alone, tmp_path):
    folder = tmp_path / "results" / "audit-small"
    begun = subprocess.Popen([*COMMAND, "1"], cwd=tmp_path, env=environment(), stderr=subprocess.DEVNULL)
    since = time.monotonic()
    while not list(folder.glob("runs/*/*.parquet")):
        assert begun.poll() is None
        assert time.monotonic() - since < PATIENCE_S
        time.sleep(0.1)
    os.kill(begun.pid, signal.SIGKILL)
    begun.wait()
    assert not (folder / "answer.json").exists()
    stored = runs_of(folder)
    done = subprocess.run([*COMMAND, "2"], cwd=tmp_path, env=environment(), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "settings are done already" in done.stderr
    again = runs_of(folder)
    assert not again.duplicated(["cell.key", "seed"]).any()
    kept = stored.merge(again, on=["cell.key", "seed"], suffixes=("", "_again"))
    assert len(kept) == len(stored) > 0
    first, second = kept["cell.created"].astype(str), kept["cell.created_again"].astype(str)
    assert (first == second).all()  # what was done was not run again
    first, second = read_rows(alone), read_rows(folder)
    for name, table in first.tables.items():
        known = list(table)
        both = (own[known].sort_values(known, ignore_index=True) for own in (table, second.tables[name]))
        pd.testing.assert_frame_equal(*both, obj=name)
    assert (folder / "methods.csv").read_bytes() == (alone / "methods.csv").read_bytes()


@pytest.mark.slow
def test_every_number_of_the_small_audit_is_that_of_pandas(alone):
    same_as_in_pandas(answered(read_rows(alone)))


@pytest.mark.slow
def test_a_small_audit_on_a_cluster_comes_out_the_same(alone, tmp_path):
    pytest.importorskip("dask")
    words = [sys.executable, "-m", "jerkbench", "audit", "--scale", "small", "--cluster", "dask", "--workers", "2"]
    done = subprocess.run(words, cwd=tmp_path, env=environment(), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "results/audit-small/methods.csv").read_bytes() == (alone / "methods.csv").read_bytes()


@pytest.mark.slow
def test_a_protocol_that_was_changed_afterwards_is_refused(alone, tmp_path):
    for path in alone.glob("*.*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    text = (tmp_path / "protocol.json").read_text(encoding="utf-8")
    (tmp_path / "protocol.json").write_text(text.replace('"margin": 0.1', '"margin": 0.2'), encoding="utf-8")

    with pytest.raises(JerkbenchError, match=r"protocol\.json was changed"):
        read_rows(tmp_path)
