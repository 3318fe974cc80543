"""`jerkbench audit` with a tiny protocol: killed and continued by two processes, compared with an undisturbed audit."""

import os
import signal
import subprocess
import sys
import time

import pandas as pd
import pytest
from test_audit_answer import same_as_in_pandas

from commands import PATIENCE_S, environment, verb
from jerkbench.campaign.answer import answered
from jerkbench.campaign.audit import read_rows

PROTOCOL = """\
defaults: [small, _self_]
filters: [baseline]
apart: [eskf15]
apart_with_adaptations: []
trials: 3
plain_trials: 4
tune_drives: 3
apart_drives: 4
only: [mtf, sage_husa_qr]
"""
COMMAND = ["--config-dir", "conf", "audit", "--scale", "tiny", "--workers"]


def with_protocol(folder):
    """Write the protocol to a configuration folder in ``folder``."""
    (folder / "conf" / "audit").mkdir(parents=True)
    (folder / "conf" / "audit" / "tiny.yaml").write_text(PROTOCOL, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """An audit of one process that was not interrupted."""
    folder = with_protocol(tmp_path_factory.mktemp("alone"))
    done = verb(*COMMAND, "1", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / "results" / "audit-tiny"


def runs_of(folder):
    """The stored runs of an audit."""
    columns = ["cell.key", "seed", "cell.created"]
    return pd.concat([pd.read_parquet(path, columns=columns) for path in folder.glob("runs/*/*.parquet")])


@pytest.mark.slow
def test_a_killed_audit_goes_on_and_comes_out_the_same(alone, tmp_path):
    folder = with_protocol(tmp_path) / "results" / "audit-tiny"
    command = [sys.executable, "-m", "jerkbench", *COMMAND]
    begun = subprocess.Popen([*command, "1"], cwd=tmp_path, env=environment(), stderr=subprocess.DEVNULL)
    since = time.monotonic()
    while not list(folder.glob("runs/*/*.parquet")):
        assert begun.poll() is None
        assert time.monotonic() - since < PATIENCE_S
        time.sleep(0.1)
    os.kill(begun.pid, signal.SIGKILL)
    begun.wait()
    assert not (folder / "answer.json").exists()
    stored = runs_of(folder)
    done = subprocess.run([*command, "2"], cwd=tmp_path, env=environment(), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
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
