"""The loop of runs side by side: the steps of their timelines, one after the other."""

from jerkbench.compilation.views import Run, ask_for, row, runs_in
from jerkbench.inertial.side_by_side.arguments import Inertial
from jerkbench.inertial.side_by_side.feedback import feed_back
from jerkbench.inertial.side_by_side.heading import take_heading
from jerkbench.inertial.side_by_side.mechanise import mechanise
from jerkbench.inertial.side_by_side.propagate import propagate
from jerkbench.kinematic.arguments import Kept, Rules, Runs, Score, Steps
from jerkbench.kinematic.correction import check_definite
from jerkbench.kinematic.layout import RUN
from jerkbench.kinematic.loop import AHEAD, all_lost, keep
from jerkbench.kinematic.update_step import update


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


def move(run: Run, inertial: Inertial, dt: float, sample: int) -> None:
    """Carry the nominal states and the covariances over a step of ``dt``."""
    accel, gyro = inertial.accel_mps2, inertial.gyro_radps
    ask_for(row(accel, sample + AHEAD, run, "3"))
    ask_for(row(gyro, sample + AHEAD, run, "3"))
    mechanise(run, row(accel, sample, run, "3"), row(gyro, sample, run, "3"), dt)
    propagate(run, row(inertial.noise, 0, run, "4"), dt)


def begin(run: Run, inertial: Inertial) -> None:
    """Put the start into the runs, whose nominal attitude and biases are there already."""
    x0, P0 = row(inertial.x0, 0, run, "6"), row(inertial.P0, 0, run, "s s")
    for s in range(6):
        run.x[s] = x0[s]
    for s in range(run.s):
        for t in range(run.s):
            run.P[s, t] = P0[s, t]
    run.ended = run.ended - 1.0
