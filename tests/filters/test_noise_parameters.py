"""Noise parameters: each standard deviation and density is a finite number, not negative, in every filter."""

import dataclasses
import math
from typing import get_type_hints

import pytest

from jerkbench import plugins
from jerkbench.errors import PluginError

NO_NOISES = ("first_stays", "second_stays", "first_probability", "correlation")
KINEMATIC = ("acceleration", "baseline", "bias", "constant_turn", "constant_velocity", "imm", "jerk", "okf", "rts")


def noises(name):
    """The fields of a filter that are noises."""
    cls = plugins.get("filter", name)
    types = get_type_hints(cls)
    return [f.name for f in dataclasses.fields(cls) if types[f.name] is float and f.name not in NO_NOISES]


SIGMAS = (
    *("angle_random_walk_deg_per_sqrt_h", "velocity_random_walk_mps_per_sqrt_h"),
    *("gyro_instability_deg_per_h", "accel_instability_mg", "gyro_turn_on_deg_per_h", "accel_turn_on_mg"),
    *("initial_yaw_sigma_rad", "zero_velocity_sigma_mps", "nonholonomic_sigma_mps", "wheel_scale_sigma"),
)
EVERY = [(name, field) for name in KINEMATIC for field in noises(name)]
EVERY += [("eskf15", field) for field in (*SIGMAS, "position_sigma_m")]


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
@pytest.mark.parametrize(("name", "field"), EVERY)
def test_it_is_refused_with_a_sentence_that_names_it(name, field, value):
    with pytest.raises(PluginError, match=rf"{name}\b.*\b{field} is {value}; it must be "):
        plugins.create("filter", {"name": name, field: value})


def test_no_kinematic_filter_is_forgotten():
    kinematic = {name for name in plugins.names("filter") if hasattr(plugins.get("filter", name), "axis_model")}
    assert kinematic <= set(KINEMATIC)


def test_a_time_may_be_infinite():
    """A bias with an infinite correlation time is constant."""
    model = plugins.create("filter", {"name": "eskf15", "gyro_correlation_s": math.inf})
    assert model.sensor_noise().gyro_bias == 0.0
