"""Allan deviations compared with closed forms (IEEE Std 952), and the overview of a recording."""

import dataclasses

import numpy as np
import pytest

from jerkbench.datasets.field import FieldWhite
from jerkbench.inspection.facts import findings_text, overview_figure
from jerkbench.inspection.noise import allan_deviation, longest_rest, rest_noise
from jerkbench.recording import Imu, Position, Recording, Reference, Velocity
from jerkbench.simulation.sensors import GRADES
from synthetic import recording_at_rest


def naive(samples, interval_s, j):
    """The definition: differences of successive means over j samples, from every start."""
    means = [samples[i : i + j].mean() for i in range(len(samples) - j + 1)]
    return np.sqrt(np.mean([(means[i + j] - means[i]) ** 2 for i in range(len(means) - j)]) / 2)


def test_it_is_the_definition():
    samples = np.random.default_rng(0).normal(size=(200, 1)).cumsum(axis=0)
    tau_s, deviation = allan_deviation(samples, 0.1)
    for k in (0, 5, len(tau_s) - 1):
        assert deviation[k, 0] == pytest.approx(naive(samples[:, 0], 0.1, round(tau_s[k] / 0.1)), rel=1e-9)


def test_white_noise_falls_and_a_random_walk_rises_with_the_root():
    rng = np.random.default_rng(1)
    white = 0.3 * rng.normal(size=(100_000, 1)) / np.sqrt(0.01)  # N = 0.3
    walk = np.cumsum(0.2 * np.sqrt(0.01) * rng.normal(size=(100_000, 1)), axis=0)  # K = 0.2
    tau_s, deviation = allan_deviation(white, 0.01)
    short = tau_s < 5
    np.testing.assert_allclose(deviation[short, 0], 0.3 / np.sqrt(tau_s[short]), rtol=0.1)
    tau_s, deviation = allan_deviation(walk, 0.01)
    middle = (tau_s > 0.1) & (tau_s < 5)
    np.testing.assert_allclose(deviation[middle, 0], 0.2 * np.sqrt(tau_s[middle] / 3), rtol=0.15)


@pytest.mark.parametrize("grade", list(GRADES))
def test_the_grade_of_a_simulated_imu_is_found(grade):
    noise = rest_noise(FieldWhite(imu=grade, stand_s=40.0, duration_s=60.0).load(1))
    stated = GRADES[grade]
    assert noise.grade == grade
    assert noise.angle_random_walk_deg_per_sqrt_h == pytest.approx(stated.angle_random_walk_deg_per_sqrt_h, rel=0.2)
    assert noise.velocity_random_walk_mps_per_sqrt_h == pytest.approx(
        stated.velocity_random_walk_mps_per_sqrt_h, rel=0.2
    )
    assert np.isnan(noise.gyro_instability_deg_per_h)


def test_a_long_rest_shows_the_instability_as_well():
    recording = FieldWhite(imu="consumer", stand_s=70.0, duration_s=90.0).load(1)
    noise = rest_noise(recording)
    at_rest = recording.imu.gyro_radps[recording.imu.t_s < recording.imu.t_s[0] + 70.0]
    _, deviation = allan_deviation(at_rest, recording.imu.nominal_interval_s)
    lowest = np.degrees(deviation.min(axis=0).max()) * 3600
    assert noise.gyro_instability_deg_per_h == pytest.approx(lowest / 0.664)
    assert rest_noise(dataclasses.replace(recording, static_start_s=4.0)) is None


def halting(begin_s, end_s, *, fixes_stop=True):
    """A minute of shaking, and a rest in it; the fixes move at 10 m/s but, as a rule, in the rest."""
    draw, t_s = np.random.default_rng(0), np.arange(0.01, 60.0, 0.01)
    loud = np.where((t_s >= begin_s) & (t_s < end_s), 0.01, 1.0)[:, None]
    force, rate = (loud * draw.normal(size=(len(t_s), 3)) for _ in range(2))
    imu = Imu(t_s, force + np.array([0.0, 0.0, 9.81]), 0.1 * rate)
    fix_s = np.arange(0.0, 60.0, 1.0)
    driven_s = np.where(fix_s < begin_s, fix_s, np.maximum(begin_s, fix_s - (end_s - begin_s))) if fixes_stop else fix_s
    position = Position(fix_s, np.outer(10.0 * driven_s, [1.0, 0.0, 0.0]), np.tile(np.eye(3), (len(fix_s), 1, 1)))
    return Recording("halt", imu, Reference(np.array([0.0]), "none", independent=False), position)


def test_a_rest_that_nobody_stated_is_found_in_the_imu():
    rest = longest_rest(halting(20.0, 30.0))
    assert (rest.begin_s, rest.end_s) == pytest.approx((20.5, 29.5), abs=0.1)
    assert not rest.stated
    noise = rest_noise(halting(20.0, 30.0), rest)
    assert noise.velocity_random_walk_mps_per_sqrt_h == pytest.approx(60.0 * 0.01 * np.sqrt(0.01), rel=0.2)
    assert "this rest, from 20" in findings_text(halting(20.0, 30.0))


@pytest.mark.parametrize("recording", [halting(20.0, 30.0, fixes_stop=False), halting(20.0, 24.0)])
def test_a_smooth_road_and_a_short_halt_are_no_rest(recording):
    assert longest_rest(recording) is None


def test_the_rest_that_is_stated_comes_first():
    assert longest_rest(dataclasses.replace(halting(20.0, 30.0), static_start_s=6.0))[1:] == (6.01, True)


def bare():
    recording = recording_at_rest(20.0)
    reference = Reference(np.array([1.0, 2.0]), "nothing", independent=True)
    return dataclasses.replace(recording, position=None, velocity=None, reference=reference)


def wheeled():
    recording = recording_at_rest(20.0)
    wheel = Velocity.along_course(np.arange(100) / 5.0, np.ones(100), 0.1)
    return dataclasses.replace(recording, velocity=wheel, static_start_s=20.0, outages_s=np.array([[5.0, 8.0]]))


@pytest.mark.parametrize("make", [bare, wheeled, lambda: FieldWhite(duration_s=30.0).load(0)])
def test_every_recording_can_be_drawn_and_told(make, tmp_path):
    recording = make()
    path = tmp_path / "overview.png"
    overview_figure(recording).savefig(path, dpi=40)
    assert path.stat().st_size > 5000
    assert "imu noise" in findings_text(recording)


@pytest.mark.parametrize(
    ("known_s", "told"), [(0.0, "no rest at the start is stated"), (3.0, "the stated rest at the start is 3.0 s")]
)
def test_a_rest_that_nobody_stated_is_not_denied(known_s, told):
    """It stands still for 20 s; all that is certain is what is known of it."""
    text = findings_text(dataclasses.replace(recording_at_rest(20.0), static_start_s=known_s))
    assert told in text
    assert "set static_start_s" in text
    assert "imu noise over 20 s of rest" in findings_text(recording_at_rest(20.0, static_start_s=20.0))


def test_the_panels_show_the_recording():
    recording = FieldWhite(duration_s=30.0).load(0)
    figure = overview_figure(recording)
    track = {line.get_label(): line.get_xydata() for line in figure.axes[0].lines}
    np.testing.assert_array_equal(track["measured"], recording.position.enu_m[:, :2])
    np.testing.assert_array_equal(track["reference"], recording.reference.enu_m[:, :2])
    force = {line.get_label(): line.get_ydata() for line in figure.axes[2].lines}
    assert np.mean(force["up"]) == pytest.approx(9.81, abs=0.05)
