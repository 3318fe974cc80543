"""gnss_only carries the last fix on with the last velocity; until there is one it stays at the fix."""

import numpy as np

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.filters.gnss_only import GnssOnly
from jerkbench.recording import Position, Reference, Velocity
from jerkbench.timeline import INITIAL_SPEED_SIGMA_MPS
from synthetic import level_attitude, recording_at_rest

FIX_M = np.array([1.0, 2.0, 3.0])
R_P_M2, R_V_M2PS2 = 0.04, 0.25


def estimate_at(*stamps_s):
    """One fix at 0.1 s, then one velocity at 0.5 s that has no up axis."""
    recording = recording_at_rest(
        duration_s=1.0,
        position=Position([0.1], [FIX_M], R_P_M2 * np.eye(3)[None]),
        velocity=Velocity([0.5], [[2.0, -1.0, np.nan]], R_V_M2PS2 * np.eye(3)[None]),
        reference=Reference(stamps_s, "made by hand", independent=True, enu_m=np.zeros((len(stamps_s), 3))),
    )
    return GnssOnly().estimate(recording, level_attitude(recording), NoAdaptation())


def test_before_the_first_velocity_it_stays_at_the_fix_and_says_how_little_it_knows():
    estimate = estimate_at(0.1, 0.3)
    variance = INITIAL_SPEED_SIGMA_MPS**2

    np.testing.assert_array_equal(estimate.position_m, [FIX_M, FIX_M])
    np.testing.assert_array_equal(estimate.velocity_mps, np.zeros((2, 3)))
    np.testing.assert_allclose(np.diag(estimate.covariance[0]), [R_P_M2] * 3 + [variance] * 3)
    np.testing.assert_allclose(np.diag(estimate.covariance[1])[:3], R_P_M2 + variance * 0.2**2)


def test_from_the_first_velocity_on_the_fix_is_carried_on_axis_by_axis():
    estimate = estimate_at(0.5, 0.9)

    np.testing.assert_allclose(estimate.velocity_mps, [[2.0, -1.0, 0.0]] * 2)
    np.testing.assert_allclose(estimate.position_m, FIX_M + np.outer([0.4, 0.8], [2.0, -1.0, 0.0]))
    np.testing.assert_allclose(np.diag(estimate.covariance[1])[:2], R_P_M2 + R_V_M2PS2 * 0.8**2)
    np.testing.assert_allclose(estimate.covariance[1][2, 2], R_P_M2 + INITIAL_SPEED_SIGMA_MPS**2 * 0.8**2)
