"""The time and the memory that reading a bag takes, in two tables.

    python benchmarks/bags.py [--rounds 9] [--hours 2]

Speed: a simulated drive of 150 s, 31 500 messages (IMU and odometry 100 Hz, fixes 10 Hz). Read are the fields that a
recording is made of; beside that stands rosbags' AnyReader with the ordinary deserialiser, alone and with the same
fields put into arrays, and whether these are equal to the bit. Then a whole recording, the first and the second time
(from the cache). In each round all three run one after the other; the medians of times and of ratios are printed.
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
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from jerkbench.datasets.field import FieldWhite
from jerkbench.datasets.rosbag import RosBag
from jerkbench.io.bag import Messages, open_bag
from jerkbench.io.bag_decode import MessageBlock, decode_each
from jerkbench.io.bag_writing import write_bag

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
    """Compare the fast reading with the ordinary one, format by format."""
    print("| bag | messages | AnyReader | with arrays | jerkbench | faster than these | equal | recording | again |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in ("drive.bag", "drive.db3", "drive.mcap"):
        path = folder / name
        write(path, SHORT_S)
        _, first_s = elapsed(lambda path=path: RosBag(str(path)).load(0))
        again_s = np.median([elapsed(lambda path=path: RosBag(str(path)).load(0))[1] for _ in range(rounds)])
        took = [[elapsed(partial(read, path)) for read in (deserialised, ordinarily, quickly)] for _ in range(rounds)]
        (count, _), (slow, _), (fast, _) = took[0]
        ordinary_s, slow_s, fast_s = np.median([[s for _, s in times] for times in took], axis=0)
        ratios = ", ".join(f"{np.median([times[k][1] / times[2][1] for times in took]):.1f}" for k in (0, 1))
        print(
            f"| {path.suffix} | {count} | {ordinary_s:.2f} s | {slow_s:.2f} s | {fast_s:.3f} s |"
            f" {ratios} times | {equal(slow, fast)} | {first_s:.3f} s | {again_s:.3f} s |"
        )


def deserialised(path: Path) -> int:
    """Deserialise every message of the topics, and keep nothing."""
    with AnyReader([path], default_typestore=store(path)) as reader:
        wanted = [connection for connection in reader.connections if connection.topic in FIELDS]
        return sum(1 for c, _, raw in reader.messages(wanted) if reader.deserialize(raw, c.msgtype))


def ordinarily(path: Path) -> dict[str, MessageBlock]:
    """Deserialise every message of the topics, and put the fields into arrays."""
    raws: dict[str, list[bytes]] = {topic: [] for topic in FIELDS}
    with AnyReader([path], default_typestore=store(path)) as reader:
        types = {c.topic: c.msgtype for c in reader.connections}
        for c, _, raw in reader.messages([c for c in reader.connections if c.topic in FIELDS]):
            raws[c.topic].append(raw)
        return {t: decode_each(some, types[t], FIELDS[t], reader.deserialize) for t, some in raws.items()}


def quickly(path: Path) -> dict[str, Messages]:
    """Read the same with this package, without its cache."""
    with open_bag(path) as bag:
        return bag.read(FIELDS)


def equal(slow: dict[str, MessageBlock], fast: dict[str, Messages]) -> str:
    """Say whether all arrays have the same bytes."""
    pairs = [(slow[t].values[f], fast[t][f]) for t, fields in FIELDS.items() for f in fields]
    pairs += [(slow[t].stamp_ns, fast[t].stamp_ns) for t in FIELDS]
    return "to the bit" if all(np.asarray(a).tobytes() == np.asarray(b).tobytes() for a, b in pairs) else "no"


def store(path: Path) -> object:
    """The types of a bag that carries none."""
    return get_typestore(Stores.ROS1_NOETIC if path.suffix == ".bag" else Stores.ROS2_HUMBLE)


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
