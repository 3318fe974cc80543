"""The compiled navigation: the steps of one run or of several side by side; `jerkbench.inertial.run` defines it.

The error state stands in the places of the kernel of kinematic filters, so innovation, adaptation, update and sums are
that kernel's own. The first six places of its state hold the nominal position and velocity, the others the estimated
error until it is put into the nominal state. What all runs of one compilation have in common is the layout of the error
state and whether it is invariant.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatCube, FloatMatrix, FloatVector, IntVector
from jerkbench.compilation.views import Lanes, View, ask_for, room, row, runs_in
from jerkbench.inertial.aiding import conclude, constrain, feed_back, observe, take_heading
from jerkbench.inertial.state import EXTRA_PARTS, ErrorLayout
from jerkbench.inertial.strapdown import mechanise, propagate, sense
from jerkbench.kinematic.arguments import RUN, Exchange, Kept, Rules, Steps, TruthRows, type_with
from jerkbench.kinematic.correction import check_definite
from jerkbench.kinematic.loop import all_lost, update
from jerkbench.kinematic.score import AHEAD, keep


class Inertial(NamedTuple):
    """Arguments besides those of the kernel: what the runs sense, their settings and their begin; S states.

    Attributes:
        dt_s: (lengths,) of the steps.
        accel_mps2: (samples, 3, WIDTH).
        gyro_radps: (samples, 3, WIDTH).
        noise: (4, WIDTH) power densities: angle, velocity, gyro bias, accelerometer bias.
        earth: (4, WIDTH) the Earth's rate in ENU, and 1/R.
        rotates: whether the Earth turns for any run.
        arms: (4, 3, WIDTH) lever arms: of the measured position, the measured velocity, the sideways constraint, and
            the point that is given out.
        frame: (2, WIDTH) of the measured velocity: 1 along the body, else 0 (ENU); 1 a wheel's, else 0.
        limits: (3, WIDTH) still_below_mps, still_sigma_mps, sideways_sigma_mps of `run_inputs.Constraints`.
        direct: whether position and velocity of the IMU itself, in ENU, are measured in all runs.
        centred: whether those of the IMU itself are given out in all runs.
        nominal0: (S + 6, WIDTH) the `nominal_numbers` of the state at the start.
        P0: (S S, WIDTH) covariance of the error there.
        states: S.
        heading: (n,) row of ``yaw`` after each step, or -1.
        yaw: (h, 2, WIDTH) measured yaw [rad], NaN where there is none, and its sigma.
        constrained: (n,) row of ``held`` after each step, or -1.
        held: (c, WIDTH) 2 where the IMU stands still, 1 where it does not, 0 where no constraint is due.
        dcm: (k, 9, WIDTH) room for the attitude at the visited stamps of the reference; or no row.
    """

    dt_s: FloatVector
    accel_mps2: FloatCube
    gyro_radps: FloatCube
    noise: FloatMatrix
    earth: FloatMatrix
    rotates: bool
    arms: FloatCube
    frame: FloatMatrix
    limits: FloatMatrix
    direct: bool
    centred: bool
    nominal0: FloatMatrix
    P0: FloatMatrix
    states: int
    heading: IntVector
    yaw: FloatCube
    constrained: IntVector
    held: FloatMatrix
    dcm: FloatCube


def run_navigation(
    steps: Steps, scored: TruthRows, own: Inertial, rules: Rules, kept: Kept, exchange: Exchange
) -> tuple[int, int]:
    """Run all steps, or up to where the last run is lost; arguments as those of `jerkbench.kinematic.loop.run_steps`.

    Returns:
        How many stamps of the reference were visited, and how many updates there were.
    """
    run = runs_in(kept.w, RUN)
    begin(run, own)
    reached = updates = 0
    for k in range(len(steps.model)):
        move_navigation(run, own, steps.model[k], steps.sample[k])
        if steps.update[k] >= 0:
            take_update(run, own, steps, scored, rules, kept, exchange, steps.update[k], updates)
            updates += 1
        if own.heading[k] >= 0:
            remember(run)
            take_heading(run, own.yaw, own.heading[k])
            feed_back(run)
            check_definite(run)
        if own.constrained[k] >= 0:
            remember(run)
            held, limits = row(own.held, own.constrained[k], run, "1"), row(own.limits, 0, run, "3")
            constrain(run, held, limits, row(own.arms, 2, run, "3"), own.states)
            feed_back(run)
            check_definite(run)
        if (steps.update[k] >= 0 or own.heading[k] >= 0 or own.constrained[k] >= 0) and all_lost(run, k):
            return reached, updates
        if steps.reference[k] >= 0:
            give_out(run, own, scored, kept, steps.reference[k], reached)
            reached += 1
    return reached, updates


def begin(run: Lanes, own: Inertial) -> None:
    """Put the start into the runs, which are zero."""
    nominal0, P0 = row(own.nominal0, 0, run, "numbers"), row(own.P0, 0, run, "s s")
    for e in range(run.numbers):
        run.state[e] = nominal0[e]
    for s in range(run.s):
        for t in range(run.s):
            run.P[s, t] = P0[s, t]
    run.ended = run.ended - 1.0


def move_navigation(run: Lanes, own: Inertial, length: int, sample: int) -> None:
    """Carry the nominal states and the covariances over a step of length number ``length``; -1: no time passes."""
    accel, gyro = own.accel_mps2, own.gyro_radps
    ask_for(row(accel, sample + AHEAD, run, "3"))
    ask_for(row(gyro, sample + AHEAD, run, "3"))
    sense(run, row(accel, sample, run, "3"), row(gyro, sample, run, "3"))
    if length >= 0:
        mechanise(run, row(own.earth, 0, run, "4"), own.rotates, own.dt_s[length])
        propagate(run, row(own.noise, 0, run, "4"), own.dt_s[length])


def remember(run: Lanes) -> None:
    """Note position and velocity before something is taken."""
    for s in range(6):
        run.nominal[s] = run.x[s]


def take_update(
    run: Lanes,
    own: Inertial,
    steps: Steps,
    scored: TruthRows,
    rules: Rules,
    kept: Kept,
    exchange: Exchange,
    which: int,
    place: int,
) -> None:
    """Take row ``which`` of position and velocity, the ``place``-th update."""
    remember(run)
    if not own.direct:
        observe(run, row(own.arms, 0, run, "3"), row(own.arms, 1, run, "3"), row(own.frame, 0, run, "2"))
    update(run, steps, scored, rules, kept, exchange, which, place)
    if not own.direct:
        conclude(run)
    feed_back(run)


def give_out(run: Lanes, own: Inertial, scored: TruthRows, kept: Kept, reference: int, k: int) -> None:
    """Keep, and score, what is known at the ``k``-th visited stamp of the point whose position is given out."""
    if own.centred:
        keep(run, scored, kept, reference, k)
    else:
        keep_point(run, own, scored, kept, reference, k)
    if len(own.dcm) > 0:
        dcm = row(own.dcm, k, run, "3 3")
        for i in range(3):
            for j in range(3):
                dcm[i, j] = run.C[i, j]


def keep_point(run: Lanes, own: Inertial, scored: TruthRows, kept: Kept, reference: int, k: int) -> None:
    """Do so with another point than the IMU, and leave state and covariance as they were."""
    P, arm, frame = room(run, "6 s"), row(own.arms, 3, run, "3"), room(run, "2")
    frame[0] = frame[1] = run.zero
    remember(run)
    for s in range(6):
        for t in range(run.s):
            P[s, t] = run.P[s, t]
    observe(run, arm, arm, frame)
    keep(run, scored, kept, reference, k)
    for s in range(6):
        run.x[s] = run.nominal[s]
        for t in range(run.s):
            run.P[s, t] = P[s, t]


# The parts of a run: those of the kernel, and the rest of the nominal state.

_SHAPES: dict[str, tuple[int, ...]] = {
    "C": (3, 3),  # attitude, body to ENU
    "gyro_bias": (3,),
    "accel_bias": (3,),
    **EXTRA_PARTS,  # zero where not estimated
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
    "nominal": (6,),  # position and velocity before something is taken
    "shift": (6,),  # by how much a correction on the group moves them
    "expected": (6,),  # h: what is measured, as the state expects it
    "arm": (3,),  # C l of the position: dh = dp - [arm] phi
    "of_velocity": (3, 3),  # of a measured velocity: dh by dv, and the inverse
    "from_velocity": (3, 3),
    "of_attitude": (3, 3),  # dh by phi
    "of_gyro": (3, 3),  # dh by the gyro's error
    "wheel_slope": (),  # dh by the error of the wheel's scale, first row
    "innovation": (),  # of a yaw
    "measured": (),  # 1 where there is one, else 0
}


@cache
def inertial_type(layout: ErrorLayout, width: int, *, invariant: bool) -> Lanes:
    """Return the type of ``width`` runs with an error state of that layout, invariant or additive.

    Its ``state`` are the `nominal_numbers`, six more than the errors: those of C are nine, not three. ``at_NAME`` is
    where the errors of a part of `EXTRA_PARTS` begin, 0 where it is not estimated.
    """
    at = {f"at_{name}": block.start if name in layout.extra else 0 for name, block in layout.blocks.items()}
    run = type_with(_SHAPES, layout.size, width, invariant=int(invariant), numbers=layout.size + 6, **at)
    views = [run.fields[name] for name in ("C", "gyro_bias", "accel_bias", *layout.extra)]
    behind = [place for view in views for place in np.reshape(view.places, view.shape).ravel("F").tolist()]
    state = View((layout.size + 6,), [*run.fields["x"].places[:6], *behind], width)
    return Lanes({**run.fields, "state": state}, run.sizes, width)
