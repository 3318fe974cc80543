"""The measurement update of the error state."""

import numpy as np

from jerkbench.arrays import FloatArray


def correction(
    covariance: FloatArray, innovation: FloatArray, H: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return the estimated error dx (n,), the covariance after the update and the NIS y' S^-1 y.

    S = H P H' + R;  K = P H' S^-1;  dx = K y;  P = (I - K H) P (I - K H)' + K R K', symmetrised. The prior dx is 0:
    every estimated error goes into the nominal state at once. That this turns phi's own axes by half of dx's angle is
    left out, as usual: it is of the second order.
    """
    PHt = covariance @ H.T
    S = H @ PHt + R
    K = np.linalg.solve(S, PHt.T).T
    rest = np.eye(len(covariance)) - K @ H
    posterior = rest @ covariance @ rest.T + K @ R @ K.T
    nis = float(innovation @ np.linalg.solve(S, innovation))
    return K @ innovation, 0.5 * (posterior + posterior.T), nis
