"""The doctor: mistakes that a person makes in a log, found by what its streams say of each other."""

from dataclasses import replace

from jerkbench.inspection.evidence import Diagnosis
from jerkbench.inspection.frames import attitude_mistakes, exchanged_axes, exchanged_degrees
from jerkbench.inspection.lags import all_lags, clock_offsets
from jerkbench.inspection.mounting import EITHER_MIRRORED, TRACK_MIRRORED, mounting
from jerkbench.inspection.sigmas import understated_noise
from jerkbench.inspection.units import accelerometer_unit, gyro_unit
from jerkbench.recording import Recording


def diagnoses(recording: Recording) -> list[Diagnosis]:
    """Return the mistakes that are sure."""
    return [*first_diagnoses(recording), *clock_offsets(all_lags(recording))]


def first_diagnoses(recording: Recording) -> list[Diagnosis]:
    """Return them without those of the clocks, whose search takes longer.

    A mistake is told once, by those that see it best. Where streams do not agree on east and north, a reference says
    nothing of their errors. Where the IMU's units or axes are wrong, it says nothing of an attitude.
    """
    units = [*accelerometer_unit(recording), *gyro_unit(recording)]
    axes, degrees, exchanged = mounting(recording), exchanged_degrees(recording), exchanged_axes(recording)
    of_fixes = [one for one in axes if one.name in (TRACK_MIRRORED, EITHER_MIRRORED)]
    of_imu = [one for one in axes if one not in of_fixes]
    agreed = not (of_fixes or degrees or exchanged)
    if degrees:
        of_fixes, exchanged = [], {}
    elif of_fixes and exchanged:
        measured = [of_fixes[0].measured, *(one.measured for one in exchanged.values())]
        of_fixes, exchanged = [replace(of_fixes[0], measured=", and ".join(measured))], {}
    attitude = [] if units or of_imu else list(attitude_mistakes(recording))
    noise = understated_noise(recording, reference=agreed)
    return [*units, *of_imu, *of_fixes, *degrees, *exchanged.values(), *attitude, *noise]
