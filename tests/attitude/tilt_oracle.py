"""The oracle of the tilt filter: its equations one by one, with whole matrices and the library's inverse."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

G = 9.81


class Sample(NamedTuple):
    """What one sample does, and what it leaves."""

    x: np.ndarray
    P: np.ndarray
    a_ext: np.ndarray
    triggered: bool
    sigma_acc: np.ndarray
    x_prior: np.ndarray
    P_prior: np.ndarray
    innovation: np.ndarray


def skew(v):
    return np.cross(v, np.eye(3)).T  # columns v x e_i


def tilt_samples(x, P, gyro, accel, dt, p, a_prev=(0.0, 0.0, 0.0)):
    """Every sample of a run from the state x (3,), P (3, 3) and the external acceleration ``a_prev`` (3,)."""
    a_prev, squares, samples = np.array(a_prev), [], []
    for y_G, y_A, step in zip(gyro, accel, np.broadcast_to(dt, len(gyro)), strict=True):
        Phi = expm(-step * skew(y_G)) if p.propagation == "exact" else np.eye(3) - step * skew(y_G)
        Q = -(step**2) * skew(x) @ (p.sigma_gyro_radps**2 * np.eye(3)) @ skew(x)
        x_prior, P_prior = Phi @ x, Phi @ P @ Phi.T + Q
        e = y_A - p.external_memory * a_prev - G * x_prior
        squares.append(e**2)
        C0 = G**2 * P_prior + p.sigma_accel_mps2**2 * np.eye(3)
        triggered = bool(np.sum(e**2) >= np.trace(C0))
        Sigma = np.zeros((3, 3))
        if p.adapt == "mtf" and triggered:
            w = np.mean(squares[-p.window :], axis=0)
            Sigma = np.diag([max(0.0, w[i] - C0[i, i]) for i in range(3)])
        if p.adapt == "scalar" and triggered:
            Sigma = np.eye(3) * (np.sum(e**2) - np.trace(C0)) / 3
        if p.adapt == "lee":
            Sigma = np.eye(3) * p.external_memory**2 * np.linalg.norm(a_prev) ** 2 / 3
        M, H = p.sigma_accel_mps2**2 * np.eye(3) + Sigma, G * np.eye(3)
        K = P_prior @ H.T @ np.linalg.inv(H @ P_prior @ H.T + M)
        x = x_prior + K @ e
        P = (np.eye(3) - K @ H) @ P_prior @ (np.eye(3) - K @ H).T + K @ M @ K.T
        P = (P + P.T) / 2
        if p.normalise:
            x = x / np.linalg.norm(x)
        a_prev = y_A - G * x
        samples.append(Sample(x, P, a_prev, triggered, np.diag(Sigma), x_prior, P_prior, e))
    return samples
