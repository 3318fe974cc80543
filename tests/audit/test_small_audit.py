"""`jerkbench audit --scale small`, interrupted and gone on with, against golden tables."""

from pathlib import Path

import pandas as pd
import pytest

from jerkbench.audit.protocol import read_protocol
from jerkbench.audit.study import run_audit
from jerkbench.jobs import run as loop
from jerkbench.jobs.cluster import Local
from jerkbench.results.store import Store

GOLDEN = Path(__file__).parent / "golden"
"""verdicts.csv without times, and settings.csv, of the small audit; a change of what is computed makes them anew."""
TASKS_BEFORE_THE_END = 200


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of an audit that was stopped in its first stage, and gone on with by two processes."""
    folder, protocol = tmp_path_factory.mktemp("audit") / "audit-small", read_protocol("small")
    original, done = loop.work, []

    def stopped(task, **how):
        if len(done) == TASKS_BEFORE_THE_END:
            raise KeyboardInterrupt
        done.append(task)
        return original(task, **how)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop, "work", stopped)
        with pytest.raises(KeyboardInterrupt):
            run_audit(protocol, folder, Local(), workers=1)
    ran = {(job.key, draw) for task in done for job in task.jobs for draw in task.draws}
    keys = {key for key, _ in ran}
    known = Store(folder / "runs").known(keys)
    assert {(key, draw) for key, draws in known.items() for draw in draws} == ran
    run_audit(protocol, folder, Local(), workers=2)
    tables = [pd.read_parquet(path, columns=["cell.key", "seed"]) for path in folder.rglob("part-*")]
    assert not pd.concat(tables).duplicated().any()  # nothing was run twice
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", ["verdicts", "settings"])
def test_the_small_audit_comes_out_as_it_did(name, folder):
    golden = pd.read_csv(GOLDEN / f"small_{name}.csv")
    found = pd.read_csv(folder / f"{name}.csv")

    pd.testing.assert_frame_equal(found[golden.columns], golden, rtol=1e-9, atol=0.0)
    assert list(found.columns.difference(golden.columns)) == (["step_ns"] if name == "verdicts" else [])
