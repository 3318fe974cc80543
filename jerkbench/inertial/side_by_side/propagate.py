"""P = Phi P Phi' + Q by the blocks of Phi that are not zero; `jerkbench.inertial.compiled.propagate` has them."""

from jerkbench.compilation.views import Run, View, room

MOVED = 9
"""Error states that move: all but the biases."""


def propagate(run: Run, noise: View, dt: float) -> None:
    """Carry the covariances over a step of ``dt``, first their columns, then their rows."""
    c, half = room(run, "s"), room(run, "9 9")
    for t in range(MOVED):
        for k in range(run.s):
            c[k] = run.P[k, t]
        _move(c, run, dt)
        for k in range(MOVED):
            half[k, t] = c[k]
    _move_biases(run, dt)
    _move_rows(run, half, dt)
    _add_noise(run, noise, dt)


def _move_biases(run: Run, dt: float) -> None:
    """The columns of the biases, whose rows stay as they are."""
    c = room(run, "s")
    for t in range(MOVED, run.s):
        for k in range(run.s):
            c[k] = run.P[k, t]
        _move(c, run, dt)
        for k in range(MOVED):
            run.P[k, t] = c[k]


def _move_rows(run: Run, half: View, dt: float) -> None:
    """The rows of what moves, of which ``half`` has the columns that move too."""
    c = room(run, "s")
    for r in range(MOVED):
        for k in range(MOVED):
            c[k] = half[r, k]
        for k in range(MOVED, run.s):
            c[k] = run.P[r, k]
        _move(c, run, dt)
        for k in range(r, MOVED):
            run.P[r, k] = c[k]


def _move(c: View, run: Run, dt: float) -> None:
    """Apply Phi to an error of the state: position, velocity, attitude, gyro and accelerometer bias."""
    L, (x, y, z) = run.lever, (run.twist[0], run.twist[1], run.twist[2])
    da = L[0, 0] * c[9] + L[0, 1] * c[10] + L[0, 2] * c[11]  # turned by the gyro's bias
    db = L[1, 0] * c[9] + L[1, 1] * c[10] + L[1, 2] * c[11]
    dc = L[2, 0] * c[9] + L[2, 1] * c[10] + L[2, 2] * c[11]
    qa = y * c[8] - z * c[7] + (L[0, 0] * c[12] + L[0, 1] * c[13] + L[0, 2] * c[14])  # pushed by tilt and bias
    qb = z * c[6] - x * c[8] + (L[1, 0] * c[12] + L[1, 1] * c[13] + L[1, 2] * c[14])
    qc = x * c[7] - y * c[6] + (L[2, 0] * c[12] + L[2, 1] * c[13] + L[2, 2] * c[14])
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


def _add_noise(run: Run, noise: View, dt: float) -> None:
    """Add Q of a step of ``dt``, as in `jerkbench.inertial.error_model.process_noise`."""
    for i in range(3):
        run.P[i, i] += noise[1] * (dt * dt * dt / 3.0)
        run.P[i, 3 + i] += noise[1] * (dt * dt / 2.0)
        run.P[3 + i, 3 + i] += noise[1] * dt
        run.P[6 + i, 6 + i] += noise[0] * dt
        run.P[9 + i, 9 + i] += noise[2] * dt
        run.P[12 + i, 12 + i] += noise[3] * dt
