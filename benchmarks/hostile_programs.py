"""Untrusted results whose stored configuration contains a program, which no command may start without permission.

    python benchmarks/hostile_programs.py

Each disguise changes a new copy of a study with two combinations, one of which runs the program, or of a suite entry.
Commands then open the copy. The program appends a line to a file whenever it runs. At the end, a command with the
option `--run-programs` has to start the program.
"""

import json
import os
import shutil
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from hostile_entries import HangError, hang
from hostile_results import answered, sign

from jerkbench.campaign.entry import ENTRY_FILE, HASHED
from jerkbench.campaign.stored_files import file_hashes

PATIENCE_S = 120
"""A command that takes longer counts as hung."""

PROGRAM = """#!/bin/sh
echo ran >> "$(dirname "$0")/ran"
awk -F, 'NR == 1 { print "t_s,east_m,north_m,up_m" } NR > 1 { print $1 ",0,0,0" }' "$1" > "$2"
"""
SWEEP = ("dataset.duration_s=8", "seeds=2", "metrics=[position_rmse]", "figures=false", "workers=1", "study=theirs")
LABEL = "filter"


def made(place: Path) -> tuple[Path, Path]:
    """Compute a study with the program and `baseline`, and a suite entry with the program, and return both folders."""
    program = place / "stands"
    program.write_text(PROGRAM, encoding="utf-8")
    program.chmod(0o755)
    named = ["filter=command", f"filter.command='{program} {{recording}} {{out}}'"]
    answered(["run", *named, *SWEEP])
    answered(["run", "filter=baseline", *SWEEP])
    answered(["suite", "run", *named, "--scale", "v2-tiny", "--workers", "1"])
    return place / "results/theirs", place / "results/suite-v2-tiny/command-none"


def program_part(study: Path) -> Path:
    """Return the file with the combination of the program."""
    for path in sorted((study / "cells").glob("*.parquet")):
        if "command" in pq.read_table(path)["cell.spec.filter"][0].as_py():
            return path
    raise FileNotFoundError(f"{study} does not contain a combination with a program")


def with_spec(part: str, change: Callable[[dict[str, object]], object]) -> Callable[[Path], None]:
    """Return a disguise that changes a part of the specification of the program and updates the digest."""

    def disguise(study: Path) -> None:
        path = program_part(study)
        table = pq.read_table(path)
        changed = json.dumps(change(json.loads(table[f"cell.spec.{part}"][0].as_py())))
        sign(path, with_text(table, f"cell.spec.{part}", changed))

    return disguise


def with_text(table: pa.Table, name: str, text: str) -> pa.Table:
    """Return the rows with a column that contains only ``text``."""
    place = table.column_names.index(name)
    return table.set_column(place, name, pa.array([text] * table.num_rows).cast(table.schema.field(name).type))


def relabelled(study: Path) -> None:
    """Label the combination of the program as another filter."""
    path = program_part(study)
    sign(path, with_text(pq.read_table(path), LABEL, "jerk"))


def alone(study: Path) -> None:
    """Delete all combinations except for the combination of the program."""
    path = program_part(study)
    for other in set((study / "cells").glob("*.parquet")) - {path}:
        other.unlink()


def file_of(name: str, key: str) -> Callable[[dict[str, object]], object]:
    """Return a specification that reads a pipe without a writer."""
    return lambda _: {"name": name, key: str(Path("pipe").absolute())}


def pathless(study: Path) -> None:
    """Replace the command of the study in the manifest with the program."""
    path = study / "manifest.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(content | {"command": ["./stands", "x", "y"]}), encoding="utf-8")


DISGUISES: Mapping[str, Callable[[Path], None]] = {
    "as it is": lambda _: None,
    "another label": relabelled,
    "no other cell": alone,
    "a command of the manifest": pathless,
    "an interpolation": with_spec("filter", lambda own: own | {"label": "${oc.env:HOME}"}),
    "a _target_": with_spec("filter", lambda own: own | {"_target_": "os.system"}),
    "a program as adaptation": with_spec("adaptation", lambda own: own | {"command": "./stands x y"}),
    "a program as dataset": with_spec("dataset", lambda _: {"name": "command", "command": "./stands x y"}),
    "a program as metric": with_spec("metrics", lambda _: ["./stands x y"]),
    "a path as plugin": with_spec("filter", lambda own: own | {"name": "../stands"}),
    "a module as plugin": with_spec("filter", lambda _: {"name": "os:system", "command": "./stands x y"}),
    "a trajectory from a pipe": with_spec("filter", file_of("trajectory", "file")),
    "a table from a pipe": with_spec("dataset", file_of("table", "file")),
    "a bag from a pipe": with_spec("dataset", file_of("rosbag", "file")),
}


def study_words(study: Path, whole: Path) -> dict[str, list[str]]:
    """Return the command lines that open a study."""
    folder = str(study)
    return {
        "table": ["table", folder],
        "table --findings": ["table", folder, "--findings"],
        "compare": ["compare", folder, str(whole)],
        "rerun": ["rerun", folder, "1"],
        "export": ["export", folder, "1", "--tum", str(study / "tum")],
        "cite": ["cite", folder],
        "figures": ["figures", folder],
        "report": ["report", folder, "--scenarios", "1"],
    }


def as_given(entry: Path) -> None:
    """Do not change the entry."""
    del entry


def other_program(entry: Path) -> None:
    """Change the command of the program, and update the hashes."""
    path = entry / ENTRY_FILE
    content = json.loads(path.read_text(encoding="utf-8"))
    content["method"]["filter"]["command"] = "./stands x y"
    path.write_text(json.dumps(content | {"files": file_hashes(entry, HASHED)}), encoding="utf-8")


def other_hashes(entry: Path) -> None:
    """Replace all hashes with wrong hashes."""
    path = entry / ENTRY_FILE
    content = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(content | {"files": dict.fromkeys(HASHED, "0")}), encoding="utf-8")


ENTRY_DISGUISES: Mapping[str, Callable[[Path], None]] = {
    "as it is": as_given,
    "another program": other_program,
    "wrong hashes": other_hashes,
}


def entry_words(entry: Path) -> dict[str, list[str]]:
    """Return the command lines that open an entry."""
    return {
        "suite verify": ["suite", "verify", str(entry), "--rows", "3"],
        "suite board": ["suite", "board", str(entry.parent), "--rows", "3"],
    }


class Watch:
    """Runs commands, and counts their endings and the runs of the program.

    Attributes:
        ran: the file to which the program appends a line.
        counts: numbers of endings for each command.
        faults: number of commands that started the program, hung or ended with a traceback.
        longest_s: time of the longest command.
    """

    def __init__(self, place: Path) -> None:
        """Initialise the counters."""
        self.ran, self.longest_s = place / "ran", 0.0
        self.counts: dict[str, Counter[str]] = {}
        self.faults = 0

    def runs(self) -> int:
        """Return the number of runs of the program."""
        return self.ran.read_text(encoding="utf-8").count("ran")

    def ask(self, verb: str, words: list[str], disguise: str) -> None:
        """Run one command and count its ending."""
        before, began = self.runs(), time.perf_counter()
        signal.alarm(PATIENCE_S)
        try:
            ending, printed = answered(words)
        except HangError as error:
            ending, printed = f"HangError: {error}", ""
        signal.alarm(0)
        self.longest_s = max(self.longest_s, time.perf_counter() - began)
        self.counts.setdefault(verb, Counter())[ending] += 1
        if (started := self.runs() - before) or ":" in ending or "\x1b" in printed or "Traceback" in printed:
            self.faults += 1
            print(f"{verb}, {disguise}: {ending}, the program ran {started} times: {printed[-300:]}", flush=True)


def attack(place: Path) -> int:
    """Run every command on every disguise, print the endings, and return the number of faults."""
    os.chdir(place)
    os.sched_setaffinity(0, set(list(os.sched_getaffinity(0))[:1]))  # draws the figures in this process
    signal.signal(signal.SIGALRM, hang)
    study, entry = made(place)
    os.mkfifo("pipe")
    watch, copy = Watch(place), place / "opened" / "copy"
    for name, disguise in DISGUISES.items():
        fresh(study, copy)
        disguise(copy)
        for verb, words in study_words(copy, study).items():
            watch.ask(verb, words, name)
    for name, disguise in ENTRY_DISGUISES.items():
        fresh(entry, copy)
        disguise(copy)
        for verb, words in entry_words(copy).items():
            watch.ask(verb, words, name)
    before, key = watch.runs(), pq.read_table(program_part(study))["cell.key"][0].as_py()
    answered(["rerun", str(study), key, "--run-programs"])
    for verb, endings in watch.counts.items():
        print(f"{verb}: {', '.join(f'{count} {ending}' for ending, count in endings.most_common())}", flush=True)
    print(f"faults: {watch.faults}; longest command: {watch.longest_s:.1f} s")
    print(f"with --run-programs, the program ran {watch.runs() - before} times")
    return watch.faults


def fresh(made_one: Path, copy: Path) -> None:
    """Replace ``copy`` with a new copy of the folder."""
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(made_one, copy, ignore=shutil.ignore_patterns("runs"))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        raise SystemExit(1 if attack(Path(folder)) else 0)
