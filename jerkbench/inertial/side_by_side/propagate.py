"""P = Phi P Phi' + Q by the blocks of Phi that are not zero; `jerkbench.inertial.compiled.propagate` has them."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scratch
from jerkbench.inertial.side_by_side.layout import LEVER, TWIST
from jerkbench.kinematic.layout import AT, WIDTH

MOVED, ALL, SQUARE_OF_MOVED = 9, 15, 81
"""Error states that move, all of them, and the length of a block of those that move."""


def propagate(w: FloatArray, m: FloatArray, noise: FloatArray, dt: float) -> None:
    """Carry the covariances over a step of ``dt``, first their columns, then their rows."""
    c, half = scratch(ALL, WIDTH), scratch(SQUARE_OF_MOVED, WIDTH)
    for t in range(MOVED):
        for k in range(ALL):
            c[k] = w[AT[k, t]]
        _move(c, m, dt)
        for k in range(MOVED):
            half[MOVED * k + t] = c[k]
    _move_biases(w, m, dt)
    _move_rows(w, m, half, dt)
    _add_noise(w, noise, dt)


def _move_biases(w: FloatArray, m: FloatArray, dt: float) -> None:
    """The columns of the biases, whose rows stay as they are."""
    c = scratch(ALL, WIDTH)
    for t in range(MOVED, ALL):
        for k in range(ALL):
            c[k] = w[AT[k, t]]
        _move(c, m, dt)
        for k in range(MOVED):
            w[AT[k, t]] = c[k]


def _move_rows(w: FloatArray, m: FloatArray, half: FloatArray, dt: float) -> None:
    """The rows of what moves, of which ``half`` has the columns that move too."""
    c = scratch(ALL, WIDTH)
    for r in range(MOVED):
        for k in range(MOVED):
            c[k] = half[MOVED * r + k]
        for k in range(MOVED, ALL):
            c[k] = w[AT[r, k]]
        _move(c, m, dt)
        for k in range(r, MOVED):
            w[AT[r, k]] = c[k]


def _move(c: FloatArray, m: FloatArray, dt: float) -> None:
    """Apply Phi to an error of the state."""
    da = m[LEVER] * c[9] + m[LEVER + 1] * c[10] + m[LEVER + 2] * c[11]
    db = m[LEVER + 3] * c[9] + m[LEVER + 4] * c[10] + m[LEVER + 5] * c[11]
    dc = m[LEVER + 6] * c[9] + m[LEVER + 7] * c[10] + m[LEVER + 8] * c[11]
    x, y, z = m[TWIST], m[TWIST + 1], m[TWIST + 2]
    qa = y * c[8] - z * c[7] + (m[LEVER] * c[12] + m[LEVER + 1] * c[13] + m[LEVER + 2] * c[14])
    qb = z * c[6] - x * c[8] + (m[LEVER + 3] * c[12] + m[LEVER + 4] * c[13] + m[LEVER + 5] * c[14])
    qc = x * c[7] - y * c[6] + (m[LEVER + 6] * c[12] + m[LEVER + 7] * c[13] + m[LEVER + 8] * c[14])
    ra, rb, rc = y * dc - z * db, z * da - x * dc, x * db - y * da
    half, sixth = 0.5 * dt, dt / 6.0
    c[0] += dt * c[3] + half * qa + sixth * ra
    c[1] += dt * c[4] + half * qb + sixth * rb
    c[2] += dt * c[5] + half * qc + sixth * rc
    c[3] += qa + 0.5 * ra
    c[4] += qb + 0.5 * rb
    c[5] += qc + 0.5 * rc
    c[6] += da
    c[7] += db
    c[8] += dc


def _add_noise(w: FloatArray, noise: FloatArray, dt: float) -> None:
    """Q of a step of ``dt``, as in `jerkbench.inertial.error_model.process_noise`."""
    for i in range(3):
        w[AT[i, i]] += noise[1] * (dt * dt * dt / 3.0)
        w[AT[i, 3 + i]] += noise[1] * (dt * dt / 2.0)
        w[AT[3 + i, 3 + i]] += noise[1] * dt
        w[AT[6 + i, 6 + i]] += noise[0] * dt
        w[AT[9 + i, 9 + i]] += noise[2] * dt
        w[AT[12 + i, 12 + i]] += noise[3] * dt
