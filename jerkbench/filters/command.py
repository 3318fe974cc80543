"""A program of the user's: run once, with a time limit, its failures as sentences."""

import hashlib
import os
import shlex
import shutil
import signal
import subprocess
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from dataclasses import replace as replaced
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, ClassVar, NoReturn

from jerkbench.arrays import require_positive
from jerkbench.contracts import Adaptation
from jerkbench.errors import PluginError, RecordingError, require_known
from jerkbench.estimate import Attitude, Estimate
from jerkbench.io.recording_folder import FORMATS, write_recording
from jerkbench.io.trajectory import TrajectoryForm, estimate_at_reference, read_trajectory
from jerkbench.parameters import Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording

LAST_LINES = 5
"""Lines of standard error that a sentence ends with."""

MAX_CHARACTERS = 600
"""Letters of them."""


def command_words(command: str, values: Mapping[str, str]) -> list[str]:
    """Return the words of ``command`` as a shell would split them, with ``{name}`` replaced; no shell sees them.

    Raises:
        RecordingError: there is no word, or a quotation mark is not closed.
    """
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise RecordingError(f"The command {command} cannot be split into words: {error}.") from error
    if not words:
        raise RecordingError("The command is empty; give filter.command='./my_filter {recording} {out}'.")
    return [_replaced(word, values) for word in words]


def program_files(command: str) -> list[Path]:
    """Return the files that the command names: the program, and scripts or settings among its words.

    Raises:
        RecordingError: there is no such program, or it may not be run.
    """
    program, *others = command_words(command, {})
    place = shutil.which(os.path.expanduser(program))  # noqa: PTH111 - a name without a folder stays one
    if place is None:
        raise RecordingError(f"There is no program {program} that can be run; correct the command, or build it first.")
    return [Path(place), *(path for word in others if (path := Path(word)).is_file())]


def run_program(words: Sequence[str], folder: Path, limit_s: float) -> None:
    """Run the words to their end; what they print goes to files in ``folder``.

    Raises:
        RecordingError: it cannot be started, takes longer than ``limit_s``, or ends with another code than 0.
    """
    stdout, stderr = folder / "stdout.txt", folder / "stderr.txt"
    with stdout.open("wb") as out, stderr.open("wb") as err, _terminable():
        code = _exit_code(words, (out, err), limit_s)
    if code is None:
        raise RecordingError(f"The program {words[0]} took longer than {limit_s:g} s (time_limit_s).{_said(stderr)}")
    if code:
        raise RecordingError(f"The program {words[0]} {_ended(code)}.{_said(stderr)}")


def _exit_code(words: Sequence[str], outputs: tuple[IO[bytes], IO[bytes]], limit_s: float) -> int | None:
    """The exit code; None where the limit was reached. Whatever happens, nothing that it started goes on."""
    process = None
    try:
        with _undisturbed():
            process = _started(words, outputs)
        return process.wait(limit_s)
    except subprocess.TimeoutExpired:
        return None
    finally:
        if process is not None and process.poll() is None:
            _kill(process)


def _started(words: Sequence[str], outputs: tuple[IO[bytes], IO[bytes]]) -> "subprocess.Popen[bytes]":
    out, err = outputs
    try:
        return subprocess.Popen(  # noqa: S603 - the user's own program, without a shell
            words, stdin=subprocess.DEVNULL, stdout=out, stderr=err, start_new_session=True
        )
    except OSError as error:
        raise RecordingError(f"The program {words[0]} cannot be started: {error.strerror or error}.") from error


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Keep signals that end this process back until it knows what it has started: nobody else could end that."""
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
def _terminable() -> Iterator[None]:
    """Let SIGTERM, with which a sweep ends its processes, end this one as an exception does, where it else just would.

    Only the main thread can ask for that, as which the processes of a sweep run their tasks.
    """
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, _leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _leave(number: int, _: object) -> NoReturn:
    raise SystemExit(128 + number)


def _kill(process: "subprocess.Popen[bytes]") -> None:
    """End the program and what it has started: it is the first of a group of its own."""
    if hasattr(os, "killpg"):
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()


def _ended(code: int) -> str:
    if code > 0:
        return f"ended with exit code {code}"
    names = {int(value): value.name for value in signal.Signals}
    return f"was ended by {names.get(-code, f'signal {-code}')}"


def _said(stderr: Path) -> str:
    """The last lines that the program wrote to standard error, as the end of a sentence."""
    with stderr.open("rb") as file:
        file.seek(max(0, stderr.stat().st_size - 4 * MAX_CHARACTERS))
        text = file.read().decode("utf-8", errors="replace")
    lines = [line.strip() for line in text.splitlines() if line.strip()][-LAST_LINES:]
    return f" It said: {' | '.join(lines)[-MAX_CHARACTERS:]}" if lines else ""


def _replaced(word: str, values: Mapping[str, str]) -> str:
    for name, value in values.items():
        word = word.replace(f"{{{name}}}", value)
    return word


# Anybody's program as a method: it reads a recording and writes a trajectory.

_SCRIPTS = (".py", ".jl", ".m", ".R", ".sh", ".js", ".rb", ".pl", ".lua")
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

    provenance = Provenance("own", "", "A program of the user's; what it is, its author knows.")

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
            require_known("format of a recording", name, FORMATS)

    @property
    def table_label(self) -> str:
        """What tables call it: the label, or the script that an interpreter runs, or the program."""
        return f"{self.label or self._stem}(program)"

    @property
    def _stem(self) -> str:
        program, *others = program_files(self.command)
        return next((path for path in others if path.suffix in _SCRIPTS), program).stem

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
            self._write(recording, attitude, folder)
            try:
                return self._run(recording, folder)
            except RecordingError as error:  # the folder has another name each time
                raise RecordingError(str(error).replace(f"{folder}{os.sep}", "")) from error

    def _write(self, recording: Recording, attitude: Attitude, folder: Path) -> None:
        write_recording(recording, attitude, folder, self.formats, {"seed": self.seed})

    def _read(self, out: Path, recording: Recording) -> Estimate:
        return estimate_at_reference(read_trajectory(out, self, recording), recording, self.max_gap_s)

    def _run(self, recording: Recording, folder: Path) -> Estimate:
        out = folder / self.out
        run_program(self._words(folder, out), folder, self.time_limit_s)
        if not out.is_file():
            raise RecordingError(f"The program {self.command} ended well and wrote no {self.out}.")
        return self._read(out, recording)

    def _words(self, folder: Path, out: Path) -> list[str]:
        recording = folder / FORMATS[self.formats[0]]
        values = {"recording": recording, "folder": folder, "out": out, "seed": self.seed}
        return command_words(self.command, {name: str(value) for name, value in values.items()})
