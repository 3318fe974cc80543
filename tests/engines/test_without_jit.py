"""With NUMBA_DISABLE_JIT=1 there is no compiled code, and every run goes on the reference engine."""

import pandas as pd
import pytest

from commands import SHORT, jerkbench, verb


@pytest.mark.slow
def test_a_run_goes_on_the_reference_engine_and_says_so_once(tmp_path):
    words = ["run", *SHORT, "adaptation=mtf"]
    without = jerkbench(*words, "study=without", cwd=tmp_path, NUMBA_DISABLE_JIT="1")
    reference = verb(*words, "study=reference", "engine=filterpy", cwd=tmp_path)
    rmse = [
        pd.read_csv(tmp_path / "results" / study / "rows.csv")["position_rmse_m"][0]
        for study in ("without", "reference")
    ]

    assert (without.returncode, reference.returncode) == (0, 0)
    assert without.stderr.count("because NUMBA_DISABLE_JIT is set") == 1
    assert abs(rmse[0] - rmse[1]) < 1e-9
