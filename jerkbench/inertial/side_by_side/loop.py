"""The loop of runs side by side: the steps of their timelines, one after the other."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import vectors
from jerkbench.inertial.side_by_side.arguments import Inertial
from jerkbench.inertial.side_by_side.feedback import feed_back
from jerkbench.inertial.side_by_side.heading import take_heading
from jerkbench.inertial.side_by_side.layout import ATTITUDE
from jerkbench.inertial.side_by_side.mechanise import mechanise
from jerkbench.inertial.side_by_side.propagate import propagate
from jerkbench.kinematic.arguments import Kept, Rules, Runs, Score, Steps
from jerkbench.kinematic.correction import check_definite
from jerkbench.kinematic.layout import AT, ENDED, WIDTH, S, X
from jerkbench.kinematic.loop import all_lost, ask_ahead
from jerkbench.kinematic.score import compare
from jerkbench.kinematic.update_step import update


def run_together(
    steps: Steps, score: Score, inertial: Inertial, rules: Rules, kept: Kept, runs: Runs
) -> tuple[int, int]:
    """Run all steps, or up to where the last run is lost; arguments as those of `jerkbench.kinematic.loop.run_steps`.

    Returns:
        How many stamps of the reference were visited, and how many updates there were.
    """
    w, m, truth = vectors(kept.w, WIDTH), vectors(inertial.nominal, WIDTH), vectors(score.truth, WIDTH)
    accel, gyro = vectors(inertial.accel_mps2, WIDTH), vectors(inertial.gyro_radps, WIDTH)
    begin(w, vectors(inertial.x0, WIDTH), vectors(inertial.P0, WIDTH))
    states = updates = 0
    columns = 5 * inertial.gyro_radps.shape[1]
    for k in range(len(steps.model)):
        if steps.model[k] >= 0:
            ask_ahead(accel, 3, steps.sample[k])
            ask_ahead(gyro, 3, steps.sample[k])
            dt = inertial.dt_s[steps.model[k]]
            mechanise(w, m, inertial.nominal, accel, gyro, steps.sample[k], dt)
            propagate(w, m, vectors(inertial.noise, WIDTH), dt)
        if steps.update[k] >= 0:
            update(w, steps, score, rules, kept, runs, steps.update[k], updates, columns)
            feed_back(w, m, inertial.nominal)
            updates += 1
            if all_lost(kept.w):
                return states, updates
        if inertial.heading[k] >= 0:
            take_heading(w, m, inertial.nominal, inertial.yaw, inertial.heading[k])
            feed_back(w, m, inertial.nominal)
            check_definite(w)
        if steps.reference[k] >= 0:
            kept.reference[states] = steps.reference[k]
            ask_ahead(truth, 6, states)
            compare(w, score, truth, kept.errors, states)
            if len(inertial.dcm) > 0:
                keep_attitude(m, vectors(inertial.dcm, WIDTH), states)
            states += 1
    return states, updates


def begin(w: FloatArray, x0: FloatArray, P0: FloatArray) -> None:
    """Put the start into w, which is zero."""
    for s in range(6):
        w[X + s] = x0[s]
    for s in range(S):
        for t in range(S):
            w[AT[s, t]] = P0[S * s + t]
    w[ENDED] = w[ENDED] - 1.0


def keep_attitude(m: FloatArray, dcm: FloatArray, row: int) -> None:
    """Keep it at a visited stamp of the reference."""
    for e in range(9):
        dcm[9 * row + e] = m[ATTITUDE + e]
