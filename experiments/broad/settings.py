"""The one setting of each adaptation of the tilt filter that suits all trials of BROAD best.

    python experiments/broad/settings.py FOLDER [TRIAL ...]

Every adaptation gets the same 35 settings of sigma_G and sigma_A; each is scored on the trials that it is chosen on.
"""

import sys
from itertools import product
from pathlib import Path

import numpy as np

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.arrays import FloatArray
from jerkbench.attitude.gravity_update import ADAPTATIONS
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.broad import Broad
from jerkbench.evaluation.metrics.attitude import Inclination
from jerkbench.filters.attitude_only import AttitudeOnlyFilter
from jerkbench.recording import Recording

SIGMA_GYRO_RADPS = (0.001, 0.003, 0.01, 0.03, 0.1)
SIGMA_ACCEL_MPS2 = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
LEE_MEMORY = 0.3


def trials(folder: Path, chosen: list[int]) -> list[Recording]:
    """Return the recordings of the ``chosen`` trials; of all that are there, where none is."""
    numbers = {int(path.name[:2]) for path in folder.iterdir() if path.suffix in (".hdf5", ".mat")}
    return [Broad(str(folder), trial).load(0) for trial in chosen or sorted(numbers)]


def score(recording: Recording, tilt: Tilt) -> float:
    """Return the RMSE of the inclination [deg]."""
    estimate = AttitudeOnlyFilter().estimate(recording, tilt.estimate(recording), NoAdaptation())
    counted = recording.reference.scored[estimate.index]
    return Inclination().evaluate(estimate, recording, counted)["inclination_rmse_deg"]


def scores(recordings: list[Recording], adapt: str) -> tuple[list[tuple[float, float]], FloatArray]:
    """Return the settings, and (settings, trials) what each gives."""
    settings = list(product(SIGMA_GYRO_RADPS, SIGMA_ACCEL_MPS2))
    memory = LEE_MEMORY if adapt == "lee" else 0.0
    table = []
    for gyro, accel in settings:
        tilt = Tilt(adapt, gyro, accel, memory, propagation="exact", yaw_source="gyro_only")
        table.append([score(recording, tilt) for recording in recordings])
    return settings, np.array(table)


def main() -> None:
    """Print the best setting of each adaptation, and what the best setting for each trial would give."""
    recordings = trials(Path(sys.argv[1]), [int(number) for number in sys.argv[2:]])
    print("RMSE of the inclination [deg]:", ", ".join(recording.name for recording in recordings))
    for adapt in ADAPTATIONS:
        settings, table = scores(recordings, adapt)
        best = int(np.argmin(table.mean(axis=1)))
        gyro, accel = settings[best]
        print(f"{adapt}: sigma_G {gyro} rad/s, sigma_A {accel} m/s2: mean {table[best].mean():.2f}")
        print("  one setting for all:    ", *(f"{value:6.2f}" for value in table[best]))
        print("  the best for each trial:", *(f"{value:6.2f}" for value in table.min(axis=0)))


if __name__ == "__main__":
    main()
