"""Strapdown mechanisation of a step; `jerkbench.inertial.mechanisation` has the equations."""

from jerkbench.compilation.views import Run, View
from jerkbench.inertial.side_by_side.rotate import fill_turn, multiply
from jerkbench.recording import GRAVITY_MPS2


def mechanise(run: Run, accel: View, gyro: View, dt: float) -> None:
    """Carry the nominal states over a step of ``dt``, with one sample of the IMU."""
    for i in range(3):
        run.force[i] = accel[i] - run.accel_bias[i]
        run.rate[i] = gyro[i] - run.gyro_bias[i]
    fill_turn(run, dt * run.rate[0], dt * run.rate[1], dt * run.rate[2])
    multiply(run.C, run.turn, run.next)
    for i in range(3):  # C in the middle of the step
        for j in range(3):
            run.lever[i, j] = 0.5 * (run.C[i, j] + run.next[i, j])
            run.C[i, j] = run.next[i, j]
    for i in range(3):
        run.twist[i] = run.lever[i, 0] * run.force[0] + run.lever[i, 1] * run.force[1] + run.lever[i, 2] * run.force[2]
    for i in range(3):
        before = run.x[3 + i]
        pull = GRAVITY_MPS2 if i == 2 else 0.0
        run.x[3 + i] = before + (run.twist[i] - pull) * dt
        run.x[i] += (before + run.x[3 + i]) * (0.5 * dt)
    for i in range(3):
        run.twist[i] *= 0.0 - dt
        for j in range(3):
            run.lever[i, j] *= 0.0 - dt
