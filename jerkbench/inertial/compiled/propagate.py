"""P = Phi P Phi' + Q by the blocks of Phi that are not zero.

With D = -dt C and [E] = -dt [a], a = C f, the Phi of `jerkbench.inertial.error_model.transition` makes of an error, g
that of the gyro and h that of the accelerometer (biases, and deformations times what was sensed)::

    d = D g,  q = E x phi,  r = E x d
    phi+ = phi + d
    dv+ = dv + q + r/2 + D h
    dp+ = dp + dt dv + dt/2 (q + D h) + dt/6 r

which is done to the columns of P, eight at a time, and after a transposition to its rows.
"""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import scatter
from jerkbench.inertial.compiled.arguments import Given
from jerkbench.inertial.compiled.layout import (
    DEFORMED,
    FORCE,
    LEVER,
    NOISE,
    NOISE_AT,
    NOISED,
    P_AT,
    PIECES,
    RATE,
    ROW,
    STRIDE,
    TWIST,
    WALK,
    WALK_AT,
    P,
)

LAST = 8
"""The ninth error state of navigation, whose column lies alone in its vector."""


def propagate(w: FloatArray, m: FloatArray, given: Given, dt: float) -> None:
    """Carry the covariance over a step of ``dt``."""
    if m[NOISED] != dt:
        _fill_noise(m, given, dt)
    move_column(w, P, ROW, m, dt)
    move_column(m, P_AT + 8, STRIDE, m, dt)
    for piece in range(PIECES):
        move_column(w, P + 2 + piece, ROW, m, dt)
    _transpose(w, m)
    move_column(w, P, ROW, m, dt)
    move_column(m, P_AT + 8, STRIDE, m, dt)
    for r in range(9):
        w[P + ROW * r] += w[NOISE + r]
    m[P_AT + STRIDE * LAST + 8] += given.noise[0] * dt
    for r in range(6):
        w[P + ROW * (9 + r) + 2] += w[WALK + r]


def move_column(a: FloatArray, at: int, step: int, m: FloatArray, dt: float) -> None:
    """Apply Phi to a column of P, or to eight at once: element k is a[at + step k]."""
    ga, gb, gc = a[at + 9 * step], a[at + 10 * step], a[at + 11 * step]
    ha, hb, hc = a[at + 12 * step], a[at + 13 * step], a[at + 14 * step]
    if DEFORMED:
        for j in range(3):
            rate, force = m[RATE + j], m[FORCE + j]
            ga += rate * a[at + (15 + 3 * j) * step]
            gb += rate * a[at + (16 + 3 * j) * step]
            gc += rate * a[at + (17 + 3 * j) * step]
            ha += force * a[at + (24 + 3 * j) * step]
            hb += force * a[at + (25 + 3 * j) * step]
            hc += force * a[at + (26 + 3 * j) * step]
    da = m[LEVER] * ga + m[LEVER + 1] * gb + m[LEVER + 2] * gc
    db = m[LEVER + 3] * ga + m[LEVER + 4] * gb + m[LEVER + 5] * gc
    dc = m[LEVER + 6] * ga + m[LEVER + 7] * gb + m[LEVER + 8] * gc
    ea = m[LEVER] * ha + m[LEVER + 1] * hb + m[LEVER + 2] * hc
    eb = m[LEVER + 3] * ha + m[LEVER + 4] * hb + m[LEVER + 5] * hc
    ec = m[LEVER + 6] * ha + m[LEVER + 7] * hb + m[LEVER + 8] * hc
    x, y, z = m[TWIST], m[TWIST + 1], m[TWIST + 2]
    fa, fb, fc = a[at + 6 * step], a[at + 7 * step], a[at + 8 * step]
    qa, qb, qc = y * fc - z * fb + ea, z * fa - x * fc + eb, x * fb - y * fa + ec
    ra, rb, rc = y * dc - z * db, z * da - x * dc, x * db - y * da
    va, vb, vc = a[at + 3 * step], a[at + 4 * step], a[at + 5 * step]
    half, sixth = 0.5 * dt, dt / 6.0
    a[at] += dt * va + half * qa + sixth * ra
    a[at + step] += dt * vb + half * qb + sixth * rb
    a[at + 2 * step] += dt * vc + half * qc + sixth * rc
    a[at + 3 * step], a[at + 4 * step], a[at + 5 * step] = va + qa + 0.5 * ra, vb + qb + 0.5 * rb, vc + qc + 0.5 * rc
    a[at + 6 * step], a[at + 7 * step], a[at + 8 * step] = fa + da, fb + db, fc + dc


def _transpose(w: FloatArray, m: FloatArray) -> None:
    """Turn the rows of navigation into columns; what the sensors' rows had there is theirs."""
    for k in range(8):
        right, below = P_AT + STRIDE * k + 8, P_AT + STRIDE * LAST + k
        m[right], m[below] = m[below], m[right]
    scatter(w, P, ROW, _eight(w, P))
    for piece in range(PIECES):
        first = 9 + 8 * piece
        scatter(w, P + ROW * first, ROW, _eight(w, P + 2 + piece))
        for s in range(8):
            m[P_AT + STRIDE * (first + s) + 8] = m[P_AT + STRIDE * LAST + 16 + 8 * piece + s]


def _eight(w: FloatArray, at: int) -> tuple[float, ...]:
    """One vector of each of the first eight rows."""
    a, b, c, d = w[at], w[at + ROW], w[at + 2 * ROW], w[at + 3 * ROW]
    e, f, g, h = w[at + 4 * ROW], w[at + 5 * ROW], w[at + 6 * ROW], w[at + 7 * ROW]
    return a, b, c, d, e, f, g, h


def _fill_noise(m: FloatArray, given: Given, dt: float) -> None:
    """Q of a step of ``dt``, as in `jerkbench.inertial.error_model.process_noise`."""
    angle, velocity, gyro, accel = given.noise
    for i in range(3):
        m[NOISE_AT + 8 * i + i] = velocity * dt * dt * dt / 3.0
        m[NOISE_AT + 8 * i + 3 + i] = m[NOISE_AT + 8 * (3 + i) + i] = velocity * dt * dt / 2.0
        m[NOISE_AT + 8 * (3 + i) + 3 + i] = velocity * dt
        m[WALK_AT + 8 * i + i], m[WALK_AT + 8 * (3 + i) + 3 + i] = gyro * dt, accel * dt
    for i in range(2):
        m[NOISE_AT + 8 * (6 + i) + 6 + i] = angle * dt
    m[NOISED] = dt
