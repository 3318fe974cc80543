"""The loop of runs side by side: the steps of their timelines, one after the other."""

from functools import cache
from typing import NamedTuple

from jerkbench.arrays import FloatCube, FloatMatrix, FloatVector, IntVector
from jerkbench.compilation.views import RunView, ask_for, row, runs_in
from jerkbench.inertial.side_by_side.feedback import feed_back, take_heading
from jerkbench.inertial.side_by_side.strapdown import mechanise, propagate
from jerkbench.kinematic.arguments import Kept, Rules, Runs, Score, Steps
from jerkbench.kinematic.correction import check_definite
from jerkbench.kinematic.layout import RUN, type_with
from jerkbench.kinematic.loop import AHEAD, all_lost, keep
from jerkbench.kinematic.update_step import update

# Arguments of the runs side by side besides those of the kernel; WIDTH is their number.


class Inertial(NamedTuple):
    """What the runs sense, and their begin.

    Attributes:
        dt_s: (lengths,) of the steps.
        accel_mps2: (samples, 3, WIDTH).
        gyro_radps: (samples, 3, WIDTH).
        noise: (4, WIDTH) power densities: angle, velocity, gyro bias, accelerometer bias.
        x0: (6, WIDTH) position and velocity at the start.
        C0: (9, WIDTH) attitude there.
        biases0: (6, WIDTH) biases of gyro and accelerometer there.
        P0: (225, WIDTH) covariance of the error there.
        heading: (n,) row of ``yaw`` after each step, or -1.
        yaw: (h, 2, WIDTH) measured yaw [rad], NaN where there is none, and its sigma.
        dcm: (k, 9, WIDTH) room for the attitude at the visited stamps of the reference; or no row.
    """

    dt_s: FloatVector
    accel_mps2: FloatCube
    gyro_radps: FloatCube
    noise: FloatMatrix
    x0: FloatMatrix
    C0: FloatMatrix
    biases0: FloatMatrix
    P0: FloatMatrix
    heading: IntVector
    yaw: FloatCube
    dcm: FloatCube


def run_together(
    steps: Steps, score: Score, inertial: Inertial, rules: Rules, kept: Kept, runs: Runs
) -> tuple[int, int]:
    """Run all steps, or up to where the last run is lost; arguments as those of `jerkbench.kinematic.loop.run_steps`.

    Returns:
        How many stamps of the reference were visited, and how many updates there were.
    """
    run = runs_in(kept.w, RUN)
    begin(run, inertial)
    reached = updates = 0
    states = 5 * inertial.gyro_radps.shape[1]
    for k in range(len(steps.model)):
        if steps.model[k] >= 0:
            move(run, inertial, inertial.dt_s[steps.model[k]], steps.sample[k])
        if steps.update[k] >= 0:
            update(run, steps, score, rules, kept, runs, steps.update[k], updates, states)
            feed_back(run)
            updates += 1
            if all_lost(run):
                return reached, updates
        if inertial.heading[k] >= 0:
            take_heading(run, inertial.yaw, inertial.heading[k])
            feed_back(run)
            check_definite(run)
        if steps.reference[k] >= 0:
            keep(run, score, kept, steps.reference[k], reached)
            if len(inertial.dcm) > 0:
                dcm = row(inertial.dcm, reached, run, "3 3")
                for i in range(3):
                    for j in range(3):
                        dcm[i, j] = run.C[i, j]
            reached += 1
    return reached, updates


def move(run: RunView, inertial: Inertial, dt: float, sample: int) -> None:
    """Carry the nominal states and the covariances over a step of ``dt``."""
    accel, gyro = inertial.accel_mps2, inertial.gyro_radps
    ask_for(row(accel, sample + AHEAD, run, "3"))
    ask_for(row(gyro, sample + AHEAD, run, "3"))
    mechanise(run, row(accel, sample, run, "3"), row(gyro, sample, run, "3"), dt)
    propagate(run, row(inertial.noise, 0, run, "4"), dt)


def begin(run: RunView, inertial: Inertial) -> None:
    """Put the start into the runs, which are zero."""
    x0, P0 = row(inertial.x0, 0, run, "6"), row(inertial.P0, 0, run, "s s")
    C0, biases0 = row(inertial.C0, 0, run, "3 3"), row(inertial.biases0, 0, run, "6")
    for i in range(3):
        run.gyro_bias[i], run.accel_bias[i] = biases0[i], biases0[3 + i]
        for j in range(3):
            run.C[i, j] = C0[i, j]
    for s in range(6):
        run.x[s] = x0[s]
    for s in range(run.s):
        for t in range(run.s):
            run.P[s, t] = P0[s, t]
    run.ended = run.ended - 1.0


# The parts of a run: those of the kernel, and the rest of the nominal state.

QUANTITIES = 5
"""Position, velocity, attitude, and the biases of gyro and accelerometer."""


@cache
def inertial_type(width: int) -> RunView:
    """Return the type of ``width`` runs."""
    shapes: dict[str, tuple[int, ...]] = {
        "C": (3, 3),  # attitude, body to ENU
        "gyro_bias": (3,),
        "accel_bias": (3,),
        "rate": (3,),
        "force": (3,),
        "turn": (3, 3),  # the rotation of a step, or of a correction
        "next": (3, 3),
        "before": (3, 3),  # attitude before a correction
        "back": (3, 3),  # from the body after it to that before it
        "lever": (3, 3),  # -dt C, with C and the specific force a in the middle of a step
        "twist": (3,),  # -dt a
        "square_of_angle": (),
        "sine": (),  # sin(a)/a of the angle a of a rotation
        "cosine": (),  # (1 - cos(a))/a^2
        "innovation": (),  # of a yaw
        "measured": (),  # 1 where there is one, else 0
    }
    return type_with(shapes, QUANTITIES, width)
