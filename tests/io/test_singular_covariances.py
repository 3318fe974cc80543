"""Covariances that are singular or practically zero are refused when they are read, not in the middle of a run."""

import numpy as np
import pytest

from commands import SHORT, verb
from jerkbench.arrays import positive_definite
from jerkbench.jobs.preflight import reason_of

AXES = np.random.default_rng(0).normal(0, 0.5, (1000, 3))
RANK_ONE = AXES[:, :, None] * AXES[:, None, :]
TABLE = (
    *("dataset=table", "dataset.folder=.", "dataset.position_file=fix.csv", "dataset.position_time=t"),
    *("dataset.position_columns=[e,n,u]", "dataset.position_frame=enu", "dataset.epoch=none", "dataset.imu_file=''"),
    *("dataset.position_covariance=[a,b,c,d,e1,f,g,h,i]", "filter=constant_velocity", "disturbance=withhold"),
)


def test_a_matrix_of_rank_one_or_two_is_not_definite_whatever_rounding_makes_of_it():
    rank_two = RANK_ONE + RANK_ONE[::-1]
    assert not positive_definite(np.concatenate([RANK_ONE, rank_two, 1e8 * RANK_ONE, np.full((1, 3, 3), np.nan)])).any()
    assert positive_definite(RANK_ONE + 1e-6 * np.eye(3)).all()


def recorded(folder, covariances):
    rng = np.random.default_rng(1)
    rows = (
        ",".join(f"{x:.17g}" for x in (0.2 * k, 0.6 * k, 0.4 * k, rng.normal(), *C.ravel()))
        for k, C in enumerate(covariances)
    )
    (folder / "fix.csv").write_text("t,e,n,u,a,b,c,d,e1,f,g,h,i\n" + "\n".join(rows) + "\n")


def test_rank_one_in_a_table_is_counted_and_its_variances_are_used(tmp_path):
    recorded(tmp_path, RANK_ONE[:200])
    done = verb("run", *SHORT[1:], *TABLE, "adaptation=student_t_r", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "200 of 200 covariances of fix.csv are not positive definite" in " ".join(done.stdout.split())


@pytest.mark.parametrize("variance", [5e-324, 1e-300, 0.0])
def test_variances_that_are_practically_zero_are_one_message(tmp_path, variance):
    recorded(tmp_path, np.tile(variance * np.eye(3), (200, 1, 1)))
    done = verb("run", *SHORT[1:], *TABLE, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "the covariance is not positive definite" in done.stderr


def test_a_singular_matrix_in_a_run_is_a_sentence():
    with pytest.raises(np.linalg.LinAlgError) as caught:
        np.linalg.inv(np.zeros((2, 2)))
    assert "check the covariances" in reason_of(caught.value)
    assert "line" not in reason_of(caught.value)
