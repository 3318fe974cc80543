"""The factor, the memory and the gross errors of receivers that are made with known ones, and of the given ones."""

import numpy as np
import pytest

from commands import verb
from jerkbench.inspection.receiver import receiver_errors
from jerkbench.recording import Position, Recording, Reference

STEP_S, ROWS = 0.2, 6000


def receiver(factor, memory_s=0.0, gross=(), *, truth=True, sigma_m=(0.02, 0.02, 0.04)):
    """Fixes on a circle whose errors are ``factor`` times what they declare: white, or a Gauss-Markov process."""
    draw, t_s = np.random.default_rng(5), STEP_S * np.arange(ROWS)
    way_m = np.column_stack([80 * np.cos(t_s / 40), 80 * np.sin(t_s / 40), 0 * t_s])
    phi = np.exp(-STEP_S / memory_s) if memory_s else 0.0
    error = draw.normal(size=(ROWS, 3))
    for k in range(1, ROWS):
        error[k] = phi * error[k - 1] + np.sqrt(1 - phi**2) * error[k]
    error = factor * error * sigma_m + [0.0, 0.3, 0.0]
    error[list(gross)] += 100 * np.asarray(sigma_m) * factor
    covariance = np.tile(np.diag(np.square(sigma_m)), (ROWS, 1, 1))
    position = Position(t_s, way_m + error, covariance)
    reference = Reference(t_s, "a circle", independent=True, enu_m=way_m if truth else position.enu_m)
    return Recording("receiver", None, reference, position)


@pytest.mark.parametrize("factor", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("truth", [True, False])
def test_the_factor_is_found(factor, truth):
    errors = receiver_errors(receiver(factor, truth=truth))

    for axis in errors.overall:
        assert axis.factor == pytest.approx(factor, rel=0.2)
    assert (errors.source == "a circle") == truth


def test_an_offset_and_gross_errors_do_not_change_the_factor_and_are_counted():
    errors = receiver_errors(receiver(3.0, gross=range(100, 6000, 100)))

    assert [axis.factor for axis in errors.overall] == pytest.approx([3.0] * 3, rel=0.05)
    assert [axis.gross_percent for axis in errors.overall] == pytest.approx([100 * 59 / 6000] * 3, abs=0.02)
    assert [axis.bias_m for axis in errors.overall] == pytest.approx([0.0, 0.3, 0.0], abs=0.01)


@pytest.mark.parametrize("memory_s", [1.0, 5.0])
def test_the_memory_of_a_gauss_markov_error_is_its_time_constant(memory_s):
    assert receiver_errors(receiver(1.0, memory_s)).memory_s == pytest.approx([memory_s] * 3, rel=0.2)


def test_white_errors_have_none():
    assert (receiver_errors(receiver(1.0)).memory_s < STEP_S).all()


def test_the_levels_of_the_declared_sigma_stand_apart():
    recording = receiver(1.0)
    covariance = recording.position.covariance_m2.copy()
    covariance[:3000] *= 100.0**2
    position = Position(recording.position.t_s, recording.position.enu_m, covariance)
    errors = receiver_errors(Recording("receiver", None, recording.reference, position))
    factors = {axis.level: axis.factor for axis in errors.axes if axis.axis == "east"}

    assert factors["below 0.05 m"] == pytest.approx(1.0, rel=0.05)
    assert factors["below 5 m"] == pytest.approx(0.01, rel=0.05)


def test_the_verb_says_what_to_put_into_a_filter(tmp_path):
    done = verb("data", "receiver", "field_white", "--set", "duration_s=60", cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert "robot_localization, fusioncore: multiply the covariance in the message by" in done.stdout


def test_fixes_that_are_too_few_are_a_sentence(tmp_path):
    done = verb("data", "receiver", "field_white", "--set", "duration_s=3", cwd=tmp_path)

    assert (done.returncode, "too few fixes" in done.stderr) == (2, True)
