"""Anybody's program as a method: it reads a recording and writes a trajectory."""

import hashlib
import os
from dataclasses import dataclass
from dataclasses import replace as replaced
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar

from jerkbench.arrays import require_positive
from jerkbench.contracts import Adaptation
from jerkbench.errors import PluginError, RecordingError, unknown
from jerkbench.estimate import Attitude, Estimate
from jerkbench.io.program import command_words, program_files, run_program
from jerkbench.io.recording_folder import FORMATS, write_recording
from jerkbench.io.trajectory import estimate_of
from jerkbench.io.trajectory_files import TrajectoryForm, read_trajectory
from jerkbench.plugins import register
from jerkbench.recording import Recording

SCRIPTS = (".py", ".jl", ".m", ".R", ".sh", ".js", ".rb", ".pl", ".lua")
"""Endings of what an interpreter runs."""


@register("filter", "command")
@dataclass(frozen=True, kw_only=True)
class Command(TrajectoryForm):
    """Runs a program of your own, in any language: it reads the recording and writes what it estimates.

    For each seed the disturbed recording is written to a folder that is deleted afterwards, the command is run without
    a shell, and the trajectory is read::

        jerkbench run filter=command filter.command="./my_filter {recording} {out}"

    {recording} is the file of the first of the ``formats`` (recording.csv: a row for each stamp of any stream, beside
    it recording.json, which explains it; never the reference), {folder} the folder of all, {out} the file to write,
    {seed} the seed. What the file may hold, and how it is evaluated at the reference's stamps, is that of the filter
    `trajectory`. A program that fails, takes too long, or writes nothing that can be scored is a failed run, with what
    it said last. Programs and scripts that the command names stand in the key of a result by their content.

    Attributes:
        command: the words of the command; relative paths are those of where jerkbench is started.
        label: what tables call it, before "(program)"; empty: the name of the script or program.
        formats: what is written: csv, parquet, bag (ROS 1), mcap (ROS 2), kf_gins, pyins.
        out: the name of the file that it writes into {folder}, which is {out}; its ending says of which form it is.
        time_limit_s: so long it may run.
        seed: what {seed} stands for; a run sets it.
    """

    adaptations: ClassVar[tuple[str, ...]] = ("none",)
    for_each_seed: ClassVar[bool] = True

    command: str
    label: str = ""
    formats: tuple[str, ...] = ("csv",)
    out: str = "out.csv"
    time_limit_s: float = 600.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the formats and the time limit."""
        super().__post_init__()
        require_positive("filter command", self, ("time_limit_s",))
        if not self.formats:
            raise PluginError(f"filter command: formats is empty; give one of {', '.join(FORMATS)}.")
        for name in self.formats:
            if name not in FORMATS:
                raise PluginError(unknown("format of a recording", name, FORMATS))

    @property
    def table_label(self) -> str:
        """What tables call it: the label, or the script that an interpreter runs, or the program."""
        return f"{self.label or self._stem}(program)"

    @property
    def _stem(self) -> str:
        program, *others = program_files(self.command)
        return next((path for path in others if path.suffix in SCRIPTS), program).stem

    def of_seed(self, seed: int) -> "Command":
        """Return the one whose {seed} is ``seed``."""
        return replaced(self, seed=seed)

    def fingerprint(self) -> str:
        """Return the SHA-256 over the program, and over the scripts and settings that the command names.

        Raises:
            RecordingError: there is no such program.
        """
        sha = hashlib.sha256()
        for path in program_files(self.command):
            with path.open("rb") as file:
                sha.update(f"{path.name} {hashlib.file_digest(file, 'sha256').hexdigest()} ".encode())
        return sha.hexdigest()

    def remarks(self, recording: Recording) -> tuple[str, ...]:
        """Return which program it is."""
        return (f"{self.table_label}: the program {self.command} (SHA-256 {self.fingerprint()[:12]}).",)

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return what the program makes of the recording.

        Raises:
            RecordingError: the program fails, or what it writes cannot be scored.
        """
        with TemporaryDirectory(prefix="jerkbench_") as name:
            folder = Path(name)
            write_recording(recording, attitude, folder, self.formats, {"seed": self.seed})
            try:
                return self._run(recording, folder)
            except RecordingError as error:  # the folder has another name each time
                raise RecordingError(str(error).replace(f"{folder}{os.sep}", "")) from error

    def _run(self, recording: Recording, folder: Path) -> Estimate:
        out = folder / self.out
        run_program(self._words(folder, out), folder, self.time_limit_s)
        if not out.is_file():
            raise RecordingError(f"The program {self.command} ended well and wrote no {self.out}.")
        return estimate_of(read_trajectory(out, self, recording), recording, self.max_gap_s)

    def _words(self, folder: Path, out: Path) -> list[str]:
        recording = folder / FORMATS[self.formats[0]]
        values = {"recording": recording, "folder": folder, "out": out, "seed": self.seed}
        return command_words(self.command, {name: str(value) for name, value in values.items()})
