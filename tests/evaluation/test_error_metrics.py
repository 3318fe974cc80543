"""Errors of position, velocity, attitude and inclination, compared with naive loops."""

import dataclasses
import math
import statistics
from itertools import pairwise

import numpy as np
import pytest

from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.metrics.attitude import AttitudeRmse, Inclination
from jerkbench.evaluation.metrics.position import PositionRmse, VelocityRmse
from jerkbench.evaluation.metrics.recovery import Outage
from jerkbench.geometry import dcm_from_euler
from jerkbench.recording import Imu, Position, Recording, Reference, Velocity

BURN_IN_S = 5.0


def naive_rms(values, truths, axes, rows):
    squares = []
    for value, truth, row in zip(values, truths, rows, strict=True):
        if row and not any(math.isnan(truth[axis]) for axis in axes):
            squares.append(sum((value[axis] - truth[axis]) ** 2 for axis in axes))
    return math.sqrt(sum(squares) / len(squares))


POSITION, VELOCITY, ATTITUDE = PositionRmse(), VelocityRmse(), AttitudeRmse()


@pytest.mark.parametrize(
    ("metric", "value", "truth", "column", "axes"),
    [
        (POSITION, "position_m", "enu_m", "position_rmse_m", (0, 1, 2)),
        (POSITION, "position_m", "enu_m", "position_rmse_horizontal_m", (0, 1)),
        (POSITION, "position_m", "enu_m", "position_rmse_east_m", (0,)),
        (POSITION, "position_m", "enu_m", "position_rmse_north_m", (1,)),
        (POSITION, "position_m", "enu_m", "position_rmse_up_m", (2,)),
        (VELOCITY, "velocity_mps", "velocity_mps", "velocity_rmse_mps", (0, 1, 2)),
        (VELOCITY, "velocity_mps", "velocity_mps", "velocity_rmse_horizontal_mps", (0, 1)),
        (VELOCITY, "velocity_mps", "velocity_mps", "velocity_rmse_up_mps", (2,)),
        (ATTITUDE, "euler_rad", "euler_rad", "roll_rmse_rad", (0,)),
        (ATTITUDE, "euler_rad", "euler_rad", "pitch_rmse_rad", (1,)),
        (ATTITUDE, "euler_rad", "euler_rad", "yaw_rmse_rad", (2,)),
    ],
)
@pytest.mark.parametrize("hole", [None, (slice(12, 30), 0), (slice(12, 30), 2)])
def test_an_rmse_is_the_naive_loop(estimate, recording, counted, metric, value, truth, column, axes, hole):
    if hole is not None:
        truths = getattr(recording.reference, truth).copy()
        truths[hole] = np.nan
        recording = dataclasses.replace(
            recording, reference=dataclasses.replace(recording.reference, **{truth: truths})
        )
    truths = getattr(recording.reference, truth)[estimate.index]
    if column in ("roll_rmse_rad", "yaw_rmse_rad"):
        counted = counted & (np.abs(truths[:, 1]) <= math.radians(75))
    expected = naive_rms(getattr(estimate, value), truths, axes, counted)
    assert metric.evaluate(estimate, recording, counted)[column] == pytest.approx(expected, rel=1e-12)


def test_the_whole_run_counts_the_burn_in_and_the_largest_error_is_the_naive_loop(estimate, recording, counted):
    truths = recording.reference.enu_m[estimate.index]
    scored = recording.reference.scored[estimate.index]
    values = PositionRmse().evaluate(estimate, recording, counted)
    assert values["position_rmse_whole_m"] == pytest.approx(naive_rms(estimate.position_m, truths, (0, 1, 2), scored))
    assert values["position_rmse_whole_m"] != values["position_rmse_m"]
    distances = [math.dist(p, q) for p, q, row in zip(estimate.position_m, truths, counted, strict=True) if row]
    largest = max(d for d in distances if not math.isnan(d))
    assert PositionRmse().evaluate(estimate, recording, counted)["position_max_m"] == pytest.approx(largest)


def test_the_yaw_error_does_not_see_full_turns_nor_a_reference_that_stands_on_its_nose(estimate, recording, counted):
    turned = dataclasses.replace(estimate, euler_rad=estimate.euler_rad + np.array([0.0, 0.0, 4 * math.pi]))
    before = AttitudeRmse().evaluate(estimate, recording, counted)["yaw_rmse_rad"]
    assert AttitudeRmse().evaluate(turned, recording, counted)["yaw_rmse_rad"] == pytest.approx(before, rel=1e-9)
    euler = recording.reference.euler_rad.copy()
    euler[30:, 1] = 1.5
    steep = dataclasses.replace(recording, reference=dataclasses.replace(recording.reference, euler_rad=euler))
    values = AttitudeRmse().evaluate(estimate, steep, counted)
    level = counted & (np.abs(euler[estimate.index, 1]) < np.radians(75))
    error = (estimate.euler_rad - euler[estimate.index])[:, 0]
    error = (error + np.pi) % (2 * np.pi) - np.pi
    assert 0 < level.sum() < counted.sum()
    assert values["roll_rmse_rad"] == pytest.approx(np.sqrt(np.mean(error[level] ** 2)))


def naive_outage(estimate, recording, counted):
    reference = recording.reference
    known_s = [t for t, truth in zip(reference.t_s, reference.enu_m, strict=True) if not np.isnan(truth).any()]
    oldest_s = 2 * statistics.median(after - before for before, after in pairwise(known_s)) + 1e-9
    start_s = min(reference.t_s[row] for row, count in zip(estimate.index, counted, strict=True) if count)
    inside, ends, driven = [], [], []
    for begin, end in recording.outages_s:
        last, way, before = None, 0.0, None
        for row, position, count in zip(estimate.index, estimate.position_m, counted, strict=True):
            t, truth = reference.t_s[row], reference.enu_m[row]
            if begin <= t < end and not np.isnan(truth).any():
                if count:
                    inside.append(math.dist(position, truth))
                if t >= start_s:
                    last = t, math.dist(position, truth)
                    way += 0.0 if before is None else math.dist(before, truth)
                    before = truth
        if last is not None and end - last[0] <= oldest_s:
            ends.append(last[1])
            driven.append(way)
    return math.sqrt(sum(d * d for d in inside) / len(inside)), ends, driven


def holed(recording, unknown=(), unscored=()):
    """Return the recording without the reference in some of its rows, t = row / 2 s; outages: 10 to 14, 20 to 22 s."""
    enu_m, scored = recording.reference.enu_m.copy(), recording.reference.scored.copy()
    enu_m[list(unknown)], scored[list(unscored)] = np.nan, False
    return dataclasses.replace(
        recording, reference=dataclasses.replace(recording.reference, enu_m=enu_m, scored=scored)
    )


@pytest.mark.parametrize(
    ("holes", "burn_in_s", "n"),
    [
        ({}, 5.0, 2),
        ({"unscored": (26, 27)}, 5.0, 2),  # the end counts though it is not scored
        ({"unscored": range(20, 28)}, 5.0, 2),
        ({"unknown": (27,)}, 5.0, 2),  # two intervals before the end
        ({"unknown": (26, 27)}, 5.0, 1),  # three and more
        ({"unknown": range(40, 44)}, 5.0, 1),
        ({"unknown": range(48, 60)}, 5.0, 2),  # a hole elsewhere is not an interval
        ({}, 13.0, 2),
        ({}, 14.0, 1),  # the first outage is over
    ],
)
def test_outage_is_the_naive_loop(estimate, recording, holes, burn_in_s, n):
    recording = holed(recording, **holes)
    counted = counted_rows(estimate, recording, burn_in_s)
    rmse, ends, driven = naive_outage(estimate, recording, counted)
    assert len(ends) == n
    assert Outage().evaluate(estimate, recording, counted) == pytest.approx(
        {
            "outage_rmse_m": rmse,
            "outage_end_m": sum(ends) / n,
            "outage_end_max_m": max(ends),
            "outage_end_percent": 100 * sum(ends) / sum(driven),
            "outages_counted": n,
        }
    )


def test_what_is_no_error_at_the_end_of_an_outage_does_not_count(estimate, recording, counted):
    still = dataclasses.replace(recording.reference, enu_m=np.ones_like(recording.reference.enu_m))
    parked = dataclasses.replace(recording, reference=still)
    values = Outage().evaluate(estimate, parked, counted_rows(estimate, parked, BURN_IN_S))
    assert math.isnan(values["outage_end_percent"])
    assert values["outage_end_m"] > 0
    names = ("index", "position_m", "velocity_mps", "covariance", "euler_rad")
    for reached_s, n in ((22.0, 2), (21.0, 2), (20.5, 1)):
        reached = recording.reference.t_s[estimate.index] <= reached_s
        cut = dataclasses.replace(estimate, **{name: getattr(estimate, name)[reached] for name in names})
        values = Outage().evaluate(cut, recording, counted_rows(cut, recording, BURN_IN_S))
        assert values["outages_counted"] == n
    unknown = holed(recording, unknown=(*range(20, 28), *range(40, 44)))
    values = Outage().evaluate(estimate, unknown, counted_rows(estimate, unknown, BURN_IN_S))
    assert values.pop("outages_counted") == 0
    always = dataclasses.replace(recording, outages_s=np.empty((0, 2)))
    nothing = Outage().evaluate(estimate, always, counted)
    assert len(nothing) == 5
    assert all(math.isnan(value) for value in (*values.values(), *nothing.values()))
    at_end = int(np.flatnonzero(recording.reference.t_s[estimate.index] == 14.0)[0])
    position_m = estimate.position_m.copy()
    position_m[at_end] += 1e6
    values = Outage().evaluate(dataclasses.replace(estimate, position_m=position_m), recording, counted)
    assert values == Outage().evaluate(estimate, recording, counted)


def test_an_estimate_that_is_nan_is_not_left_out_and_a_huge_error_is_infinite(estimate, recording, counted):
    position_m = estimate.position_m.copy()
    position_m[40] = np.nan
    values = PositionRmse().evaluate(dataclasses.replace(estimate, position_m=position_m), recording, counted)
    assert math.isnan(values["position_rmse_m"])
    assert math.isnan(values["position_max_m"])
    far = dataclasses.replace(estimate, position_m=estimate.position_m + 1e200)
    assert PositionRmse().evaluate(far, recording, counted)["position_rmse_m"] == math.inf
    before = estimate.velocity_mps.copy()
    before[[1, 40]] = [[np.nan], [np.inf]]  # row 1 does not count
    values = VelocityRmse().evaluate(dataclasses.replace(estimate, velocity_mps=before), recording, counted)
    assert values["velocity_rmse_mps"] == math.inf


def test_the_angle_is_that_between_the_third_rows_of_the_matrices_whatever_the_yaw(estimate, recording, counted):
    truth = recording.reference.euler_rad[estimate.index]
    cosines = np.einsum("ki,ki->k", dcm_from_euler(estimate.euler_rad)[:, 2], dcm_from_euler(truth)[:, 2])
    angles = np.arccos(cosines)[counted]
    values = Inclination().evaluate(estimate, recording, counted)
    assert values["inclination_rmse_rad"] == pytest.approx(np.sqrt(np.mean(angles**2)), rel=1e-9)
    assert values["inclination_rmse_deg"] == pytest.approx(np.degrees(values["inclination_rmse_rad"]))
    assert values["inclination_max_deg"] == pytest.approx(np.degrees(angles.max()))
    turned = dataclasses.replace(estimate, euler_rad=estimate.euler_rad + np.array([0.0, 0.0, 1.0]))
    assert Inclination().evaluate(turned, recording, counted) == pytest.approx(
        Inclination().evaluate(estimate, recording, counted), nan_ok=True
    )
    blind = dataclasses.replace(recording, reference=dataclasses.replace(recording.reference, euler_rad=None))
    assert all(np.isnan(value) for value in Inclination().evaluate(estimate, blind, counted).values())


def still_recording(tilt_rad, turning_radps=0.0):
    """Ten seconds at rest whose reference is rolled by ``tilt_rad`` against the accelerometer; scored nowhere."""
    t_s = np.arange(1000) / 100
    euler = np.zeros((1000, 3))
    euler[:, 0] = tilt_rad
    euler[:100] = np.nan
    gyro = np.zeros((1000, 3))
    gyro[::2, 1] = turning_radps
    reference = Reference(t_s, "made", independent=True, euler_rad=euler, scored=np.zeros(1000, dtype=bool))
    return Recording("still", Imu(t_s, np.tile([0.0, 0.0, 9.9], (1000, 1)), gyro), reference)


def floor_deg(estimate, recording):
    nothing = np.zeros(0, dtype=bool)
    none = dataclasses.replace(estimate, index=np.zeros(0, dtype=np.int64), euler_rad=np.zeros((0, 3)))
    return Inclination().evaluate(none, recording, nothing)["inclination_floor_deg"]


def test_the_floor_is_what_accelerometer_and_reference_disagree_by_at_rest(estimate):
    assert floor_deg(estimate, still_recording(0.01)) == pytest.approx(np.degrees(0.01), rel=1e-9)
    assert np.isnan(floor_deg(estimate, still_recording(0.01, turning_radps=0.1)))


@pytest.mark.parametrize("known", ["reference", "velocity", "places"])
def test_straight_driving_is_no_rest(estimate, known):
    standing = still_recording(0.01)
    t_s = np.arange(100) / 10
    along = np.column_stack([np.maximum(t_s - 5.0, 0.0) * 8.0, 0 * t_s, 0 * t_s])
    speed = np.column_stack([8.0 * (t_s > 5.0), 0 * t_s, 0 * t_s])
    tilted = standing.reference.euler_rad.copy()
    tilted[500:, 0] = 0.5
    reference = dataclasses.replace(standing.reference, euler_rad=tilted)
    moving = dataclasses.replace(standing, reference=reference)
    cov = np.tile(np.eye(3), (100, 1, 1))
    if known == "velocity":
        moving = dataclasses.replace(moving, velocity=Velocity(t_s, speed, cov))
    elif known == "places":
        moving = dataclasses.replace(moving, position=Position(t_s, along, cov))
    else:
        rate = np.interp(reference.t_s, t_s, speed[:, 0])[:, None] * [1.0, 0.0, 0.0]
        moving = dataclasses.replace(moving, reference=dataclasses.replace(reference, velocity_mps=rate))
    assert floor_deg(estimate, moving) == pytest.approx(np.degrees(0.01), rel=1e-9)
