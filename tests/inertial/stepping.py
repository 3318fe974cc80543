"""One step at a time."""

import numpy as np

from jerkbench.inertial.state import advance_navigation, calibrated
from jerkbench.inertial.state import transition as transitions


def mechanise(state, accel_mps2, gyro_radps, dt_s, earth):
    """The state after a step from what the sensors show, C and the force in its middle."""
    sensed = calibrated(state, accel_mps2[None], gyro_radps[None])
    to = advance_navigation(state, *sensed, np.array([dt_s]), earth)
    after = state._replace(position_m=to.position_m[0], velocity_mps=to.velocity_mps[0], dcm=to.dcm[0])
    return after, to.mean_dcm[0], to.force_enu_mps2[0]


def transition(dt_s, dcm, force, states=15):
    """Phi of one step."""
    return transitions(np.array([dt_s]), dcm[None], force[None], states)[0]
