"""Filters that read external estimates: a trajectory file, or the output of a program of the user."""

import hashlib
import math
import os
import shlex
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, ClassVar

import numpy as np

from jerkbench.arrays import require_positive
from jerkbench.contracts import Adaptation
from jerkbench.errors import PluginError, RecordingError, require_known
from jerkbench.estimate import Attitude, Estimate
from jerkbench.io.conversions import GPST_MINUS_UTC_S
from jerkbench.io.trajectory import (
    SEED,
    Trajectory,
    TrajectoryForm,
    estimate_at_reference,
    files_digest,
    path_of_seed,
    read_trajectory,
)
from jerkbench.io.writing import FORMATS, write_recording
from jerkbench.parameters import Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("filter", "trajectory")
@dataclass(frozen=True, kw_only=True)
class TrajectoryFile(TrajectoryForm):
    """Reads an estimate from a file and interpolates it at the time stamps of the reference.

    The estimate at the time stamp t of the reference is interpolated linearly between the samples (t_i, p_i) of the
    file::

        p(t) = p_i                                                if t_i = t
        p(t) = p_i + (p_(i+1) - p_i) (t - t_i)/(t_(i+1) - t_i)    if t_i < t < t_(i+1) and t_(i+1) - t_i <= max_gap_s

    Velocity and covariance are also interpolated linearly, and the attitude is interpolated along the shortest
    rotation. The command `jerkbench score` is a short form of `jerkbench run` with this filter. The trajectory is not
    aligned, shifted or scaled. The filter raises an error if a gap is longer than max_gap_s, if a number is not finite,
    or if the trajectory starts after the time from which errors are counted. If the trajectory ends before the
    reference, the run counts as stopped. A metric is NaN if the file does not contain the quantity that the metric
    needs. If the file contains only positions, the metrics of velocity and consistency are NaN.

    Attributes:
        file: path of the trajectory file. If the path contains the placeholder {seed}, each seed has a separate file.
        label: name of the filter in tables, to which "(external)" is appended. If the label is empty, the name of the
            file is used.
    """

    provenance = Provenance("own", "", "A file of the user; see the documentation of the program that wrote it.")

    adaptations: ClassVar[tuple[str, ...]] = ("none",)
    uses_imu: ClassVar[bool] = False

    file: str
    label: str = ""

    @property
    def table_label(self) -> str:
        """Name of this filter in tables."""
        stem = Path(self.file).stem.replace(SEED, "").strip("_-. ")
        return f"{self.label or stem or 'trajectory'}(external)"

    @property
    def for_each_seed(self) -> bool:
        """True if each seed has a separate file."""
        return SEED in self.file

    @property
    def random(self) -> bool:
        """True if each seed is a separate run, although the recording is the same for all seeds."""
        return self.for_each_seed

    def of_seed(self, seed: int) -> "TrajectoryFile":
        """Return a copy of this filter that reads the file of the seed ``seed``."""
        return replace(self, file=str(path_of_seed(self.file, seed)))

    def fingerprint(self) -> str:
        """Return the SHA-256 digest of the contents of all files that ``file`` matches.

        Raises:
            RecordingError: no file matches ``file``.
        """
        return files_digest(self.file)

    def remarks(self, recording: Recording) -> tuple[str, ...]:
        """Return one note that states the file of the estimates, its digest and the interpolation."""
        source = f"{self.table_label}: external estimates from {self.file} (SHA-256 {self.fingerprint()[:12]})"
        return (f"{source}, not aligned, interpolated across gaps of at most {self.max_gap_s:g} s.",)

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the estimates of the file, interpolated at the time stamps of the reference.

        Raises:
            RecordingError: the file cannot be read, a gap in the trajectory is too long, or the clocks of the file and
                of the reference differ.
        """
        trajectory = read_trajectory(Path(self.file).expanduser(), self, recording)
        require_same_clock(trajectory, recording)
        return estimate_at_reference(trajectory, recording, self.max_gap_s)


MAX_CLOCK_SHIFT_S, CLOCK_STEP_S, MIN_CLOCK_SHIFT_S = 60.0, 0.25, 1.0
"""Largest shift that is tried, step of the first search, and smallest shift that is regarded as a different clock
[s]."""
MAX_ERROR_RATIO = 0.1
"""The clocks differ if the RMSE after the shift is at most this fraction of the RMSE without a shift."""
MAX_COMPARED = 2000
"""Maximum number of stamps at which the shifts are compared."""


def require_same_clock(trajectory: Trajectory, recording: Recording) -> None:
    """Require that no constant shift of time explains nearly all of the position error.

    A lag of some tenths of a second is an error of the filter. A shift of more than one second means that the file has
    a different clock, for example GPS time (18 s ahead) instead of UTC.

    Raises:
        RecordingError: a shift of more than one second reduces the position RMSE to a tenth or less.
    """
    from scipy.optimize import minimize_scalar

    reference, rows = recording.reference, slice(None, None, max(1, len(recording.reference.t_s) // MAX_COMPARED))
    if reference.enu_m is None:
        return
    t_s, truth_m = reference.t_s[rows], reference.enu_m[rows]

    def rmse_m(shift_s: float) -> float:
        """Return the position RMSE [m] for the assumption that the trajectory's stamps are ``shift_s`` too late."""
        at_s = t_s + shift_s
        inside = (at_s >= trajectory.t_s[0]) & (at_s <= trajectory.t_s[-1])
        if inside.sum() < max(2, len(t_s) // 4):
            return math.inf
        squares = [
            (np.interp(at_s[inside], trajectory.t_s, axis) - truth) ** 2
            for axis, truth in zip(trajectory.enu_m.T, truth_m[inside].T, strict=True)
        ]
        return math.sqrt(float(np.mean(np.sum(squares, axis=0))))

    as_given_m = rmse_m(0.0)
    shifts_s = np.arange(-MAX_CLOCK_SHIFT_S, MAX_CLOCK_SHIFT_S + CLOCK_STEP_S, CLOCK_STEP_S)
    nearest_s = float(shifts_s[int(np.argmin([rmse_m(shift_s) for shift_s in shifts_s]))])
    best = minimize_scalar(rmse_m, bounds=(nearest_s - CLOCK_STEP_S, nearest_s + CLOCK_STEP_S), method="bounded")
    if abs(best.x) < MIN_CLOCK_SHIFT_S or not best.fun <= MAX_ERROR_RATIO * as_given_m:
        return
    cause = "; GPS time is 18 s ahead of UTC" if abs(abs(best.x) - GPST_MINUS_UTC_S) < CLOCK_STEP_S else ""
    shifted = f"shifted by {-best.x:+.2f} s, the file agrees with the reference to {best.fun:.3g} m RMSE"
    raise RecordingError(
        f"{trajectory.where}: the clocks of the file and of the reference differ: {shifted}, and without a shift only"
        f" to {as_given_m:.3g} m{cause}. Correct the times in the file."
    )


STDERR_LINES = 5
"""Maximum number of lines of standard error in an error message."""

MAX_CHARACTERS = 600
"""Maximum number of characters of standard error in an error message."""


def split_command(command: str, values: Mapping[str, str]) -> list[str]:
    """Split ``command`` into arguments by the rules of a shell, and replace each ``{name}`` by its value in ``values``.

    The command is not passed to a shell, so variables and wildcards are not expanded.

    Raises:
        RecordingError: the command is empty, or a quotation mark is not closed.
    """
    try:
        arguments = shlex.split(command)
    except ValueError as error:
        raise RecordingError(f"The command {command} cannot be split into arguments: {error}.") from error
    if not arguments:
        raise RecordingError("The command is empty; give filter.command='./my_filter {recording} {out}'.")
    for name, value in values.items():
        arguments = [argument.replace(f"{{{name}}}", value) for argument in arguments]
    return arguments


def program_files(command: str) -> list[Path]:
    """Return the paths of the files in ``command``: the program, and each argument that is an existing file.

    Raises:
        RecordingError: the program was not found or is not executable.
    """
    program, *others = split_command(command, {})
    executable = shutil.which(os.path.expanduser(program))  # noqa: PTH111 - Path would drop a leading ./
    if executable is None:
        raise RecordingError(f"The program {program} was not found or is not executable; correct the command.")
    return [Path(executable), *(path for argument in others if (path := Path(argument)).is_file())]


def run_program(arguments: Sequence[str], folder: Path, limit_s: float) -> None:
    """Run a program, wait until it exits, and write its output to stdout.txt and stderr.txt in ``folder``.

    Raises:
        RecordingError: the program cannot be started, takes longer than ``limit_s``, or exits with a code other than 0.
    """
    stdout, stderr = folder / "stdout.txt", folder / "stderr.txt"
    with stdout.open("wb") as out, stderr.open("wb") as err, _sigterm_raises():
        code = _exit_code(arguments, (out, err), limit_s)
    if code is None:
        error = f"The program {arguments[0]} took longer than {limit_s:g} s (time_limit_s)."
        raise RecordingError(error + _last_errors(stderr))
    if code:
        raise RecordingError(f"The program {arguments[0]} {_exit_text(code)}.{_last_errors(stderr)}")


def _exit_code(arguments: Sequence[str], outputs: tuple[IO[bytes], IO[bytes]], limit_s: float) -> int | None:
    """Return the exit code of a program, or None if the program exceeds the time limit and is killed."""
    process = None
    try:
        with _deferred_signals():
            process = _start_process(arguments, outputs)
        return process.wait(limit_s)
    except subprocess.TimeoutExpired:
        return None
    finally:
        if process is not None and process.poll() is None:
            _kill(process)


def _start_process(arguments: Sequence[str], outputs: tuple[IO[bytes], IO[bytes]]) -> "subprocess.Popen[bytes]":
    out, err = outputs
    try:
        return subprocess.Popen(  # noqa: S603 - a program of the user, without a shell
            arguments, stdin=subprocess.DEVNULL, stdout=out, stderr=err, start_new_session=True
        )
    except OSError as error:
        raise RecordingError(f"The program {arguments[0]} cannot be started: {error.strerror or error}.") from error


@contextmanager
def _deferred_signals() -> Iterator[None]:
    """Defer SIGINT and SIGTERM during the start of a program, which `_exit_code` cannot kill before the start ends."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    numbers = [number for number in (signal.SIGINT, signal.SIGTERM) if callable(signal.getsignal(number))]
    handlers = {number: signal.signal(number, lambda number, _: held.append(number)) for number in numbers}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    if held:
        signal.raise_signal(held[0])


@contextmanager
def _sigterm_raises() -> Iterator[None]:
    """Raise SystemExit on SIGTERM, so that the program is also killed if a sweep terminates this process.

    Outside the main thread, this function does nothing, because Python sets signal handlers only in the main thread.
    The worker processes of a sweep run their tasks in the main thread.
    """
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _kill(process: "subprocess.Popen[bytes]") -> None:
    """Kill the process group of the program, which includes its child processes."""
    if hasattr(os, "killpg"):
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()


def _exit_text(code: int) -> str:
    if code > 0:
        return f"ended with exit code {code}"
    names = {int(value): value.name for value in signal.Signals}
    return f"was ended by {names.get(-code, f'signal {-code}')}"


def _last_errors(stderr: Path) -> str:
    with stderr.open("rb") as file:
        file.seek(max(0, stderr.stat().st_size - 4 * MAX_CHARACTERS))
        text = file.read().decode("utf-8", errors="replace")
    lines = [line.strip() for line in text.splitlines() if line.strip()][-STDERR_LINES:]
    return f" Standard error: {' | '.join(lines)[-MAX_CHARACTERS:]}" if lines else ""


# The filter `command`.

_SCRIPTS = (".py", ".jl", ".m", ".R", ".sh", ".js", ".rb", ".pl", ".lua")
"""File name extensions of scripts, which an interpreter runs."""


@register("filter", "command")
@dataclass(frozen=True, kw_only=True)
class Command(TrajectoryForm):
    """Runs a program of the user, in any language, that reads the recording and writes its estimates to a file.

    For each seed, the filter writes the disturbed recording to a temporary folder and runs the command without a shell.
    The filter then reads the trajectory that the program has written. The following command is an example::

        jerkbench run filter=command filter.command="./my_filter {recording} {out}"

    The command may contain these placeholders:

    The placeholder {recording} is the path of the recording in the first of the ``formats``. By default, the recording
    is the file recording.csv, with one row for each time stamp of any sensor. The file recording.json in the same
    folder describes the columns of recording.csv. The reference trajectory is never given to the program. The
    placeholder {folder} is the temporary folder, which contains the recording in all ``formats``. The placeholder {out}
    is the path of the file that the program has to write. The placeholder {seed} is replaced by the seed of the run.

    The output file has the same format as the file of the filter `trajectory`, and is interpolated in the same way. A
    run fails if the program fails, exceeds the time limit, or writes a file that cannot be scored. If the program fails
    or exceeds the time limit, the error message contains the last lines of standard error. The key of a stored result
    includes a digest of the program and of each argument that is an existing file.

    Attributes:
        command: command line of the program. Relative paths are relative to the folder in which jerkbench is started.
        label: name of the filter in tables, to which "(program)" is appended. If the label is empty, the name of the
            script or of the program is used.
        formats: formats in which the recording is written. Supported formats are csv, parquet, bag (ROS 1) and mcap
            (ROS 2).
        out: name of the output file in {folder}. The extension of this name determines the format of the file.
        time_limit_s: maximum run time of the program [s].
        seed: value of the placeholder {seed}, which each run sets to its seed.
    """

    provenance = Provenance("own", "", "A program of the user; see its own documentation.")

    adaptations: ClassVar[tuple[str, ...]] = ("none",)
    for_each_seed: ClassVar[bool] = True

    command: str
    label: str = ""
    formats: tuple[str, ...] = ("csv",)
    out: str = "out.csv"
    time_limit_s: float = 600.0
    seed: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive("filter command", self, ("time_limit_s",))
        if not self.formats:
            raise PluginError(f"filter command: formats is empty; give at least one of {', '.join(FORMATS)}.")
        for name in self.formats:
            require_known("format of a recording", name, FORMATS)

    @property
    def table_label(self) -> str:
        """Name of this filter in tables: the label, or without a label, the name of the script or of the program."""
        return f"{self.label or self._stem}(program)"

    @property
    def _stem(self) -> str:
        program, *others = program_files(self.command)
        return next((path for path in others if path.suffix in _SCRIPTS), program).stem

    @property
    def random(self) -> bool:
        """True if the program receives the seed, so that its runs on the same recording may differ."""
        return SEED in self.command

    def of_seed(self, seed: int) -> "Command":
        """Return a copy of this filter whose placeholder {seed} has the value ``seed``."""
        return replace(self, seed=seed)

    def fingerprint(self) -> str:
        """Return a SHA-256 digest of the program and of all existing files among the arguments of the command.

        Raises:
            RecordingError: the program was not found or is not executable.
        """
        sha = hashlib.sha256()
        for path in program_files(self.command):
            with path.open("rb") as file:
                sha.update(f"{path.name} {hashlib.file_digest(file, 'sha256').hexdigest()} ".encode())
        return sha.hexdigest()

    def remarks(self, recording: Recording) -> tuple[str, ...]:
        """Return one note that states the command and the digest of the files in the command."""
        return (f"{self.table_label}: the program {self.command} (SHA-256 {self.fingerprint()[:12]}).",)

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Run the program on the recording and return the estimate that the program has written.

        Raises:
            RecordingError: the program fails, or the output file cannot be scored.
        """
        with TemporaryDirectory(prefix="jerkbench_") as name:
            folder = Path(name)
            self._write(recording, attitude, folder)
            try:
                return self._run(recording, folder)
            except RecordingError as error:  # the message must not depend on the temporary folder
                raise RecordingError(str(error).replace(f"{folder}{os.sep}", "")) from error

    def _write(self, recording: Recording, attitude: Attitude, folder: Path) -> None:
        write_recording(recording, attitude, folder, self.formats, {"seed": self.seed})

    def _read(self, out: Path, recording: Recording) -> Estimate:
        return estimate_at_reference(read_trajectory(out, self, recording), recording, self.max_gap_s)

    def _run(self, recording: Recording, folder: Path) -> Estimate:
        out = folder / self.out
        values = {"recording": folder / FORMATS[self.formats[0]], "folder": folder, "out": out, "seed": self.seed}
        arguments = split_command(self.command, {name: str(value) for name, value in values.items()})
        run_program(arguments, folder, self.time_limit_s)
        if not out.is_file():
            raise RecordingError(f"The program {self.command} exited with code 0 but did not write {self.out}.")
        return self._read(out, recording)
