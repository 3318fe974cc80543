"""The compiled inertial navigation against the NumPy one, over all switches and adaptations."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from engine_agreement import agree_runs, assert_batch_agrees, with_a_negative_variance, with_other_last_bits
from jerkbench import plugins
from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.filters.common import adaptations_of_r
from jerkbench.filters.eskf15 import Eskf15, InvariantEkf
from jerkbench.inertial.compiled_runs import solve_compiled
from jerkbench.inertial.run import InertialRun
from jerkbench.recording import Velocity
from synthetic import body_velocity, with_true_headings

BURN_IN_S = 2.0

ARMS = {"antenna_m": (0.3, -0.2, 1.1), "reference_point_m": (-0.4, 0.1, 0.2)}
HELD = {"zero_velocity": True, "nonholonomic": True, "nonholonomic_point_m": (-0.5, 0.0, -0.3)}
EARTH = {"earth_rotation": True, "earth_curvature": True, "gyro_bias_from_rest": False}

CASES = {
    "as it comes": ("enu", {}),
    "lever arms": ("enu", ARMS),
    "velocity of the body": ("body", ARMS),
    "heading": ("heading", {}),
    "heading not used": ("heading", {"use_heading": False}),
    "held": ("enu", HELD),
    "held without velocity": ("enu", {**HELD, "use_velocity": False, "position_sigma_m": 0.02}),
    "earth": ("enu", EARTH),
    "constant biases": ("enu", {"gyro_instability_deg_per_h": 0.0, "accel_instability_mg": 0.0}),
    "yaw of the track": ("enu", {"yaw_source": "track"}),
    "wheel": ("speed", {"nonholonomic_point_m": (-0.5, 0.2, -0.3)}),
    "wheel's scale": ("speed", {"wheel_scale": True, **HELD}),
    "all with headings": ("heading", {**ARMS, **HELD, **EARTH}),
    "all with a wheel": ("speed", {**ARMS, **HELD, "wheel_scale": True}),
}


@cache
def recorded(kind):
    """A drive of the simulated robot with one way to measure velocity or heading."""
    recording = FieldWhite(duration_s=10.0).load(3)
    if kind == "heading":
        recording = with_true_headings(recording)
    elif kind == "body":
        recording = replace(recording, velocity=replace(recording.velocity, frame="body", mps=body_velocity(recording)))
    elif kind == "speed":
        speed = Velocity.along_course(recording.velocity.t_s, 1.03 * body_velocity(recording)[:, 0], 0.03)
        recording = replace(recording, velocity=speed)
    return recording, Tilt().estimate(recording)


def reference_run(journey, adaptation):
    return InertialRun(journey, adaptation).solve()


class RoundedRun(InertialRun):
    """The definition where each step's products of P round otherwise, by up to two units of sqrt(P_ii P_jj).

    So do those of another processor's linear algebra: that, and not the inputs, is what covariances differ by.
    """

    def __init__(self, seed, journey, adaptation):
        super().__init__(journey, adaptation)
        self.rng = np.random.default_rng(seed)

    def _propagate_covariance(self, Phi, Q):
        super()._propagate_covariance(Phi, Q)
        sigma = np.sqrt(np.diag(self.P))
        units = np.tril(self.rng.integers(-1, 2, self.P.shape))
        self.P = self.P + 2.0 * np.finfo(float).eps * np.outer(sigma, sigma) * (units + np.tril(units, -1).T)


def with_other_inputs(journey, seed):
    """Measurements, samples of the IMU and covariance at the start, changed in their last bits.

    The gyro changes by what turns the attitude by its last bits in a step: there each step rounds, not in the rate.
    """
    rng, (state, P) = np.random.default_rng(seed), journey.start
    turns = 2.0 * np.finfo(float).eps * rng.integers(-1, 2, journey.imu.gyro_radps.shape)

    def other(array):
        return array * (1.0 + 4.0 * np.finfo(float).eps / 2 * rng.integers(-1, 2, array.shape))

    half = np.tril(other(P))
    imu = replace(
        journey.imu, accel_mps2=other(journey.imu.accel_mps2), gyro_radps=journey.imu.gyro_radps + turns / 0.01
    )
    timeline = with_other_last_bits(journey.timeline, seed)
    return journey._replace(imu=imu, timeline=timeline, start=(state, half + np.tril(half, -1).T))


def compare(kind, fields, adaptation, model=Eskf15):
    recording, attitude = recorded(kind)
    journey = model(**fields).inputs(recording, attitude)
    wanted = reference_run(journey, adaptation)
    got = solve_compiled(journey, adaptation)

    @cache
    def changed(seed):
        other = with_other_inputs(journey, seed)
        return RoundedRun(seed, other, adaptation).solve().estimate

    agreement = agree_runs(journey.timeline, got.estimate, wanted.estimate, changed)
    if agreement.flip is None:
        np.testing.assert_allclose(got.estimate.euler_rad, wanted.estimate.euler_rad, rtol=0.0, atol=1e-9)
        for mine, theirs in zip(got.state[:5], wanted.state[:5], strict=True):
            np.testing.assert_allclose(mine, theirs, rtol=1e-7, atol=1e-9)
        if wanted.state.wheel_scale is not None:
            assert got.state.wheel_scale == pytest.approx(wanted.state.wheel_scale, abs=1e-9)
            assert abs(wanted.state.wheel_scale) > 1e-3
        sigma = np.sqrt(np.diag(wanted.covariance))
        assert np.abs((got.covariance - wanted.covariance) / np.outer(sigma, sigma)).max() < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "fields"), CASES.values(), ids=CASES)
def test_it_agrees_with_numpy_with_each_switch(kind, fields):
    compare(kind, fields, Mtf())


@pytest.mark.slow
@pytest.mark.parametrize("case", ["as it comes", "lever arms", "heading", "wheel's scale", "all with a wheel"])
def test_the_invariant_one_agrees_with_numpy_too(case):
    kind, fields = CASES[case]
    compare(kind, {**fields, "initial_yaw_sigma_rad": 0.5}, Mtf(), InvariantEkf)


@pytest.mark.parametrize("name", adaptations_of_r())
def test_it_agrees_with_numpy_with_each_adaptation(name):
    compare("enu", {}, plugins.create("adaptation", {"name": name}))


def test_it_stops_where_numpy_stops():
    recording, attitude = recorded("enu")
    journey = Eskf15().inputs(recording, attitude)
    journey = journey._replace(timeline=with_a_negative_variance(journey.timeline, 40))
    wanted = reference_run(journey, NoAdaptation()).estimate
    got = solve_compiled(journey, NoAdaptation()).estimate

    assert wanted.failure
    assert got.failure == wanted.failure
    np.testing.assert_array_equal(got.index, wanted.index)


@pytest.mark.parametrize("case", ["lever arms", "heading"])
def test_the_sums_of_a_batch_agree_with_the_trajectories(case):
    kind, fields = CASES[case]
    assert_batch_agrees([Eskf15(**fields)] * 2, *recorded(kind), Mtf(), BURN_IN_S)
