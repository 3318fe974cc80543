"""Speed and accuracy of `eskf15` on a real drive, compared with KF-GINS (C++) and python-ins.

    python benchmarks/drive.py FOLDER [--kf-gins SOURCE] [--python-ins-s 60]

FOLDER contains the data of the data set `rtklib` (the documentation names the source). SOURCE is a copy of the public
repository of KF-GINS. The script compiles the filter of KF-GINS and the loop in kf_gins_loop.cpp with g++ and Eigen,
optimised for this machine. The fixes have a standard deviation of 1 cm and a rate of 1 Hz. Velocities are not used. The
withheld fixes are the reference. All programs read from memory and store their positions. KF-GINS has 21 states and
models the rotation of the Earth, `eskf15` has 15 states and a flat Earth, and python-ins has 15 states. python-ins is
slow, so it processes only a part of the drive, and updates its covariance in steps of 0.25 s. The times are CPU times
per IMU sample: the minimum of five runs, for python-ins the time of one run. If a program is not available, the script
prints the reason.
"""

import argparse
import shutil
import subprocess
import tempfile
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lines import timed

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.arrays import FloatArray
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.rtklib import RtklibDrive
from jerkbench.disturbances.outages import Withhold
from jerkbench.estimate import Attitude
from jerkbench.filters.eskf15 import Eskf15
from jerkbench.geometry import enu_to_geodetic, geodetic_to_enu
from jerkbench.recording import Imu, Recording

SIGMA_M, ARW_DEG_PER_SQRT_H, VRW_MPS_PER_SQRT_H = 0.01, 6.0, 1.8
GYRO_BIAS_DEG_PER_H, ACCEL_BIAS_MPS2, SCALE_PPM = 500.0, 0.1, 300.0
FLIP = np.array([1.0, -1.0, -1.0])
"""FLU to FRD."""
SETTLED_S = 60.0


class Result(NamedTuple):
    """Result of one program.

    Attributes:
        name: name of the program.
        sample_us: CPU time per IMU sample.
        rmse_m: position RMSE after the first minute.
    """

    name: str
    sample_us: float
    rmse_m: float

    def line(self, ours: "Result") -> str:
        """Return a line with the name, the time, the ratio to the time of ``ours``, and the RMSE."""
        return (
            f"{self.name:<34}{self.sample_us:>10.3f} us{self.sample_us / ours.sample_us:>9.1f} x{self.rmse_m:>9.3f} m"
        )


def drive(folder: Path) -> tuple[Recording, Attitude]:
    """Return the recording and the initial attitude."""
    dataset = RtklibDrive(str(folder), imu_shift_s=-0.2, min_speed_mps=0.0)
    recording = Withhold(every=4, phase=0).apply(dataset.load(), 0)
    return recording, Tilt(sigma_accel_mps2=0.5, propagation="exact").estimate(recording)


def rmse_m(recording: Recording, t_s: FloatArray, enu_m: FloatArray) -> float:
    """Return the RMSE of linearly interpolated positions at the reference times after the first minute."""
    reference = recording.reference
    assert reference is not None  # noqa: S101 - the drive has a reference
    asked = (reference.t_s >= max(SETTLED_S, t_s[0])) & (reference.t_s <= t_s[-1])
    path = np.column_stack([np.interp(reference.t_s[asked], t_s, axis) for axis in enu_m.T])
    return float(np.sqrt(np.mean(np.sum((path - reference.enu_m[asked]) ** 2, axis=1))))


def imu_increments(imu: Imu) -> FloatArray:
    """Return (n, 7) rows: time, rotation [rad] and velocity change [m/s] over the interval before the time, FRD."""
    interval_s = imu.intervals_s[:, None]
    return np.column_stack([imu.t_s, imu.gyro_radps * FLIP * interval_s, imu.accel_mps2 * FLIP * interval_s])


def ours(recording: Recording, attitude: Attitude) -> Result:
    """Measure one run of `eskf15` with its trajectory."""
    model = Eskf15(ARW_DEG_PER_SQRT_H, VRW_MPS_PER_SQRT_H, use_velocity=False, position_sigma_m=SIGMA_M)
    run = partial(model.estimate_compiled, recording, attitude, NoAdaptation())
    run()
    seconds, estimate = timed(run, 5)
    assert estimate is not None  # noqa: S101 - eskf15 has compiled code
    assert recording.reference is not None  # noqa: S101 - the drive has a reference
    t_s = recording.reference.t_s[estimate.index]
    error_m = rmse_m(recording, t_s, estimate.position_m)
    return Result("eskf15, compiled", seconds / len(recording.inertial.t_s) * 1e6, error_m)


def kf_gins(recording: Recording, attitude: Attitude, source: Path | None) -> Result | str:
    """Measure the loop of KF-GINS, or return the reason why this is impossible."""
    eigen = next((p for p in map(Path, ("/usr/include/eigen3", "/usr/local/include/eigen3")) if p.is_dir()), None)
    compiler = shutil.which("g++")
    if source is None or not (source / "src/kf-gins/gi_engine.cpp").is_file():
        return "KF-GINS is not timed: --kf-gins names no copy of its source."
    if compiler is None or eigen is None:
        return "KF-GINS is not timed: g++ and Eigen are not both installed (apt install g++ libeigen3-dev)."
    with tempfile.TemporaryDirectory() as name:
        program = Path(name) / "loop"
        parts = [Path(__file__).with_name("kf_gins_loop.cpp"), *(source / "src/kf-gins").glob("*.cpp")]
        flags = ["-O3", "-march=native", "-DNDEBUG", "-std=c++17", f"-I{source / 'src'}", f"-I{eigen}"]
        subprocess.run([compiler, *flags, *map(str, parts), "-o", str(program)], check=True)  # noqa: S603 - fixed
        return _run_kf_gins(recording, attitude, program)


def _run_kf_gins(recording: Recording, attitude: Attitude, program: Path) -> Result:
    position, origin = recording.position, recording.origin
    assert position is not None  # noqa: S101 - the drive has fixes
    assert origin is not None  # noqa: S101 - and an origin
    imu = imu_increments(recording.inertial)
    fixes = np.column_stack(
        [position.t_s, enu_to_geodetic(position.enu_m, origin), np.full((len(position.t_s), 3), SIGMA_M)]
    )
    fixes[:, 1:3] = np.radians(fixes[:, 1:3])
    fixes = fixes[position.t_s > imu[1, 0]]
    imu = imu[int(np.searchsorted(imu[:, 0], fixes[0, 0])) - 1 :]
    files = {"options": _options(attitude, fixes), "imu": imu, "gnss": fixes[1:]}
    for name, numbers in files.items():
        np.ascontiguousarray(numbers).tofile(program.with_name(name))
    paths = [str(program.with_name(name)) for name in (*files, "out")]
    finished = subprocess.run([str(program), *paths], check=True, capture_output=True, text=True)  # noqa: S603 - fixed
    out = np.fromfile(paths[-1]).reshape(-1, 4)
    enu_m = geodetic_to_enu(*np.degrees(out[:, 1:3]).T, out[:, 3], origin)
    return Result("KF-GINS, its loop", float(finished.stdout) / len(out) * 1e6, rmse_m(recording, out[:, 0], enu_m))


def _options(attitude: Attitude, fixes: FloatArray) -> FloatArray:
    """Return the options that kf_gins_loop.cpp reads, with the initial state at the first fix."""
    hour_s, degree = 3600.0, np.pi / 180.0
    roll, pitch, yaw = attitude.euler_rad[int(np.searchsorted(attitude.t_s, fixes[0, 0]))]
    sensors = GYRO_BIAS_DEG_PER_H * degree / hour_s, ACCEL_BIAS_MPS2, SCALE_PPM * 1e-6, SCALE_PPM * 1e-6
    noises = ARW_DEG_PER_SQRT_H * degree / 60.0, VRW_MPS_PER_SQRT_H / 60.0, *sensors
    start = [*fixes[0, 1:4], 0.0, 0.0, 0.0, roll, -pitch, np.pi / 2.0 - yaw]
    deviations = [*[SIGMA_M] * 3, *[0.1] * 3, degree, degree, 3.0 * degree]
    return np.array([*start, *deviations, *np.repeat(noises, 3), hour_s])


def python_ins(recording: Recording, attitude: Attitude, seconds: float) -> Result | str:
    """Measure python-ins on a part of the drive, or return the reason why this is impossible."""
    try:
        import pandas as pd
        from pyins import filters, inertial_sensor, measurements, strapdown
    except ImportError:
        return "python-ins is not timed: it is not installed (pip install python-ins pandas)."
    position, origin = recording.position, recording.origin
    assert position is not None  # noqa: S101 - the drive has fixes
    assert origin is not None  # noqa: S101 - and an origin
    samples = imu_increments(recording.inertial)
    samples = samples[samples[:, 0] < seconds]
    columns = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    increments = strapdown.compute_increments_from_imu(
        pd.DataFrame(samples[:, 1:], samples[:, 0], columns), "increment"
    )
    begin = int(np.flatnonzero(position.t_s > samples[1, 0])[0])
    first = int(np.searchsorted(increments.index, position.t_s[begin]))
    roll, pitch, yaw = np.degrees(attitude.euler_rad[first])
    names, lla = ["lat", "lon", "alt"], enu_to_geodetic(position.enu_m, origin)
    pva = pd.Series(
        [*lla[begin], 0.0, 0.0, 0.0, roll, -pitch, 90.0 - yaw],
        [*names, "VN", "VE", "VD", "roll", "pitch", "heading"],
        name=increments.index[first],
    )
    gyro = inertial_sensor.EstimationModel(bias_sd=0.0024, noise=np.radians(ARW_DEG_PER_SQRT_H) / 60.0)
    accel = inertial_sensor.EstimationModel(bias_sd=ACCEL_BIAS_MPS2, noise=VRW_MPS_PER_SQRT_H / 60.0)
    aiding = [measurements.Position(pd.DataFrame(lla, position.t_s, names), SIGMA_M)]
    rest = increments.iloc[first + 1 :]
    passed_s, result = timed(
        lambda: filters.run_feedback_filter(pva, 0.02, 0.02, 1.0, 3.0, rest, gyro, accel, aiding, time_step=0.25), 1
    )
    path = result.trajectory
    enu_m = geodetic_to_enu(*path[names].to_numpy().T, origin)
    error_m = rmse_m(recording, path.index.to_numpy(), enu_m) if path.index[-1] > SETTLED_S else float("nan")
    return Result(f"python-ins, first {seconds:.0f} s", passed_s / len(rest) * 1e6, error_m)


def print_drive(folder: Path, source: Path | None, seconds: float) -> None:
    """Measure each program and print its line."""
    recording, attitude = drive(folder)
    base = ours(recording, attitude)
    for result in (base, kf_gins(recording, attitude, source), python_ins(recording, attitude, seconds)):
        print(result if isinstance(result, str) else result.line(base), flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder with the data of the drive")
    parser.add_argument("--kf-gins", type=Path, help="copy of the repository of KF-GINS")
    parser.add_argument(
        "--python-ins-s", type=float, default=60.0, help="duration of the part of the drive for python-ins [s]"
    )
    asked = parser.parse_args()
    print_drive(asked.folder, asked.kf_gins, asked.python_ins_s)


if __name__ == "__main__":
    main()
