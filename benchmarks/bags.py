"""The time and the memory that reading a bag takes, in two tables.

    python benchmarks/bags.py [--rounds 9] [--hours 2]

Speed: a simulated drive of 150 s, 31 500 messages (IMU and odometry 100 Hz, fixes 10 Hz): the fields that a recording
is made of, a recording, and the recording the second time (from the cache). Medians of CPU times are printed.
Memory: a drive of hours at 100 Hz; each step in a process of its own, with its largest resident size.
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
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=9, help="how often all of them are timed (default 9)")
    parser.add_argument("--hours", type=float, default=2.0, help="of the long drive; 0: leave it out (default 2)")
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
    """Write a simulated drive without velocities and headings of its own: those of the odometry are there."""
    drive = FieldWhite(duration_s=duration_s, gnss_rate_hz=10.0).load(0)
    write_bag(dataclasses.replace(drive, velocity=None, heading=None), path)


def speed(folder: Path, rounds: int) -> None:
    """Print the time of the first and of later readings, format by format."""
    print("| bag | the messages alone | a recording, the first time | the second time |\n|---|---|---|---|")
    for name in ("drive.bag", "drive.db3", "drive.mcap"):
        path = folder / name
        write(path, SHORT_S)
        _, first_s = elapsed(lambda path=path: RosBag(str(path)).load(0))
        took = [[elapsed(partial(read, path))[1] for read in (messages, recording)] for _ in range(rounds)]
        alone_s, again_s = np.median(took, axis=0)
        print(f"| {path.suffix} | {alone_s:.2f} s | {first_s:.2f} s | {again_s:.3f} s |")


def messages(path: Path) -> dict[str, Messages]:
    """Read the messages without the cache."""
    with open_bag(path) as bag:
        return bag.read(FIELDS)


def recording(path: Path) -> Recording:
    """Read a recording, the second time from the cache."""
    return RosBag(str(path)).load(0)


def elapsed(read: Callable[[], T]) -> tuple[T, float]:
    """Return what was read, and the CPU time that it took."""
    began = time.process_time()
    result = read()
    return result, time.process_time() - began


def memory(folder: Path, hours: float) -> None:
    """Write and read a long drive, each in a process of its own."""
    print("\n| step | file | time | largest resident size |\n|---|---|---|---|")
    for name in ("long.bag", "long.mcap"):
        for step in ("write", "read", "read"):
            words = ["--step", step, "--bag", str(folder / name), "--hours", str(hours)]
            subprocess.run([sys.executable, __file__, *words], check=True)  # noqa: S603 - this same script
        (folder / name).unlink()


def long_step(step: str, path: Path, hours: float) -> None:
    """Do one step, and print what it took."""
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
