"""Hundreds of hostile inputs. No command should end with a traceback or without a message, or hang.

Each family of inputs is a function in `FAMILIES`, which yields an `Outcome` for each input.
"""

import argparse
import contextlib
import io
import itertools
import os
import random
import resource
import shlex
import signal
import subprocess
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from time import monotonic
from typing import NamedTuple

import hostile_recordings
from command_lines import SHORT, CommandLines

from jerkbench.cli import main as jerkbench

SILENT_S = 20
"""Maximum CPU time without output [s]. CPU time does not depend on other processes."""
MAX_CHORD_S = 180
"""Maximum elapsed time of a command."""
MEMORY_BYTES = 12 * 2**30
"""Limit of the address space, so that an input that allocates too much memory does not stop the machine."""


class Outcome(NamedTuple):
    """Outcome of an input.

    Attributes:
        tried: the command line of the input.
        kind: "refused" (error message), "survived" (exit code 0), or "broken".
        why: end of the output if the kind is "broken".
        seconds: elapsed time.
    """

    tried: str
    kind: str
    why: str
    seconds: float


class Silence(BaseException):
    """A command printed nothing for too long, or did not end. No `except Exception` catches this exception."""


def attempt(words: Sequence[str], folder: Path, silent_s: float | None = None) -> Outcome:
    """Run `jerkbench WORDS` in this process in ``folder``, without output for at most ``silent_s`` or `SILENT_S`."""
    out, err = io.StringIO(), io.StringIO()
    began = monotonic()
    with (
        contextlib.chdir(folder),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        _impatient(silent_s or SILENT_S, out, err),
    ):
        kind, why = _ended(words, err)
    return Outcome(shlex.join(words), kind, why, monotonic() - began)


def _ended(words: Sequence[str], err: io.StringIO) -> tuple[str, str]:
    before = sys.argv
    try:
        jerkbench(list(words))
    except SystemExit as end:
        if "Traceback" in err.getvalue():
            return "broken", err.getvalue()[-300:]
        if end.code and not err.getvalue().strip():
            return "broken", f"ended with {end.code} without a word"
        return ("refused" if end.code else "survived"), ""
    except Silence as silence:
        return "broken", f"silent: {''.join(traceback.format_exception(silence)[-3:])}"
    except BaseException as error:  # noqa: BLE001 - any exception would print a traceback
        return "broken", "".join(traceback.format_exception(error)[-3:])
    finally:
        sys.argv = before
    return "survived", ""


@contextlib.contextmanager
def _impatient(silent_s: float, *streams: io.StringIO) -> Iterator[None]:
    """Raise `Silence` after ``silent_s`` of CPU time without output, or after `MAX_CHORD_S` of elapsed time."""
    lengths = [0]

    def listen(*_: object) -> None:
        lengths.append(sum(len(stream.getvalue()) for stream in streams))
        if lengths[-1] == lengths[-2]:
            raise Silence

    def give_up(*_: object) -> None:
        raise Silence

    before = signal.signal(signal.SIGPROF, listen), signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_PROF, silent_s, silent_s)
    signal.setitimer(signal.ITIMER_REAL, MAX_CHORD_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGPROF, before[0])
        signal.signal(signal.SIGALRM, before[1])


def a_study(folder: Path) -> Path:
    """Run a small sweep, which also imports the libraries, and return the folder of its study."""
    done = attempt(
        ["run", "-m", *SHORT, "filter=baseline,jerk", "adaptation=none,mtf", "study=whole"], folder, MAX_CHORD_S
    )
    if done.kind != "survived":
        raise RuntimeError(f"the study for the commands could not be computed: {done.why}")
    return folder / "results" / "whole"


def command_lines(count: int, seed: int, folder: Path) -> Iterator[Outcome]:
    """Yield the outcomes of random command lines. Two thirds of the command lines start with `jerkbench run`."""
    lines = CommandLines(seed, a_study(folder))
    for number in range(count):
        yield attempt(lines.other() if number % 3 == 2 else lines.run(), folder)


def closed_streams(count: int, seed: int, folder: Path) -> Iterator[Outcome]:
    """Yield the outcomes of commands whose streams are closed, full or not read, each in a separate process."""
    study = shlex.quote(str(a_study(folder)))
    run = f"run {shlex.join(SHORT)}"
    asked = ("table {0}", "table {0} --findings", "cite {0}", "compare {0} {0}")
    verbs = ["list", "run --help", f"{run} --dry", f"{run} -m filter=baseline,jerk", *(v.format(study) for v in asked)]
    ways = list(itertools.product(STREAMS, verbs))
    for streams, verb in itertools.islice(itertools.cycle(ways), seed, seed + count):
        yield _in_a_shell(f"{shlex.quote(sys.executable)} -m jerkbench {verb} {streams}", folder)


def _in_a_shell(command: str, folder: Path) -> Outcome:
    began = monotonic()
    try:
        done = subprocess.run(  # noqa: S603 - fixed
            ["/bin/sh", "-c", command], cwd=folder, capture_output=True, text=True, check=False, timeout=MAX_CHORD_S
        )
    except subprocess.TimeoutExpired:
        return Outcome(command, "broken", "hangs", monotonic() - began)
    said = done.stdout + done.stderr
    fault = "Traceback" in said or "Exception ignored" in said or done.returncode not in (0, 1, 2)
    kind = "broken" if fault else "refused" if done.returncode else "survived"
    return Outcome(command, kind, said[-300:], monotonic() - began)


def yaml_files(count: int, seed: int, folder: Path) -> Iterator[Outcome]:
    """Yield the outcomes of presets that expand to more than the memory, are nested too deeply, or are invalid YAML."""
    rng = random.Random(seed)  # noqa: S311 - not for cryptography
    for number in range(count):
        place = folder / f"presets-{number}" / "experiment"
        place.mkdir(parents=True)
        text = rng.choice(BOMBS)(rng.randint(2, 60), rng.randint(2, 300))
        (place / "bomb.yaml").write_bytes(b"# @package _global_\n" + text.encode("utf-8", "surrogateescape"))
        yield attempt(["run", "--dry", "--config-dir", str(place.parent), "experiment=bomb", *SHORT], folder)


READ_SILENT_S = 5
"""Maximum CPU time without output for a damaged recording [s]."""
SMOOTHED = 20
"""One of `SMOOTHED` damaged tracks is smoothed. The other tracks are only inspected."""


def tracks(count: int, seed: int, folder: Path) -> Iterator[Outcome]:
    """Yield the outcomes of NMEA, GPX and CSV files with damaged fields."""
    attempt(["data", "inspect", "field", "--set", "duration_s=9"], folder, MAX_CHORD_S)  # imports the libraries
    for number in range(count):
        path = hostile_recordings.track(number, seed, folder)
        smooth = number % SMOOTHED == SMOOTHED - 1
        words = ["smooth", str(path), "--to", f"{number}.smooth.gpx"] if smooth else ["data", "inspect", str(path)]
        yield attempt(words, folder, READ_SILENT_S)


def arrays(count: int, seed: int, folder: Path) -> Iterator[Outcome]:
    """Yield the outcomes of HDF5 and MATLAB files with damaged arrays, links and bytes."""
    attempt(["data", "inspect", "field", "--set", "duration_s=9"], folder, MAX_CHORD_S)
    for number in range(count):
        yield attempt(hostile_recordings.arrays(number, seed, folder), folder, READ_SILENT_S)


STREAMS = (">&-", "2>&-", "<&-", ">&- 2>&- <&-", ">/dev/full", "2>/dev/full", "| true", "2>&1 | head -c 1")
"""Redirections of the streams of a command."""


def chained(first: str, link: str) -> Callable[[int, int], str]:
    """Return a function that returns ``deep`` lines of YAML, each of which refers ``wide`` times to the line before."""

    def text(deep: int, wide: int) -> str:
        lines = (link.format(k=k, all=",".join([f"*a{k - 1}"] * wide)) for k in range(1, deep))
        return "\n".join([first, *lines, ""])

    return text


BOMBS: tuple[Callable[[int, int], str], ...] = (
    chained("a0: &a0 x", "a{k}: &a{k} [{all}]"),
    chained("a0: &a0 {x: 1}", "a{k}: &a{k} {{<<: [{all}]}}"),
    lambda deep, wide: f"notes: {'[' * deep * wide}{']' * deep * wide}\n",
    lambda deep, wide: f"study: '{'${results}' * wide}'\nresults: '{'${dataset.name}' * deep}'\n",
    lambda deep, wide: f"study: '{'${results}' * wide}'\nresults: '{'${study}' * deep}'\n",
    lambda deep, wide: f"notes: ['{'${oc.env:HOME}' * (deep % 5)}', '{'x' * wide}']\n",
    lambda deep, _: f"seeds: {'9' * deep}\n",
    lambda deep, wide: f"a: &a [*a]\nb: {deep}{wide}\n",
    lambda deep, wide: f"? {'- ' * deep}\n: {{{'[' * wide}\n",
    lambda deep, wide: "\x00" * deep + "\udcff" * wide,
    lambda deep, _: "".join(f"study: a{k}\n" for k in range(deep)),
    lambda deep, _: f"study: !!python/object/apply:os.system [{deep}]\n",
)
"""Functions that return the text of a preset for a depth and a width."""

FAMILIES: dict[str, Callable[[int, int, Path], Iterator[Outcome]]] = {
    "command lines": command_lines,
    "closed streams": closed_streams,
    "YAML files": yaml_files,
    "tracks": tracks,
    "arrays": arrays,
}
"""Families of inputs: (number of inputs, seed, empty folder) -> outcomes."""


def main() -> None:
    """Run the selected families and print their table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=500, help="number of inputs in each family")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--family", choices=sorted(FAMILIES), action="append", help="default: all")
    chosen = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    os.environ["HYDRA_FULL_ERROR"] = "1"
    print("| family | inputs | refused | exit code 0 | broken | longest time | memory |\n|---|---|---|---|---|---|---|")
    broken = [line for name in chosen.family or FAMILIES for line in _tried(name, chosen.count, chosen.seed)]
    raise SystemExit(1 if broken else 0)


def _tried(name: str, count: int, seed: int) -> list[Outcome]:
    """Run a family, print its row, and return the broken outcomes. Each broken outcome is printed at once."""
    kinds: Counter[str] = Counter()
    broken, longest_s = [], 0.0
    with tempfile.TemporaryDirectory() as folder:
        for outcome in FAMILIES[name](count, seed, Path(folder)):
            kinds[outcome.kind] += 1
            longest_s = max(longest_s, outcome.seconds)
            if outcome.kind == "broken":
                broken.append(outcome)
                print(f"{outcome.tried}\n    {outcome.why}", file=sys.stderr, flush=True)
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    counts = f"{kinds.total()} | {kinds['refused']} | {kinds['survived']} | {len(broken)}"
    print(f"| {name} | {counts} | {longest_s:.1f} s | {memory_mb:.0f} MB |")
    return broken


if __name__ == "__main__":
    main()
