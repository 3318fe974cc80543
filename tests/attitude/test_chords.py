"""Courses between fixes: how sure, which pairs, and none where nothing moves."""

import numpy as np
import pytest

from jerkbench.attitude.yaw import FINE_RAD, MAX_CHORD_S, chords_of
from jerkbench.recording import Position


def fixes(t_s, enu_m, covariance):
    covariance = np.asarray(covariance, dtype=float)
    return Position(t_s, enu_m, np.tile(covariance, (len(t_s), 1, 1)) if covariance.ndim == 2 else covariance)


def along_east(speed_mps, sigma_m, duration_s=20.0, rate_hz=5.0, noise_m=0.0):
    t_s = np.arange(round(duration_s * rate_hz) + 1) / rate_hz
    enu_m = np.column_stack([speed_mps * t_s, 0 * t_s, 0 * t_s])
    enu_m += noise_m * np.random.default_rng(0).normal(size=enu_m.shape)
    return fixes(t_s, enu_m, sigma_m**2 * np.eye(3))


def test_the_sigma_is_that_of_sampled_courses():
    first, second = np.diag([0.4, 0.1, 9.0]), np.array([[0.2, 0.1, 0.0], [0.1, 0.3, 0.0], [0.0, 0.0, 9.0]])
    way = np.array([60.0, -40.0])
    chords = chords_of(fixes([1.0, 3.0], [[0.0, 0.0, 0.0], [*way, 5.0]], np.array([first, second])), 0.0, 9.0)
    rng = np.random.default_rng(1)
    noise = [rng.multivariate_normal([0, 0], R[:2, :2], 100_000) for R in (first, second)]
    ways = way + noise[1] - noise[0]

    assert chords.way_m.tolist() == [way.tolist()]
    assert chords.sigma_rad[0] == pytest.approx(np.arctan2(ways[:, 1], ways[:, 0]).std(), rel=0.01)


@pytest.mark.parametrize(("speed_mps", "sigma_m"), [(10.0, 0.4), (1.5, 0.02), (20.0, 3.0)])
def test_chords_are_as_short_as_their_courses_are_sure_and_none_overlaps(speed_mps, sigma_m):
    chords = chords_of(along_east(speed_mps, sigma_m, duration_s=60.0), 0.0, 60.0)
    needed_s = max(np.sqrt(2) * sigma_m / (FINE_RAD * speed_mps), 1.0 / speed_mps)

    assert (chords.begin_s[1:] >= chords.end_s[:-1]).all()
    assert (chords.sigma_rad <= FINE_RAD).all()
    np.testing.assert_allclose(chords.end_s - chords.begin_s, np.ceil(needed_s * 5.0 - 1e-9) / 5.0)


def test_after_a_rest_the_first_chord_begins_where_it_drives_off():
    t_s = np.arange(0.0, 30.0, 0.2)
    driven = 5.0 * np.maximum(t_s - 20.0, 0.0)
    chords = chords_of(fixes(t_s, np.column_stack([driven, 0 * t_s, 0 * t_s]), 0.04 * np.eye(3)), 0.0, 30.0)

    assert 19.9 <= chords.begin_s[0] < chords.end_s[0] < 21.5


@pytest.mark.parametrize("sigma_m", [0.01, 0.4, 5.0])
def test_fixes_at_rest_show_no_course(sigma_m):
    position = along_east(0.0, sigma_m, duration_s=2000.0, noise_m=sigma_m)

    assert len(chords_of(position, 0.0, 2000.0).end_s) == 0


def test_a_walk_under_noisy_fixes_shows_a_coarse_course_now_and_then():
    chords = chords_of(along_east(1.4, 3.0, duration_s=120.0), 0.0, 120.0)

    assert 2 <= len(chords.end_s) <= 4
    assert (chords.end_s - chords.begin_s <= MAX_CHORD_S).all()
    np.testing.assert_allclose(chords.sigma_rad, np.sqrt(2) * 3.0 / (1.4 * (chords.end_s - chords.begin_s)))


def test_fixes_that_are_not_whole_or_beside_the_imu_do_not_count():
    position = along_east(10.0, 0.01)
    enu_m = position.enu_m.copy()
    enu_m[::2, 1] = np.nan
    chords = chords_of(fixes(position.t_s, enu_m, 1e-4 * np.eye(3)), 3.1, 8.1)

    ends = np.round(np.concatenate([chords.begin_s, chords.end_s]) * 5.0).astype(int)
    assert (ends % 2 == 1).all()
    assert chords.begin_s[0] >= 3.1
    assert chords.end_s[-1] <= 8.1
    assert len(chords_of(None, 0.0, 1.0).end_s) == len(chords_of(position, 30.0, 40.0).end_s) == 0
