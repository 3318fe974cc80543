"""The first quarter of an hour: a log of one's own, a filter of one's own, a table and a figure.

    python examples/first_quarter_hour.py [FOLDER]

It writes its own log, so that it runs anywhere; put your files and your columns in its place.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench import api, register

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "first_quarter_hour")
folder.mkdir(parents=True, exist_ok=True)

# 1. A log: one CSV for the IMU, one for the fixes (here: a minute of a simulated robot, with its true path).
drive = api.load({"name": "field", "duration_s": 60.0}, seed=1)
imu, fixes, truth = drive.inertial, drive.position, drive.reference
pd.DataFrame(np.column_stack([imu.t_s, imu.accel_mps2, imu.gyro_radps]), columns=["t", *"abcdef"]).to_csv(
    folder / "imu.csv", index=False
)
pd.DataFrame(np.column_stack([fixes.t_s, fixes.enu_m]), columns=["t", *"enu"]).to_csv(folder / "gnss.csv", index=False)
pd.DataFrame(np.column_stack([truth.t_s, truth.enu_m]), columns=["t", *"enu"]).to_csv(folder / "true.csv", index=False)

# 2. What its columns mean; `jerkbench show dataset table` lists all there is to say.
log = {
    "name": "table",
    "folder": str(folder),
    "imu_file": "imu.csv",
    "imu_accel": ["a", "b", "c"],
    "imu_gyro": ["d", "e", "f"],
    "static_start_s": 3.0,
    "position_file": "gnss.csv",
    "position_columns": ["e", "n", "u"],
    "position_frame": "enu",
    "position_sigma_m": 0.03,
    "reference_file": "true.csv",
    "reference_position": ["e", "n", "u"],
    "reference_frame": "enu",
    "reference_source": "simulated",
    "reference_independent": True,
}
recording = api.load(log)
print(f"{recording.duration_s:.0f} s, {len(recording.position.t_s)} fixes")


# 3. A filter: one axis of it. Position, velocity, and an acceleration that wears off with the time constant tau.
@register("filter", "wearing_off")
@dataclass(frozen=True)
class WearingOff:
    """Position and velocity, driven by the acceleration of the IMU, less a bias that wears off.

    Attributes:
        accel_mps2: noise of one sample of the acceleration [m/s2].
        bias_mps2: one sigma of the bias [m/s2].
        tau_s: its time constant [s].
    """

    accel_mps2: float = 0.2
    bias_mps2: float = 0.1
    tau_s: float = 20.0

    def axis_model(self, dt, dt0):
        """Return A, b and Q for a step of dt."""
        left = np.exp(-dt / self.tau_s)
        A = np.array([[1.0, dt, -0.5 * dt**2], [0.0, 1.0, -dt], [0.0, 0.0, left]])
        b = np.array([0.5 * dt**2, dt, 0.0])
        Q = self.accel_mps2**2 * (dt0 / dt) * np.outer(b, b)
        Q[2, 2] = self.bias_mps2**2 * (1.0 - left**2)
        return A, b, Q

    def initial_variances(self):
        """Return that of the bias."""
        return np.array([self.bias_mps2**2])


# 4. One run, step by step: what it says, and what it looks like.
estimates = {
    "baseline": api.estimate(recording, filter="baseline", attitude="real"),
    "wearing off": api.estimate(recording, filter=WearingOff(tau_s=10.0), attitude="real"),
}
for name, estimate in estimates.items():
    print(f"{name}: {api.evaluate(estimate, recording)['position_rmse_m']:.4f} m")
api.figure(recording, estimates).savefig(folder / "errors.png")

# 5. A study: every filter with every adaptation, with and without an outage, stored as it goes.
study = api.sweep(
    folder / "study",
    dataset=log,
    disturbance=["none", {"name": "gnss_outage", "windows_s": [[30.0, 40.0]]}],
    filter=["gnss_only", "baseline", WearingOff(tau_s=10.0)],
    adaptation=["none", "mtf"],
)
print(api.table(study, rows=["disturbance", "filter"], columns=["adaptation"]))
