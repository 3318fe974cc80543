"""Time and memory to write and read ROS bags.

    python benchmarks/bags.py [--rounds 9] [--hours 2]

The first table contains CPU times for a simulated drive of 150 s with 31 500 messages (IMU and odometry at 100 Hz,
fixes at 10 Hz): the time to read the messages, to read a recording for the first time, and to read the recording from
the cache. The times are medians, except for the first reading, which is timed once. The second table contains the
elapsed time and the peak memory for a drive of several hours at 100 Hz. Each step runs in a separate process.
"""

import argparse
import dataclasses
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np

from jerkbench.datasets.field import FieldWhite
from jerkbench.datasets.rosbag import RosBag
from jerkbench.io.bag import Messages, open_bag
from jerkbench.io.bag_writing import write_bag
from jerkbench.recording import Recording

FIELDS = {
    "/fixposition/poiimu": ("angular_velocity", "linear_acceleration"),
    "/fixposition/gnss1": ("status", "latitude", "longitude", "altitude", "position_covariance"),
    "/fixposition/odometry_ecef": ("position", "orientation", "linear"),
}
SHORT_S = 150.0
T = TypeVar("T")


def main() -> None:
    """Measure the selected steps and print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=9, help="number of rounds (default 9)")
    parser.add_argument(
        "--hours", type=float, default=2.0, help="duration of the long drive; 0 omits the second table (default 2)"
    )
    parser.add_argument("--step", choices=("write", "read"), help=argparse.SUPPRESS)
    parser.add_argument("--bag", type=Path, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.step:
        long_step(chosen.step, chosen.bag, chosen.hours)
        return
    with TemporaryDirectory() as folder:
        os.environ["JERKBENCH_CACHE"] = folder
        speed(Path(folder), chosen.rounds)
        if chosen.hours:
            memory(Path(folder), chosen.hours)


def write(path: Path, duration_s: float) -> None:
    """Write a simulated drive to a bag. The velocities and headings in the bag come from the odometry."""
    drive = FieldWhite(duration_s=duration_s, gnss_rate_hz=10.0).load(0)
    write_bag(dataclasses.replace(drive, velocity=None, heading=None), path)


def speed(folder: Path, rounds: int) -> None:
    """Print a row with the reading times for each format."""
    print("| bag | messages only | recording, first time | recording, second time |\n|---|---|---|---|")
    for name in ("drive.bag", "drive.db3", "drive.mcap"):
        path = folder / name
        write(path, SHORT_S)
        _, first_s = elapsed(lambda path=path: RosBag(str(path)).load(0))
        took = [[elapsed(partial(read, path))[1] for read in (messages, recording)] for _ in range(rounds)]
        alone_s, again_s = np.median(took, axis=0)
        print(f"| {path.suffix} | {alone_s:.2f} s | {first_s:.2f} s | {again_s:.3f} s |")


def messages(path: Path) -> dict[str, Messages]:
    """Read the messages from the bag, without the cache."""
    with open_bag(path) as bag:
        return bag.read(FIELDS)


def recording(path: Path) -> Recording:
    """Read a recording, or load it from the cache if it was read before."""
    return RosBag(str(path)).load(0)


def elapsed(read: Callable[[], T]) -> tuple[T, float]:
    """Return the result of ``read`` and its CPU time [s]."""
    began = time.process_time()
    result = read()
    return result, time.process_time() - began


def memory(folder: Path, hours: float) -> None:
    """Write and read a long drive, each step in a separate process."""
    print("\n| step | file | time | peak memory |\n|---|---|---|---|")
    for name in ("long.bag", "long.mcap"):
        for step in ("write", "read", "read"):
            words = ["--step", step, "--bag", str(folder / name), "--hours", str(hours)]
            subprocess.run([sys.executable, __file__, *words], check=True)  # noqa: S603 - runs this script
        (folder / name).unlink()


def long_step(step: str, path: Path, hours: float) -> None:
    """Execute one step, and print its elapsed time and peak memory."""
    began = time.perf_counter()
    if step == "write":
        write(path, 3600.0 * hours)
    else:
        RosBag(str(path)).load(0)
    seconds, size = time.perf_counter() - began, path.stat().st_size / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"| {step} | {path.suffix}, {hours:g} h, {size:.0f} MB | {seconds:.1f} s | {peak:.0f} MiB |", flush=True)


if __name__ == "__main__":
    main()
