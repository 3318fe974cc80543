"""The unscented inertial navigation, against the mechanisation, scipy and eskf15."""

from dataclasses import replace

import numpy as np
import pytest

from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.field import FieldWhite
from jerkbench.errors import PluginError
from jerkbench.filters.eskf15 import Eskf15
from jerkbench.filters.ukf import Ukf
from jerkbench.recording import Velocity
from synthetic import body_velocity, with_true_headings


@pytest.fixture(scope="module")
def field():
    recording = FieldWhite(duration_s=10.0, reference_rate_hz=5.0).load(3)
    return recording, Tilt().estimate(recording)


SMALL = {"initial_yaw_sigma_rad": 0.001, "accel_turn_on_mg": 0.05, "gyro_turn_on_deg_per_h": 5.0}
"""Errors that are small enough for the navigation to be nearly linear."""


def require_like_eskf15(recording, attitude, adaptation=None, **fields):
    """Positions, velocities and covariances are those of eskf15 to a twentieth of a sigma: it is nearly linear."""
    fields = {**SMALL, **fields}
    wanted = Eskf15(**fields).estimate(recording, attitude, adaptation or NoAdaptation())
    got = Ukf(**fields).estimate(recording, attitude, adaptation or NoAdaptation())
    assert got.failure == ""
    sigma = np.sqrt(np.diagonal(wanted.covariance, axis1=1, axis2=2))
    x = [np.hstack([e.position_m, e.velocity_mps]) for e in (got, wanted)]
    assert np.abs((x[0] - x[1]) / sigma).max() < 0.05
    assert np.abs((got.covariance - wanted.covariance) / (sigma[:, :, None] * sigma[:, None, :])).max() < 0.05
    np.testing.assert_allclose(got.updates.R_diagonal, wanted.updates.R_diagonal, rtol=0.05)
    return got, wanted


def test_where_the_model_is_nearly_linear_it_is_eskf15(field):
    got, wanted = require_like_eskf15(*field)

    np.testing.assert_allclose(got.updates.nis, wanted.updates.nis, rtol=0.05, atol=0.05)
    assert (got.position_m != wanted.position_m).any()


def test_an_adaptation_sees_what_it_sees_in_eskf15(field):
    recording, attitude = field
    jump = recording.position.enu_m.copy()
    jump[30] += [3.0, 0.0, 0.0]
    jumped = replace(recording, position=replace(recording.position, enu_m=jump))
    got, _ = require_like_eskf15(jumped, attitude, Mtf())

    assert np.nanmax(got.updates.R_diagonal[:, 0]) > 4.0


def test_lever_arms_constraints_and_headings_are_those_of_eskf15(field):
    recording, attitude = field
    arms = {"antenna_m": (0.3, -0.2, 1.1), "reference_point_m": (-0.4, 0.1, 0.2)}
    held = {"zero_velocity": True, "nonholonomic": True, "nonholonomic_point_m": (-0.5, 0.0, -0.3)}

    require_like_eskf15(with_true_headings(recording), attitude, **arms, **held)


@pytest.mark.parametrize("frame", ["body", "speed"])
def test_a_velocity_of_the_body_and_of_a_wheel_too(frame):
    recording = FieldWhite(duration_s=10.0).load(3)
    truth, velocity = recording.reference, recording.velocity
    in_body = body_velocity(recording)
    shown = replace(velocity, frame="body", mps=in_body)
    if frame == "speed":
        shown = Velocity.along_course(velocity.t_s, in_body[:, 0], 0.03)
    t_s, enu_m = truth.t_s[::50], truth.enu_m[::50]
    sparse = replace(truth, t_s=t_s, enu_m=enu_m, velocity_mps=None, euler_rad=None, scored=None)
    recording = replace(recording, velocity=shown, reference=sparse)

    require_like_eskf15(recording, Tilt().estimate(recording))


def test_it_learns_a_yaw_that_is_wrong_by_sixty_degrees(field):
    recording, attitude = field
    recording = replace(recording, heading=None)
    turned = replace(attitude, euler_rad=attitude.euler_rad + np.deg2rad([0.0, 0.0, 60.0]))
    estimate = Ukf(initial_yaw_sigma_rad=1.0).estimate(recording, turned, NoAdaptation())

    off = estimate.euler_rad[-1, 2] - recording.reference.euler_rad[estimate.index[-1], 2]
    assert abs(np.remainder(off + np.pi, 2 * np.pi) - np.pi) < np.deg2rad(3.0)


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"alpha": 0.0}, "above 0 and at most 1"),
        ({"kappa": -15.0}, "above -15"),
        ({"wheel_scale": True}, "ukf does not support this parameter"),
    ],
)
def test_a_wrong_parameter_is_a_sentence(parameters, sentence):
    with pytest.raises(PluginError, match=sentence):
        Ukf(**parameters)
