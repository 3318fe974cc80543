"""The update of an invariant error: the correction on the group SE_2(3), and the covariance of what is left.

The error is eta = X Xh^-1 = Exp(xi), truth over estimate, of X = [[C, v, p], [0, 1, 0], [0, 0, 1]]; xi = [phi, rho, pi]
is the additive error dx of `jerkbench.inertial.state` in other numbers, to the first order::

    T:  phi = phi;  rho = dv + [vh] phi;  pi = dp + [ph] phi

so that both have the same gain. What follows a correction differs: it goes in by the exponential of the group, and the
covariance of xi, not that of dx, stays as it is. Biases, and what else is known of the sensors, are additive.
"""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inertial.rotation import left_jacobian, orthonormal, rotation_exp, skew
from jerkbench.inertial.state import (
    BA,
    BG,
    MA,
    MG,
    PHI,
    Deformation,
    NavigationState,
    P,
    V,
    has_deformation,
    has_wheel,
)


def corrected_on_group(state: NavigationState, dx: FloatArray) -> NavigationState:
    """Return ``state`` with the estimated error dx (n,), n as in `error_states`, put into it: Exp(T dx) Xh.

    With the left Jacobian J of phi, for which J [phi] = Exp(phi) - I::

        C+ = Exp(phi) Ch;  v+ = Exp(phi) vh + J rho = vh + J dv;  p+ = Exp(phi) ph + J pi = ph + J dp

    so that it does not matter where the origin lies.
    """
    J, deformation = left_jacobian(dx[PHI]), state.deformation
    if has_deformation(len(dx)):
        known = deformation or Deformation(np.zeros((3, 3)), np.zeros((3, 3)))
        deformation = Deformation(known.gyro + dx[MG].reshape(3, 3).T, known.accel + dx[MA].reshape(3, 3).T)
    return NavigationState(
        state.position_m + J @ dx[P],
        state.velocity_mps + J @ dx[V],
        orthonormal(rotation_exp(dx[PHI]) @ state.dcm),
        state.gyro_bias_radps + dx[BG],
        state.accel_bias_mps2 + dx[BA],
        deformation,
        state.wheel_scale + float(dx[-1]) if has_wheel(len(dx)) else state.wheel_scale,
    )


def reset_on_group(before: NavigationState, after: NavigationState, states: int) -> FloatArray:
    """Return G (n, n) = T(after)^-1 T(before), from an additive error of ``before`` to the same xi as ``after`` has it.

    dp+ = dp - [p+ - p] phi;  dv+ = dv - [v+ - v] phi.
    """
    G = np.eye(states)
    G[P, PHI] = -skew(after.position_m - before.position_m)
    G[V, PHI] = -skew(after.velocity_mps - before.velocity_mps)
    return G
