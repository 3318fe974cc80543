"""Rotations, the nominal state, and where its errors stand in the error state."""

import math
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import GRAVITY_MPS2

TINY_RAD = 1e-12
"""Below it sin(a)/a is 1 to the last digit, and a division by zero is near."""

_I3, _ZERO = np.eye(3), np.zeros((3, 3))


def skew(a: FloatArray) -> FloatArray:
    """Return [a] (..., 3, 3) of vectors (..., 3), with [a] b = a x b."""
    S = np.zeros((*a.shape, 3))
    S[..., 2, 1], S[..., 0, 2], S[..., 1, 0] = a[..., 0], a[..., 1], a[..., 2]
    S[..., 1, 2], S[..., 2, 0], S[..., 0, 1] = -a[..., 0], -a[..., 1], -a[..., 2]
    return S


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a x b of two vectors (3,)."""
    a1, a2, a3 = a.tolist()
    b1, b2, b3 = b.tolist()
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


def rotation_exp(phi: FloatArray) -> FloatArray:
    """Return Exp(phi) (..., 3, 3), the rotations by the vectors phi (..., 3) [rad].

    With a = |phi|: I + sin(a)/a [phi] + (1 - cos a)/a^2 [phi]^2; the second factor is (sin(a/2)/(a/2))^2/2, which loses
    no digits where a is small.
    """
    a = np.maximum(np.sqrt((phi * phi).sum(axis=-1)), TINY_RAD)[..., None, None]
    half = 0.5 * a
    S = skew(phi)
    return np.asarray(_I3 + (np.sin(a) / a) * S + (0.5 * (np.sin(half) / half) ** 2) * (S @ S))


def left_jacobian(phi: FloatArray) -> FloatArray:
    """Return J (3, 3) of a rotation vector phi (3,) [rad]: the mean of Exp(s phi) over s from 0 to 1.

    With a = |phi|: I + (1 - cos a)/a^2 [phi] + (a - sin a)/a^3 [phi]^2. The digits that the last difference loses
    where a is small, its factor [phi]^2 takes away.
    """
    a = max(math.sqrt(float(phi @ phi)), TINY_RAD)
    half = 0.5 * a
    S = skew(phi)
    return np.asarray(_I3 + (0.5 * (math.sin(half) / half) ** 2) * S + ((a - math.sin(a)) / a**3) * (S @ S))


def orthonormal(C: FloatArray) -> FloatArray:
    """Return the rotation next to a matrix that is almost one: a Newton step, 1.5 C - .5 C C' C."""
    return np.asarray(1.5 * C - 0.5 * C @ (C.T @ C))


# The nominal state, and where its errors stand in the error state: NumPy and compiled runs are made from this.

STATES = 15
POSITION, VELOCITY, ATTITUDE, GYRO, ACCEL = range(0, STATES, 3)
"""Where the errors of position, velocity, attitude and both biases begin, three each."""

P, V, PHI, BG, BA = (slice(first, first + 3) for first in (POSITION, VELOCITY, ATTITUDE, GYRO, ACCEL))

EXTRA_PARTS: dict[str, tuple[int, ...]] = {"wheel_scale": ()}
"""The parts of `NavigationState` that a run may have or not, with their shapes.

Their errors follow the first fifteen in this order, a matrix column by column.
"""


class ErrorLayout(NamedTuple):
    """What stands in an error state behind its first fifteen places.

    Attributes:
        extra: which of `EXTRA_PARTS` are estimated.
    """

    extra: tuple[str, ...] = ()

    @property
    def blocks(self) -> dict[str, slice]:
        """The place of the error of each of `EXTRA_PARTS`, empty where it is not estimated."""
        sizes = [math.prod(shape) if name in self.extra else 0 for name, shape in EXTRA_PARTS.items()]
        ends = accumulate(sizes, initial=STATES)
        return {name: slice(*ends) for name, ends in zip(EXTRA_PARTS, pairwise(ends), strict=True)}

    @property
    def size(self) -> int:
        """How many numbers the error state has."""
        return STATES + sum(math.prod(EXTRA_PARTS[name]) for name in self.extra)

    def extra_errors(self, dx: FloatArray) -> dict[str, Any]:
        """The errors of the estimated ones of `EXTRA_PARTS` in dx (n,), each in the shape of its part."""
        blocks = self.blocks if self.extra else {}  # mostly none: the unscented filter asks for every sigma point
        return {name: dx[blocks[name]].reshape(EXTRA_PARTS[name], order="F")[()] for name in self.extra}


class NavigationState(NamedTuple):
    """Nominal state of the inertial navigation; what is None in it has no errors in the error state either.

    Attributes:
        position_m: (3,) p of the IMU, ENU.
        velocity_mps: (3,) v of the IMU, ENU.
        dcm: (3, 3) C, body FLU -> ENU.
        gyro_bias_radps: (3,) b_g, body.
        accel_bias_mps2: (3,) b_a, body.
        wheel_scale: k, a wheel shows 1 + k times the speed; None: it is not estimated.
    """

    position_m: FloatArray
    velocity_mps: FloatArray
    dcm: FloatArray
    gyro_bias_radps: FloatArray
    accel_bias_mps2: FloatArray
    wheel_scale: float | None = None

    @property
    def layout(self) -> ErrorLayout:
        """That of its error state."""
        return ErrorLayout(tuple(name for name in EXTRA_PARTS if getattr(self, name) is not None))


def nominal_numbers(state: NavigationState) -> FloatArray:
    """Return all parts of ``state`` one after the other as their errors stand, a matrix column by column."""
    parts = *state[:5], *(getattr(state, name) for name in state.layout.extra)
    return np.concatenate([np.ravel(part, order="F") for part in parts])


def added(state: NavigationState, dx: FloatArray) -> NavigationState:
    """Return ``state`` with an error dx (n,) put into it by adding, but C+ = Exp(phi) C."""
    return NavigationState(
        state.position_m + dx[P],
        state.velocity_mps + dx[V],
        orthonormal(rotation_exp(dx[PHI]) @ state.dcm),
        state.gyro_bias_radps + dx[BG],
        state.accel_bias_mps2 + dx[BA],
        **{name: getattr(state, name) + error for name, error in state.layout.extra_errors(dx).items()},
    )


def corrected(state: NavigationState, dx: FloatArray) -> NavigationState:
    """Return ``state`` with the estimated error dx (n,) put into it.

    Tilt and accelerometer bias are found together, because levelling has hidden the one in the other. With a the force
    that holds the body up and C+ = Exp(phi) C, the bias becomes the one with which that force changes as the linear
    filter says, and by nothing of the second order::

        C+ (C' a - db) = a + phi x a - C db_a

    Else g phi^2/2 of a correction would be left in the vertical, 4 mm/s2 for 28 mrad, and not in P.
    """
    moved = added(state, dx)
    up = GRAVITY_MPS2 * state.dcm[2]  # C' a
    east, north, _ = dx[PHI].tolist()
    force = GRAVITY_MPS2 * np.array([north, -east, 1.0]) - state.dcm @ dx[BA]
    return moved._replace(accel_bias_mps2=state.accel_bias_mps2 + up - moved.dcm.T @ force)


def error_between(after: NavigationState, before: NavigationState) -> FloatArray:
    """Return dx (n,) with which `corrected` takes ``before`` to ``after``.

    phi = Log(C+ C');  f = C' a - (b+ - b);  db_a = C' (a + phi x a - C+ f).
    """
    from scipy.spatial.transform import Rotation

    dcm, up = before.dcm, GRAVITY_MPS2 * before.dcm[2]
    phi = Rotation.from_matrix(after.dcm @ dcm.T).as_rotvec()
    extra = {name: getattr(after, name) - getattr(before, name) for name in before.layout.extra}
    shown = up - (after.accel_bias_mps2 - before.accel_bias_mps2)
    force = GRAVITY_MPS2 * np.array([phi[1], -phi[0], 1.0])
    return np.concatenate(
        [
            after.position_m - before.position_m,
            after.velocity_mps - before.velocity_mps,
            phi,
            after.gyro_bias_radps - before.gyro_bias_radps,
            dcm.T @ (force - after.dcm @ shown),
            *(np.ravel(error, order="F") for error in extra.values()),
        ]
    )


def is_finite(state: NavigationState) -> bool:
    """Whether every number of the state is finite; infinite scale factors leave no finite position."""
    return all(bool(np.isfinite(part).all()) for part in state[:5])
