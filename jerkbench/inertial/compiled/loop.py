"""The events of a run, one after the other."""

import math

import numpy as np

from jerkbench.arrays import FloatArray, FloatVector
from jerkbench.compilation.vectors import WIDE, vectors
from jerkbench.estimation.adaptation_call import Rule, call_adapt
from jerkbench.estimation.sums import Score, add_state, add_update
from jerkbench.inertial.compiled.arguments import Flow, Given, Kept
from jerkbench.inertial.compiled.expected_measurements import (
    clear,
    expect_body_velocity,
    expect_heading,
    expect_point,
    expect_wheel,
)
from jerkbench.inertial.compiled.feedback import feed_back, is_healthy, keep_covariance
from jerkbench.inertial.compiled.layout import ATTITUDE, EXPECTED, HPHT, POSITION, VELOCITY, R, Y
from jerkbench.inertial.compiled.mechanise import mechanise
from jerkbench.inertial.compiled.propagate import propagate
from jerkbench.inertial.compiled.update import correct, distance, pick, project


def run_events(flow: Flow, given: Given, rule: Rule, kept: Kept, score: Score, m: FloatVector) -> tuple[int, int, int]:
    """Run all steps from the state and covariance in m; returns numbers of states and updates, and where it failed.

    That is the step after which the covariance is not positive definite any more, or -1.
    """
    w = vectors(m, WIDE)
    states = updates = 0
    for k in range(len(flow.dt_s)):
        mechanise(m, flow, given, k)
        propagate(w, m, given, flow.dt_s[k])
        due = flow.constrained[k] != 0
        if flow.update[k] >= 0:
            update(w, m, flow, given, rule, kept, score, flow.update[k], updates)
            updates += 1
        if flow.heading[k] >= 0:
            take_heading(w, m, flow, kept, flow.heading[k])
        if due:
            constrain(w, m, flow, given, kept, flow.sample[k])
        if (due or flow.update[k] >= 0 or flow.heading[k] >= 0) and not is_healthy(w, m):
            return states, updates, k
        if flow.reference[k] >= 0:
            keep_state(w, m, given, kept, score, flow.reference[k], states)
            states += 1
    return states, updates, -1


def keep_state(
    w: FloatArray, m: FloatArray, given: Given, kept: Kept, score: Score, reference: int, number: int
) -> None:
    """Keep, and score, what is known of the point whose position is given out."""
    place = number if len(kept.x) > 1 else 0
    kept.reference[place] = reference
    a, b, c = given.point_m
    if a == 0.0 and b == 0.0 and c == 0.0:
        for i in range(3):
            kept.x[place, i], kept.x[place, 3 + i] = m[POSITION + i], m[VELOCITY + i]
        keep_covariance(m, kept.P, place)
    else:
        clear(w, 0)
        expect_point(m, given.point_m)
        project(w, m, 6)
        for i in range(6):
            kept.x[place, i] = m[EXPECTED + i]
        for e in range(36):
            kept.P[place, e] = m[HPHT + e]
    turned = number if len(kept.dcm) > 1 else 0
    for i in range(9):
        kept.dcm[turned, i] = m[ATTITUDE + i]
    add_state(score, number, kept.x[place], kept.P[place])


def update(
    w: FloatArray,
    m: FloatArray,
    flow: Flow,
    given: Given,
    rule: Rule,
    kept: Kept,
    score: Score,
    which: int,
    number: int,
) -> None:
    """Adapt R and take row ``which`` of position and velocity."""
    place = number if len(kept.seen) > 1 else 0
    seen = kept.seen[place]
    kept.which[place] = which
    clear(w, 0)
    expect_point(m, given.antenna_m)
    if given.frame != 0:
        clear(w, 3)
        if given.frame == 1:
            expect_body_velocity(m, 3, given.nowhere)
        else:
            expect_wheel(m, 3, given.wheel_m)
    rows = _innovate(w, m, flow, rule, seen, which)
    project(w, m, rows)
    _show(m, flow.R, rule, which, rows)
    _take_reported(m, flow.reported, rule, which, rows)
    seen[0], seen[1] = rows, distance(m, kept.places, rows)
    if rows > 0:
        call_adapt(rule, rows)
    used = _use(w, m, rule, seen, rows)
    seen[2], seen[3] = used, np.nan
    if used > 0:
        seen[3] = correct(w, m, kept.places, used)
        feed_back(w, m)
    add_update(score, which, seen)


def _innovate(w: FloatArray, m: FloatArray, flow: Flow, rule: Rule, seen: FloatArray, which: int) -> int:
    """Fill the innovation of the rows that are there, and which these are; return how many."""
    rows = 0
    for r in range(6):
        seen[4 + r] = seen[10 + r] = np.nan
        z = flow.z[which, r]
        if np.isfinite(z):
            m[Y + r] = seen[4 + r] = z - m[EXPECTED + r]
            pick(w, m, rows, r)
            rule.rows[rows] = r
            rows += 1
    return rows


def _show(m: FloatArray, given: FloatArray, rule: Rule, which: int, rows: int) -> None:
    """Show the adaptation what it may see."""
    for i in range(rows):
        rule.y[i] = m[Y + i]
        for j in range(rows):
            rule.HPHt[rows * i + j] = m[HPHT + 6 * i + j]
            rule.R[rows * i + j] = given[which, rule.rows[i], rule.rows[j]]


def _take_reported(m: FloatArray, reported: FloatArray, rule: Rule, which: int, rows: int) -> None:
    for i in range(rows):
        for j in range(rows):
            m[R + 6 * i + j] = reported[which, rule.rows[i], rule.rows[j]]


def _use(w: FloatArray, m: FloatArray, rule: Rule, seen: FloatArray, rows: int) -> int:
    """Keep the adapted R of the rows whose variance is finite; return how many these are."""
    used = 0
    for i in range(rows):
        variance = rule.adapted[(rows + 1) * i]
        seen[10 + rule.rows[i]] = variance
        if np.isfinite(variance):
            pick(w, m, used, i)
            rule.rows[used] = i
            used += 1
    for i in range(used):
        for j in range(used):
            a, b = rule.rows[i], rule.rows[j]
            m[R + 6 * i + j] = rule.adapted[rows * a + b]
            m[HPHT + 6 * i + j] = m[HPHT + 6 * a + b]
    return used


def take_heading(w: FloatArray, m: FloatArray, flow: Flow, kept: Kept, row: int) -> None:
    """Take a measured yaw."""
    clear(w, 0)
    expect_heading(m)
    apart = flow.yaw[row, 0] - m[EXPECTED] + math.pi
    m[Y] = apart - 2.0 * math.pi * math.floor(apart / (2.0 * math.pi)) - math.pi
    m[R] = flow.yaw[row, 1] * flow.yaw[row, 1]
    _correct_by(w, m, kept, 1)


def constrain(w: FloatArray, m: FloatArray, flow: Flow, given: Given, kept: Kept, sample: int) -> None:
    """Zero velocity when it stands still, else none sideways and upwards."""
    e, n, u = m[VELOCITY], m[VELOCITY + 1], m[VELOCITY + 2]
    slow = math.sqrt(e * e + n * n + u * u) < given.still_below_mps
    if flow.still[sample] != 0 and slow:
        clear(w, 0)
        expect_point(m, given.nowhere)
        _take_none(w, m, kept, 3, 3, given.still_sigma_mps)
    elif given.sideways_sigma_mps > 0:
        clear(w, 0)
        expect_body_velocity(m, 0, given.sideways_m)
        _take_none(w, m, kept, 1, 2, given.sideways_sigma_mps)


def _take_none(w: FloatArray, m: FloatArray, kept: Kept, first: int, rows: int, sigma: float) -> None:
    """Take it that ``rows`` rows from ``first`` on are zero."""
    for i in range(rows):
        m[Y + first + i] = -m[EXPECTED + first + i]
        pick(w, m, i, first + i)
        for j in range(rows):
            m[R + 6 * i + j] = sigma * sigma if i == j else 0.0
    _correct_by(w, m, kept, rows)


def _correct_by(w: FloatArray, m: FloatArray, kept: Kept, rows: int) -> None:
    project(w, m, rows)
    correct(w, m, kept.places, rows)
    feed_back(w, m)
