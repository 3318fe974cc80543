import numpy as np
import pytest

from jerkbench.io.clocks import velocity_when_true

T_S = np.array([10.0, 10.25, 10.5])
ENU = np.arange(9.0).reshape(3, 3)
COVARIANCE = np.tile(np.array([[4.0, 1.0, 0.5], [1.0, 5.0, 0.25], [0.5, 0.25, 6.0]]), (3, 1, 1))


@pytest.mark.parametrize("latency_s", [(0.125, 0.125, 0.275), (0.0, 0.1, 0.2), (0.0, 0.0, 0.25)])
def test_each_value_stands_once_at_its_own_time(latency_s):
    velocity = velocity_when_true(T_S, ENU, COVARIANCE, latency_s)
    found = {
        (round(t, 6), axis, row[axis])
        for t, row in zip(velocity.t_s, velocity.mps, strict=True)
        for axis in range(3)
        if np.isfinite(row[axis])
    }
    assert found == {(round(T_S[i] - latency_s[a], 6), a, ENU[i, a]) for i in range(3) for a in range(3)}
    for row, covariance in zip(velocity.mps, velocity.covariance_m2ps2, strict=True):
        for axis in np.flatnonzero(np.isfinite(row)):
            assert covariance[axis, axis] == COVARIANCE[0, axis, axis]


def test_cross_covariance_stays_between_axes_of_one_epoch_only():
    # up is one epoch old: its value meets east and north of the epoch before, with which it is not correlated
    velocity = velocity_when_true(T_S, ENU, COVARIANCE, (0.0, 0.0, 0.25))
    full = velocity.covariance_m2ps2[np.isfinite(velocity.mps).all(axis=1)]
    assert len(full) == 2
    np.testing.assert_array_equal(full[0], [[4, 1, 0], [1, 5, 0], [0, 0, 6]])
