"""The filter `constant_turn` against circles, finite differences, and the filter `constant_velocity`."""

import dataclasses

import numpy as np
import pytest

from jerkbench import plugins
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.estimate import no_attitude
from jerkbench.filters.constant_turn import ConstantTurn, after_turn, turn_jacobian
from jerkbench.filters.kinematic import ConstantVelocity
from jerkbench.plugins.checks import check_plugin
from jerkbench.recording import Position, Recording, Reference
from jerkbench.timeline import build_timeline

NONE = plugins.create("adaptation", {"name": "none"})


def circle(t_s, radius_m=80.0, rate_radps=0.1):
    angle = rate_radps * t_s
    return np.column_stack([radius_m * np.sin(angle), radius_m * (1 - np.cos(angle)), 0.2 * t_s])


def recording(fixes_s, reference_s):
    position = Position(fixes_s, circle(fixes_s), np.tile(1e-4 * np.eye(3), (len(fixes_s), 1, 1)))
    reference = Reference(reference_s, "a circle", independent=True, enu_m=circle(reference_s))
    return Recording("circle", None, reference, position)


@pytest.mark.parametrize("dt", [0.2, 3.0])
@pytest.mark.parametrize("w", [0.0, 1e-9, -3e-5, 0.1, -0.6])
def test_a_step_is_an_arc_and_its_jacobian_agrees_with_differences(w, dt):
    x = np.array([5.0, -3.0, 1.0, 7.0, 2.0, -0.5, w])
    start = x[3] + 1j * x[4]
    fine = (np.arange(20000) + 0.5) * dt / 20000
    moved = np.sum(start * np.exp(1j * w * fine)) * dt / 20000  # the velocity, integrated
    arrived = after_turn(x, dt)
    np.testing.assert_allclose(arrived[:2] - x[:2], [moved.real, moved.imag], atol=1e-7)
    np.testing.assert_allclose(np.hypot(*arrived[3:5]), abs(start))
    assert arrived[2] == pytest.approx(1.0 - 0.5 * dt)
    steps = 1e-6 * np.eye(7)
    differences = np.column_stack([(after_turn(x + h, dt) - after_turn(x - h, dt)) / 2e-6 for h in steps])
    np.testing.assert_allclose(turn_jacobian(x, dt), differences, atol=1e-6)


def test_a_turn_continues_through_a_gap():
    fixes_s = np.concatenate([np.arange(0.0, 40.0), np.arange(60.0, 80.0)])
    drive = recording(fixes_s, np.arange(0.0, 60.0, 0.5))
    attitude = no_attitude(drive.clock_s)
    turn = ConstantTurn(0.1, 0.005).estimate(drive, attitude, NONE)
    straight = FilterpyEngine().run(build_timeline(drive, attitude), ConstantVelocity(0.1), NONE)
    at_50_s = 100

    def error(estimate):
        return np.linalg.norm(estimate.position_m[at_50_s] - circle(np.array([50.0]))[0])

    assert error(turn) < 0.1 * error(straight)


def test_without_a_turn_it_equals_constant_velocity():
    drive = recording(np.arange(0.0, 20.0), np.arange(0.0, 19.0, 0.25))
    attitude = no_attitude(drive.clock_s)
    turn = ConstantTurn(1.5, 0.0, 0.0).estimate(drive, attitude, NONE)
    straight = FilterpyEngine().run(build_timeline(drive, attitude), ConstantVelocity(1.5), NONE)
    np.testing.assert_allclose(turn.position_m, straight.position_m, atol=1e-9)
    np.testing.assert_allclose(turn.covariance, straight.covariance, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(turn.updates.nis, straight.updates.nis, rtol=1e-6)


def test_it_supports_every_adaptation_that_does_not_fade():
    check_plugin("filter", ConstantTurn())
    drive = recording(np.arange(0.0, 30.0), np.arange(0.0, 29.0))
    drive = dataclasses.replace(
        drive, position=dataclasses.replace(drive.position, covariance_m2=np.tile(np.eye(3), (30, 1, 1)))
    )
    for name in ConstantTurn().adaptations:
        rule = plugins.create("adaptation", {"name": name})
        assert not ConstantTurn().estimate(drive, no_attitude(drive.clock_s), rule).failure, name
