"""An entry is the same, to the tolerance that the check states, on a processor that rounds otherwise."""

import hashlib
import platform
import sys

import pandas as pd
import pytest

from commands import jerkbench
from jerkbench.campaign.board import ROW_TOLERANCE

OLDER = {
    "NUMBA_CPU_NAME": "x86-64-v2",
    "NUMBA_CPU_FEATURES": "",
    "NUMBA_DISABLE_INTEL_SVML": "1",
    "OPENBLAS_CORETYPE": "Nehalem",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F,-AVX2_Usable,-FMA_Usable,-FMA4_Usable",
}
"""Without instructions that fuse a product and a sum: in compiled code, in BLAS and in the C library."""

TINY = ("suite", "run", "filter=jerk", "adaptation=mtf", "--scale", "v2-tiny", "--workers", "1")
ENTRY = "results/suite-v2-tiny/jerk-mtf"


def features():
    from llvmlite import binding

    return binding.get_host_cpu_features()


@pytest.mark.slow
@pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64" or not features().get("fma"),
    reason="needs a processor that fuses a product and a sum, and can do without",
)
def test_an_entry_of_another_processor_is_what_it_says_to_the_stated_tolerance(tmp_path):
    done = jerkbench(*TINY, cwd=tmp_path, **OLDER)
    assert done.returncode == 0, done.stderr
    older = pd.read_parquet(tmp_path / ENTRY / "rows.parquet")

    checked = jerkbench("suite", "verify", ENTRY, "--rows", "500", cwd=tmp_path)
    assert checked.returncode == 0, checked.stdout

    (tmp_path / ENTRY).rename(tmp_path / "older")
    assert jerkbench(*TINY, cwd=tmp_path).returncode == 0
    own = pd.read_parquet(tmp_path / ENTRY / "rows.parquet")
    digests = {hashlib.sha256(rows["position_rmse_m"].to_numpy().tobytes()).hexdigest() for rows in (own, older)}
    assert len(digests) == 2  # else nothing was shown: they do round otherwise
    numbers = ["position_rmse_m", "anees"]
    pd.testing.assert_frame_equal(own[numbers], older[numbers], rtol=ROW_TOLERANCE, atol=0.0)
