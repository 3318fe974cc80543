"""A right-invariant EKF as Hartley et al. (2020) write it, by matrices of the group and dense exponentials."""

import numpy as np
from scipy.linalg import expm, logm

GRAVITY = np.array([0.0, 0.0, -9.81])


def cross_matrix(a):
    """[a], with [a] b = a x b."""
    return np.cross(a, np.eye(3)).T


def group(state):
    """X (5, 5) of a nominal state."""
    X = np.eye(5)
    X[:3, :3], X[:3, 3], X[:3, 4] = state.dcm, state.velocity_mps, state.position_m
    return X


def hat(xi):
    """xi = [phi, rho, pi] (9,) in the Lie algebra (5, 5)."""
    A = np.zeros((5, 5))
    A[:3, :3], A[:3, 3], A[:3, 4] = cross_matrix(xi[:3]), xi[3:6], xi[6:9]
    return A


def exp(xi):
    return expm(hat(xi))


def log(X):
    A = np.real(logm(X))
    return np.concatenate([[A[2, 1], A[0, 2], A[1, 0]], A[:3, 3], A[:3, 4]])


def adjoint(X):
    C, v, p = X[:3, :3], X[:3, 3], X[:3, 4]
    Ad = np.kron(np.eye(3), C)
    Ad[3:6, :3], Ad[6:9, :3] = cross_matrix(v) @ C, cross_matrix(p) @ C
    return Ad


class InvariantFilter:
    """State X (5, 5), biases [b_g, b_a] (6,), covariance of [xi, db] (15, 15); db is truth less estimate."""

    def __init__(self, X, biases, P, noise):
        self.X, self.b, self.P = X, np.array(biases), np.array(P)
        self.Q = np.diag(np.repeat([noise.angle, noise.velocity, 0.0, noise.gyro_bias, noise.accel_bias], 3))

    def predict(self, accel, gyro, dt):
        w, f, X = gyro - self.b[:3], accel - self.b[3:], self.X
        C, v, p = X[:3, :3], X[:3, 3], X[:3, 4]
        A = np.zeros((15, 15))
        A[3:6, :3], A[6:9, 3:6] = cross_matrix(GRAVITY), np.eye(3)
        A[:9, 9:12] = -adjoint(X)[:, :3]
        A[3:6, 12:15] = -C
        Ad = np.eye(15)
        Ad[:9, :9] = adjoint(X)
        Phi = expm(A * dt)
        self.P = Phi @ (self.P + Ad @ self.Q @ Ad.T * dt) @ Phi.T
        turned = C @ expm(cross_matrix(w * dt))
        a = 0.5 * (C + turned) @ f + GRAVITY
        self.X[:3, 4], self.X[:3, 3], self.X[:3, :3] = p + v * dt + a * dt**2 / 2, v + a * dt, turned

    def update(self, z, R):
        """Position and velocity (6,) of the IMU: h(Exp(xi) Xh), derived by differences."""
        here = np.concatenate([self.X[:3, 4], self.X[:3, 3]])
        H = np.zeros((6, 15))
        for k, d in enumerate(1e-6 * np.eye(9)):
            ahead, behind = exp(d) @ self.X, exp(-d) @ self.X
            H[:3, k], H[3:, k] = (ahead - behind)[:3, 4] / 2e-6, (ahead - behind)[:3, 3] / 2e-6
        K = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + R)
        dx = K @ (z - here)
        rest = np.eye(15) - K @ H
        self.P = rest @ self.P @ rest.T + K @ R @ K.T
        self.X, self.b = exp(dx[:9]) @ self.X, self.b + dx[9:]
