"""`jerkbench audit --scale small`, interrupted and gone on with, against golden tables."""

from pathlib import Path

import pandas as pd
import pytest

from jerkbench.audit.protocol import read_protocol
from jerkbench.audit.study import run_audit
from jerkbench.campaigns.piece import Piece
from jerkbench.jobs.cluster import Local

GOLDEN = Path(__file__).parent / "golden"
"""verdicts.csv without times, and settings.csv, of the small audit; a change of what is computed makes them anew."""
STAGES_BEFORE_THE_END = 25


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of an audit that was stopped in its first stage, and gone on with by two processes."""
    folder, protocol = tmp_path_factory.mktemp("audit") / "audit-small", read_protocol("small")
    runs, run = [], Piece.run

    def stopped(stage):
        if len(runs) == STAGES_BEFORE_THE_END:
            raise KeyboardInterrupt
        runs.append(stage.path)
        return run(stage)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Piece, "run", stopped)
        with pytest.raises(KeyboardInterrupt):
            run_audit(protocol, folder, Local(), workers=1)
    assert len(list((folder / "runs").iterdir())) == STAGES_BEFORE_THE_END
    before = {path: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()}
    run_audit(protocol, folder, Local(), workers=2)
    assert {path: path.stat().st_mtime_ns for path in before} == before
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", ["verdicts", "settings"])
def test_the_small_audit_comes_out_as_it_did(name, folder):
    golden = pd.read_csv(GOLDEN / f"small_{name}.csv")
    found = pd.read_csv(folder / f"{name}.csv")

    pd.testing.assert_frame_equal(found[golden.columns], golden, rtol=1e-9, atol=0.0)
    assert list(found.columns.difference(golden.columns)) == (["step_ns"] if name == "verdicts" else [])
