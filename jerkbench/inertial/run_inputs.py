"""One run of the inertial navigation before it begins: its events, its constraints, its settings."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.inertial.mechanisation import Earth, SensorNoise
from jerkbench.inertial.state import NavigationState
from jerkbench.recording import Heading, Imu
from jerkbench.timeline import Timeline, merged_times, nanoseconds


class Events(NamedTuple):
    """The steps of one run: predict over dt with ``sample``, then what comes at the end of the step.

    Attributes:
        t_s: (n,) time at the end of each step.
        dt_s: (n,) its length; the first is 0.
        sample: (n,) which IMU sample covers it.
        update: (n,) row of the timeline's measurements, or -1.
        heading: (n,) row of the headings, or -1.
        constrained: (n,) whether the constraints are due.
        reference: (n,) row of the reference, or -1.
    """

    t_s: FloatArray
    dt_s: FloatArray
    sample: IntArray
    update: IntArray
    heading: IntArray
    constrained: BoolArray
    reference: IntArray


def merge_events(
    t_s: FloatArray,
    updates: IntArray,
    references: IntArray,
    imu: Imu,
    headings: Heading | None,
    constraint_interval_s: float,
) -> Events:
    """Put ``headings`` (None: there are none) between the steps of a timeline: their ends, and what comes there.

    The constraints are due at the first step that ends in a new interval of ``constraint_interval_s``.
    """
    known = nanoseconds(t_s)
    more = nanoseconds(headings.t_s if headings is not None else np.empty(0))
    more = more[(more >= known[0]) & (more <= known[-1])]
    t_ns = merged_times(known, more) if len(more) else known
    at = np.searchsorted(t_ns, known)
    update, reference, heading = np.full((3, len(t_ns)), -1, dtype=np.int64)
    update[at], reference[at] = updates, references
    if headings is not None:
        heading[np.searchsorted(t_ns, more)] = np.flatnonzero(np.isin(nanoseconds(headings.t_s), more))
    intervals = t_ns // max(round(constraint_interval_s * 1e9), 1)
    return Events(
        t_s=np.asarray(t_ns * 1e-9),
        dt_s=np.diff(t_ns, prepend=t_ns[0]) * 1e-9,
        sample=np.searchsorted(nanoseconds(imu.t_s), t_ns).astype(np.int64),
        update=update,
        heading=heading,
        constrained=np.diff(intervals, prepend=intervals[0]) > 0,
        reference=reference,
    )


# The times at which the vehicle stands still, as the IMU sees it.


def still_samples(imu: Imu, window_s: float, accel_mps2: float, gyro_radps: float) -> BoolArray:
    """Return (n,) whether the vehicle has stood still for the ``window_s`` that end with each sample.

    It does where the standard deviations over the window, of the three axes together, are below both limits: what is
    constant (gravity, a bias) does not count. Steady motion on a smooth road looks the same, so a user of this asks
    for a small speed as well. The first window has too few samples to tell: False.
    """
    samples = max(round(window_s / imu.nominal_interval_s), 2)
    quiet = deviation(imu.accel_mps2, samples) < accel_mps2
    return np.asarray(quiet & (deviation(imu.gyro_radps, samples) < gyro_radps))


def deviation(values: FloatArray, samples: int) -> FloatArray:
    """Return (n,) the root of the summed variances of the columns over the last ``samples`` rows; infinite before."""
    centred = values - values.mean(axis=0)  # less cancellation in the running sums
    spread = np.full(len(values), np.inf)
    if len(values) < samples:
        return spread
    mean, square = _running_mean(centred, samples), _running_mean(centred**2, samples)
    spread[samples - 1 :] = np.sqrt(np.maximum(square - mean**2, 0.0).sum(axis=1))
    return spread


def _running_mean(values: FloatArray, samples: int) -> FloatArray:
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    return np.asarray((sums[samples:] - sums[:-samples]) / samples)


# One run of the inertial navigation before it begins.


class Constraints(NamedTuple):
    """What the vehicle cannot do.

    Attributes:
        still: (n,) whether it stands still at each IMU sample; all False: no zero-velocity update.
        still_below_mps: only when the estimated speed is below.
        still_sigma_mps: one sigma of each axis of the velocity when it stands.
        sideways_sigma_mps: one sigma of the velocity sideways and upwards in the body; 0: no such constraint.
        sideways_point_m: (3,) where that holds, from the IMU, in the body.
    """

    still: BoolArray
    still_below_mps: float
    still_sigma_mps: float
    sideways_sigma_mps: float
    sideways_point_m: FloatArray


class InertialSettings(NamedTuple):
    """Everything about a run that is not measured.

    Attributes:
        noise: of the sensors.
        earth: gravity and rotation.
        antenna_m: (3,) from the IMU, in the body.
        reference_point_m: (3,) the point whose position is given out, from the IMU, in the body.
        velocity_frame: of rows 3 to 5 of z: "enu" (of the antenna), "body" (of the IMU), or "speed" (body, of the
            wheel).
        wheel_m: (3,) where the wheel measures, from the IMU, in the body.
        constraints: what the vehicle cannot do.
        invariant: whether a correction goes in on the group SE_2(3), and the covariance of that error stays as it is.
    """

    noise: SensorNoise
    earth: Earth
    antenna_m: FloatArray
    reference_point_m: FloatArray
    velocity_frame: str
    wheel_m: FloatArray
    constraints: Constraints
    invariant: bool = False


class Journey(NamedTuple):
    """Everything that a run needs besides its adaptation; `jerkbench.inertial.run.InertialRun` takes the same.

    Attributes:
        imu: the samples.
        timeline: the measurements.
        headings: measured headings, or None.
        events: the steps.
        start: state and covariance (n, n) at the begin.
        settings: what is not measured.
    """

    imu: Imu
    timeline: Timeline
    headings: Heading | None
    events: Events
    start: tuple[NavigationState, FloatArray]
    settings: InertialSettings
