"""The noise of a recording compared with what it states."""

import dataclasses

import numpy as np
import pytest
from given import kitti

from jerkbench.inspection.diagnostics import diagnoses, first_diagnoses
from jerkbench.inspection.facts import findings_text
from jerkbench.inspection.noise import _REFERENCE, REST, stated_against_real_sigma
from jerkbench.recording import Position, Reference, Velocity
from synthetic import recording_at_rest


def noisy(real_m=0.02, stated_m=0.01):
    recording = recording_at_rest(400.0, imu_rate_hz=10)
    rng = np.random.default_rng(3)
    fix = recording.position.t_s
    n = len(fix)
    position = Position(fix, real_m * rng.normal(size=(n, 3)), np.tile(stated_m**2 * np.eye(3), (n, 1, 1)))
    velocity = Velocity(fix, 0.03 * rng.normal(size=(n, 3)), np.tile(0.03**2 * np.eye(3), (n, 1, 1)))
    return dataclasses.replace(recording, position=position, velocity=velocity, static_start_s=200.0)


def test_the_ratio_is_that_of_the_noise_that_was_drawn():
    found = {(one.stream, one.basis): one for one in stated_against_real_sigma(noisy())}

    assert set(found) == {(stream, basis) for stream in ("position", "velocity") for basis in (REST, _REFERENCE)}
    assert found["position", REST].ratio == pytest.approx(2.0, rel=0.05)
    assert found["position", _REFERENCE].ratio == pytest.approx(2.0, rel=0.03)
    assert found["velocity", _REFERENCE].ratio == pytest.approx(1.0, rel=0.03)
    np.testing.assert_allclose(found["position", _REFERENCE].real, 0.02, rtol=0.06)
    np.testing.assert_allclose(found["position", _REFERENCE].stated, 0.01)


def test_axes_in_rows_of_their_own_are_the_same():
    """As where horizontal and vertical velocities have different latencies."""
    recording = noisy()
    velocity = recording.velocity
    t_s = np.sort(np.concatenate([velocity.t_s, velocity.t_s + 0.01]))
    mps = np.repeat(velocity.mps, 2, axis=0)
    mps[::2, 2], mps[1::2, :2] = np.nan, np.nan
    apart = dataclasses.replace(recording, velocity=Velocity(t_s, mps, np.repeat(velocity.covariance_m2ps2, 2, axis=0)))
    (whole,) = (one for one in stated_against_real_sigma(recording) if (one.stream, one.basis) == ("velocity", REST))
    (split,) = (one for one in stated_against_real_sigma(apart) if (one.stream, one.basis) == ("velocity", REST))
    np.testing.assert_allclose(split.real, whole.real, rtol=1e-2)
    assert split.ratio == pytest.approx(whole.ratio, rel=1e-2)
    np.testing.assert_allclose(split.stated, 0.03)


def test_fixes_that_are_the_reference_themselves_say_nothing():
    recording = noisy()
    position = recording.position
    same = Reference(position.t_s, "the fixes", independent=False, enu_m=position.enu_m)
    assert (
        stated_against_real_sigma(dataclasses.replace(recording, reference=same, velocity=None, static_start_s=0.0))
        == []
    )


def test_a_reference_with_holes_is_not_bridged():
    recording = noisy()
    coarse = Reference(np.arange(0, 400, 2.0), "coarse", independent=True, enu_m=np.zeros((200, 3)))
    assert stated_against_real_sigma(dataclasses.replace(recording, reference=coarse, static_start_s=0.0)) == []


@pytest.mark.parametrize(("stated_m", "told"), [(4.84, True), (0.3, False), (0.087, False)])
def test_sigmas_that_may_be_too_large_are_told(stated_m, told):
    """At a rest that only the IMU shows; without a reference, as most users have it."""
    nothing = Reference(np.array([0.0]), "none", independent=False)
    recording = dataclasses.replace(noisy(0.087, stated_m), reference=nothing, velocity=None, static_start_s=0.0)
    text = findings_text(recording)
    assert diagnoses(recording) == []
    assert ("to check: The standard deviations of position may be too large" in text) == told
    if told:
        assert "stated 4.84 m, measured 0.087 m" in text
        assert "the scatter at rest" in text
        assert "multiply them by 0.018: r_scale.position=0.00033" in text


def test_a_slow_error_that_the_reference_shows_is_no_sigma_that_is_too_large():
    recording = noisy(0.087, 4.84)
    position = recording.position
    slow = dataclasses.replace(position, enu_m=position.enu_m + 4.0)
    assert "too large" in findings_text(dataclasses.replace(recording, velocity=None))
    assert "too large" not in findings_text(dataclasses.replace(recording, position=slow, velocity=None))


@pytest.mark.parametrize(("sigma_m", "stated", "told"), [(0.02, 1.0, False), (0.3, 0.1, True), (0.3, 1.0, False)])
@pytest.mark.parametrize("name", ["2011_09_29_drive_0004", "2011_09_30_drive_0034", "2011_10_03_drive_0047"])
def test_the_bends_of_a_road_are_no_noise(shared_folder, name, sigma_m, stated, told):
    """Fixes at 1 Hz as good as RTK's differ from row to row by what the car does, and their sigmas are right."""
    if not (shared_folder / "data" / "kitti").exists():
        pytest.skip("kitti is not in ../shared/data")
    white = kitti(shared_folder / "data", name)
    exact = kitti(shared_folder / "data", name, noise=0.0).position.enu_m
    enu_m = exact + (white.position.enu_m - exact) * sigma_m / 0.3
    covariance = white.position.covariance_m2 * (sigma_m / 0.3 * stated) ** 2
    position = dataclasses.replace(white.position, enu_m=enu_m, covariance_m2=covariance)
    found = first_diagnoses(dataclasses.replace(white, position=position))
    assert [one.name for one in found] == (["sd of position too small"] if told else [])
    if told:
        assert "Multiply them by 1" in found[0].remedy  # by 10 to 19
