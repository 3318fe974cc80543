"""The measurement update of the error state."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inertial.error_model import by_column
from jerkbench.inertial.rotation import skew
from jerkbench.inertial.state import BA, MA, PHI, NavigationState, has_deformation
from jerkbench.recording import GRAVITY_MPS2

UP_MPS2 = np.array([0.0, 0.0, GRAVITY_MPS2])
"""a, the force that holds the body up, in ENU."""


def carried_over(covariance: FloatArray, G: FloatArray) -> FloatArray:
    """Return G P G', symmetrised: the covariance of an error that has other numbers after a correction."""
    carried = G @ covariance @ G.T
    return np.asarray(0.5 * (carried + carried.T))


def reset(before: NavigationState, after: NavigationState, turn_rad: FloatArray, states: int) -> FloatArray:
    """Return G (n, n), from an error of ``before`` that the correction has left, to the same one as ``after`` has it.

    The same error has other numbers there. With a the force that holds the body up::

        phi+ = (I + [turn]/2) phi;  db_a+ = C+' C (db_a + dM_a C' a) - dM_a C+' a + C+' ((phi+ - phi) x a)

    so that the error of that force in ENU, phi x a - C (db_a + dM_a C' a), stays what it is: levelling has made it
    known well, while tilt and bias are not. That a correction changes the force itself is left out.
    """
    G = np.eye(states)
    half = 0.5 * skew(turn_rad)
    back = after.dcm.T @ before.dcm
    G[PHI, PHI] += half
    G[BA, BA] = back
    G[BA, PHI] = -after.dcm.T @ skew(UP_MPS2) @ half
    if has_deformation(states):
        G[BA, MA] = by_column(back, before.dcm.T @ UP_MPS2) - by_column(np.eye(3), after.dcm.T @ UP_MPS2)
    return G


def correction(
    covariance: FloatArray, innovation: FloatArray, H: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return the estimated error dx (n,), the covariance after the update and the NIS y' S^-1 y.

    S = H P H' + R;  K = P H' S^-1;  dx = K y;  P = (I - K H) P (I - K H)' + K R K', symmetrised. The prior dx is 0:
    every estimated error goes into the nominal state at once.
    """
    PHt = covariance.dot(H.T)
    S = H.dot(PHt) + R
    solved = np.linalg.solve(S, np.column_stack([PHt.T, innovation]))
    K, y = solved[:, :-1].T, solved[:, -1]
    rest = np.eye(len(covariance)) - K.dot(H)
    posterior = rest.dot(covariance).dot(rest.T) + K.dot(R).dot(K.T)
    return PHt.dot(y), 0.5 * (posterior + posterior.T), float(innovation.dot(y))
