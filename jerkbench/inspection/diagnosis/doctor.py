"""All diagnoses of a recording."""

from jerkbench.inspection.diagnosis.accelerometer import accelerometer_unit
from jerkbench.inspection.diagnosis.attitude import attitude_mistakes
from jerkbench.inspection.diagnosis.clocks import clock_offsets, late_imu
from jerkbench.inspection.diagnosis.diagnosis import Diagnosis
from jerkbench.inspection.diagnosis.frames import exchanged_axes
from jerkbench.inspection.diagnosis.gyro import gyro_unit
from jerkbench.inspection.diagnosis.mounting import mounting
from jerkbench.inspection.diagnosis.noise import understated_noise
from jerkbench.inspection.diagnosis.wheel import exchanged_degrees
from jerkbench.recording import Recording

QUICK = (
    accelerometer_unit,
    gyro_unit,
    mounting,
    exchanged_axes,
    exchanged_degrees,
    attitude_mistakes,
    understated_noise,
)
"""Quick enough for the moment before a run."""


def diagnoses(recording: Recording) -> list[Diagnosis]:
    """Return the mistakes that are sure; each detector asks for itself, so that one mistake may show twice."""
    return [*first_diagnoses(recording), *clock_offsets(recording, late_imu(recording))]


def first_diagnoses(recording: Recording) -> list[Diagnosis]:
    """Return them without those of the clocks, whose search takes seconds."""
    return [diagnosis for detector in QUICK for diagnosis in detector(recording)]
