"""The digests of the recordings of a suite: whether they are those on which the others were scored."""

import hashlib
from collections.abc import Iterator

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import vertical_in_body
from jerkbench.jobs.inputs import Inputs
from jerkbench.recording import Recording
from jerkbench.suite.protocol import FROZEN, AttitudeSuite, SuiteProtocol

STRETCHES = 16
"""Each array is cut into so many; what is hashed is mean and mean square of each."""
STEP = 1e-4
"""They are rounded to this, in their SI unit: what the last bits of another processor do does not count."""


def require_recordings(scale: str, protocol: SuiteProtocol) -> None:
    """Require that the recordings are the frozen ones.

    Raises:
        RecordingError: one is another.
    """
    for scenario, frozen, own in zip(protocol.scenarios, FROZEN[scale].data, data_digests(protocol), strict=True):
        if own != frozen:
            raise RecordingError(
                f"The recordings of {scenario.name} are not those of {protocol.name}: their digest is {own}, the frozen"
                f" one {frozen}. Other data are another suite; use a version of jerkbench that makes these."
            )


def data_digests(protocol: SuiteProtocol) -> Iterator[str]:
    """Yield the digest of the recordings of each scenario that are frozen."""
    plain, inputs = protocol.plain_entrant, Inputs()
    arrays = _of_tilt if isinstance(protocol, AttitudeSuite) else _arrays
    for scenario in protocol.scenarios:
        job = plain.job(scenario, protocol.limits)
        recordings = (inputs.recording(job.scenario, seed) for seed in protocol.recordings_of(scenario))
        yield arrays_digest(array for recording in recordings for array in arrays(recording))


def arrays_digest(arrays: Iterator[FloatArray]) -> str:
    """Return the first 8 digits of the SHA-256 of rounded means of a recording's arrays."""
    sha = hashlib.sha256()
    for array in arrays:
        stretches = np.array_split(np.nan_to_num(array), STRETCHES)
        means = np.array([(stretch.mean(axis=0), np.square(stretch).mean(axis=0)) for stretch in stretches])
        sha.update(f"{array.shape}".encode() + np.rint(means / STEP).astype("<i8").tobytes())
    return sha.hexdigest()[:8]


def _of_tilt(recording: Recording) -> Iterator[FloatArray]:
    """What an attitude filter sees, the true vertical, and where it counts."""
    imu, reference = recording.inertial, recording.reference
    yield from (imu.t_s, imu.accel_mps2, imu.gyro_radps, reference.scored.astype(np.float64))
    if reference.euler_rad is not None:
        yield vertical_in_body(np.nan_to_num(reference.euler_rad))


def _arrays(recording: Recording) -> Iterator[FloatArray]:
    imu, position, velocity, heading = recording.imu, recording.position, recording.velocity, recording.heading
    if imu is not None:
        yield from (imu.t_s, imu.accel_mps2, imu.gyro_radps)
    if position is not None:
        yield from (position.t_s, position.enu_m, position.covariance_m2)
    if velocity is not None:
        yield from (velocity.t_s, velocity.mps)
    if heading is not None:
        yield from (heading.t_s, heading.yaw_rad)
    for truth in (recording.reference.enu_m, recording.reference.velocity_mps):
        if truth is not None:
            yield truth
