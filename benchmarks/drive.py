"""The inertial navigation on the real drive beside others: the filter loop of KF-GINS (C++), and python-ins.

    python benchmarks/drive.py FOLDER [--kf-gins SOURCE] [--python-ins-s 60]

FOLDER is the data of `rtklib` (docs name where they come from), SOURCE a copy of KF-GINS's public repository; g++ and
Eigen compile its filter and the loop in kf_gins_loop.cpp, with the flags that suit this machine. Fixes of 1 cm at 1 Hz,
no velocity, the reference the fixes between. Each reads what lies in memory and keeps its positions; KF-GINS has 21
states and the Earth's rotation, ours 15 and a plane, python-ins 15. python-ins goes over so many seconds of the drive
only, its covariance in steps of 0.25 s, because it is slow. CPU times of a sample of the IMU, the smallest of five, and
of python-ins of one. What is not there is named.
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
    """What came out.

    Attributes:
        name: what ran.
        sample_us: its time for a sample of the IMU.
        rmse_m: of its positions after a minute.
    """

    name: str
    sample_us: float
    rmse_m: float

    def line(self, ours: "Result") -> str:
        """Name, time, ratio, error."""
        return (
            f"{self.name:<34}{self.sample_us:>10.3f} us{self.sample_us / ours.sample_us:>9.1f} x{self.rmse_m:>9.3f} m"
        )


def drive(folder: Path) -> tuple[Recording, Attitude]:
    """The recording, and the attitude from which the navigation begins."""
    dataset = RtklibDrive(str(folder), imu_shift_s=-0.2, min_speed_mps=0.0)
    recording = Withhold(every=4, phase=0).apply(dataset.load(), 0)
    return recording, Tilt(sigma_accel_mps2=0.5, propagation="exact").estimate(recording)


def rmse_m(recording: Recording, t_s: FloatArray, enu_m: FloatArray) -> float:
    """Of positions at ``t_s``, at the stamps of the reference after a minute, along the chord between them."""
    reference = recording.reference
    assert reference is not None  # noqa: S101 - the drive has one
    asked = (reference.t_s >= max(SETTLED_S, t_s[0])) & (reference.t_s <= t_s[-1])
    path = np.column_stack([np.interp(reference.t_s[asked], t_s, axis) for axis in enu_m.T])
    return float(np.sqrt(np.mean(np.sum((path - reference.enu_m[asked]) ** 2, axis=1))))


def imu_increments(imu: Imu) -> FloatArray:
    """Time, rotation [rad] and change of velocity [m/s] (n, 7) over the interval that ends there, FRD."""
    interval_s = imu.intervals_s[:, None]
    return np.column_stack([imu.t_s, imu.gyro_radps * FLIP * interval_s, imu.accel_mps2 * FLIP * interval_s])


def ours(recording: Recording, attitude: Attitude) -> Result:
    """`eskf15`, one run with its trajectory."""
    model = Eskf15(ARW_DEG_PER_SQRT_H, VRW_MPS_PER_SQRT_H, use_velocity=False, position_sigma_m=SIGMA_M)
    run = partial(model.estimate_compiled, recording, attitude, NoAdaptation())
    run()
    seconds, estimate = timed(run, 5)
    assert estimate is not None  # noqa: S101 - numba compiles it
    assert recording.reference is not None  # noqa: S101 - the drive has one
    t_s = recording.reference.t_s[estimate.index]
    error_m = rmse_m(recording, t_s, estimate.position_m)
    return Result("eskf15, compiled", seconds / len(recording.inertial.t_s) * 1e6, error_m)


def kf_gins(recording: Recording, attitude: Attitude, source: Path | None) -> Result | str:
    """The loop of KF-GINS, or why it cannot be timed."""
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
        subprocess.run([compiler, *flags, *map(str, parts), "-o", str(program)], check=True)  # noqa: S603 - ours
        return _run_kf_gins(recording, attitude, program)


def _run_kf_gins(recording: Recording, attitude: Attitude, program: Path) -> Result:
    position, origin = recording.position, recording.origin
    assert position is not None  # noqa: S101 - the drive has fixes
    assert origin is not None  # noqa: S101 - and a place
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
    finished = subprocess.run([str(program), *paths], check=True, capture_output=True, text=True)  # noqa: S603 - ours
    out = np.fromfile(paths[-1]).reshape(-1, 4)
    enu_m = geodetic_to_enu(*np.degrees(out[:, 1:3]).T, out[:, 3], origin)
    return Result("KF-GINS, its loop", float(finished.stdout) / len(out) * 1e6, rmse_m(recording, out[:, 0], enu_m))


def _options(attitude: Attitude, fixes: FloatArray) -> FloatArray:
    """The numbers that kf_gins_loop.cpp asks for, of the first fix."""
    hour_s, degree = 3600.0, np.pi / 180.0
    roll, pitch, yaw = attitude.euler_rad[int(np.searchsorted(attitude.t_s, fixes[0, 0]))]
    sensors = GYRO_BIAS_DEG_PER_H * degree / hour_s, ACCEL_BIAS_MPS2, SCALE_PPM * 1e-6, SCALE_PPM * 1e-6
    noises = ARW_DEG_PER_SQRT_H * degree / 60.0, VRW_MPS_PER_SQRT_H / 60.0, *sensors
    start = [*fixes[0, 1:4], 0.0, 0.0, 0.0, roll, -pitch, np.pi / 2.0 - yaw]
    deviations = [*[SIGMA_M] * 3, *[0.1] * 3, degree, degree, 3.0 * degree]
    return np.array([*start, *deviations, *np.repeat(noises, 3), hour_s])


def python_ins(recording: Recording, attitude: Attitude, seconds: float) -> Result | str:
    """python-ins over a part of the drive, or why it cannot be timed."""
    try:
        import pandas as pd
        from pyins import filters, inertial_sensor, measurements, strapdown
    except ImportError:
        return "python-ins is not timed: it is not installed (pip install python-ins pandas)."
    position, origin = recording.position, recording.origin
    assert position is not None  # noqa: S101 - the drive has fixes
    assert origin is not None  # noqa: S101 - and a place
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
    return Result(f"python-ins, {seconds:.0f} s of it", passed_s / len(rest) * 1e6, error_m)


def print_drive(folder: Path, source: Path | None, seconds: float) -> None:
    """Print a line for each."""
    recording, attitude = drive(folder)
    base = ours(recording, attitude)
    for result in (base, kf_gins(recording, attitude, source), python_ins(recording, attitude, seconds)):
        print(result if isinstance(result, str) else result.line(base), flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="the data of the drive")
    parser.add_argument("--kf-gins", type=Path, help="a copy of KF-GINS's repository")
    parser.add_argument("--python-ins-s", type=float, default=60.0, help="how much of the drive python-ins gets [s]")
    asked = parser.parse_args()
    print_drive(asked.folder, asked.kf_gins, asked.python_ins_s)


if __name__ == "__main__":
    main()
