"""The rest that an update leaves of a variance, and its rounding, against many decimal digits; what an update keeps."""

from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decimals import exact, numbers, solve
from jerkbench.kalman import gain_and_rest, innovation_factor, spread_by
from jerkbench.numpy_run import AdaptedUpdates
from jerkbench.timeline import build_timeline
from synthetic import level_attitude, recording_at_rest

UNIT = np.finfo(float).eps / 2
MEASURED = np.array([0, 1])


def nearly_singular(share):
    """The prior of two measured states and a third that all follow one, but for ``share`` of their variances."""
    sigma = np.array([2e4, 300.0, 5.0])
    return (np.ones((3, 3)) + share * np.diag([1.0, 2.0, 3.0])) * np.outer(sigma, sigma)


def posterior(P, R):
    """The posterior variances, in as many digits as the context has."""
    W = P[MEASURED]
    return np.diag(P - W.T @ solve(W[:, MEASURED] + R, W))


def spread_of(P, R):
    factor = innovation_factor(P[:2, :2] + R)
    return spread_by(*gain_and_rest(P[:, :2], R, factor, MEASURED), P, R, MEASURED)


@pytest.mark.parametrize("share", [1e-2, 1e-5, 1e-8, 1e-11])
@pytest.mark.parametrize("R", [np.diag([1e-4, 1e-4]), np.diag([1e-4, 1e6]), np.diag([1e12, 1e-2])])
@given(signs=st.lists(st.sampled_from([-1.0, 1.0]), min_size=6, max_size=6))
def test_last_bits_of_the_prior_change_a_posterior_variance_by_no_more_than_its_spread_allows(share, R, signs):
    """The change is that of K E K' for an E of a few last bits: u (m + 1) q_s each, by Cauchy's inequality."""
    P, E = nearly_singular(share), np.zeros((3, 3))
    sigma, spread = np.sqrt(np.diag(P)), spread_of(P, R)
    E[np.tril_indices(3)] = signs
    E = exact(UNIT * (E + np.tril(E, -1).T) * np.outer(sigma, sigma))
    with localcontext() as context:
        context.prec = 80
        prior = exact(P)
        change = numbers(posterior(prior + E / Decimal(1000), exact(R)) - posterior(prior, exact(R)))
    assert (np.abs(change) <= 1.01e-3 * UNIT * 3 * spread).all()


def test_a_nearly_singular_innovation_covariance_makes_the_spread_more_than_the_prior():
    """There a change of last bits does more than to a share of the prior variance; elsewhere q is that, or less."""
    P, R = nearly_singular(1e-8), np.diag([1e-4, 1e-4])
    P[2, 1] = P[1, 2] = (1.0 + 1e-4) * P[1, 2]
    assert spread_of(P, R)[2] > 1e3 * P[2, 2]
    plain = np.diag([4.0, 9.0, 1.0])
    np.testing.assert_allclose(spread_of(plain, np.diag([8.0, 16.0])), [4.0 + 16 / 12, 9.0 + 81 / 25, 1.0])
    np.testing.assert_allclose(spread_of(plain, np.diag([1.0, 1.0])), [1 / 5, 1 / 10, 1.0])


class Halved:
    """Says half of R, and drops the second row."""

    def adapt(self, innovation, HPHt, R, rows, memory):
        changed = 0.5 * R
        changed[1, 1] = np.inf
        return changed


def test_an_update_keeps_what_was_expected_and_what_was_used():
    rng, recording = np.random.default_rng(3), recording_at_rest(duration_s=2.0, imu_rate_hz=50)
    timeline = build_timeline(recording, level_attitude(recording))
    root = rng.normal(size=(6, 6))
    HPHt, x = root @ root.T, rng.normal(size=6)
    updates = AdaptedUpdates(timeline, Halved())

    y, R, rows = updates.take(0, lambda z, rows: (z - x[rows], HPHt[np.ix_(rows, rows)]))

    z, told = timeline.measurements.z[0], timeline.measurements.R[0]
    kept = [0, 2, 3, 4, 5]
    np.testing.assert_array_equal(rows, kept)
    np.testing.assert_array_equal(y, (z - x)[kept])
    np.testing.assert_array_equal(R, 0.5 * told[np.ix_(kept, kept)])
    seen, few = updates.recorder.estimate().updates, np.ix_(kept, kept)
    assert seen.nis[0] == pytest.approx((z - x) @ np.linalg.inv(HPHt + told) @ (z - x), rel=1e-9)
    assert seen.nis_used[0] == pytest.approx(y @ np.linalg.inv(HPHt[few] + 0.5 * told[few]) @ y, rel=1e-9)
    assert seen.log_det[0] == pytest.approx(np.log(np.linalg.det(HPHt + told)), rel=1e-9)
