"""A program of the user's: run once, with a time limit, its failures as sentences."""

import os
import shlex
import shutil
import signal
import subprocess
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, NoReturn

from jerkbench.errors import RecordingError

LAST_LINES = 5
"""Lines of standard error that a sentence ends with."""

LONGEST = 600
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
        file.seek(max(0, stderr.stat().st_size - 4 * LONGEST))
        text = file.read().decode("utf-8", errors="replace")
    lines = [line.strip() for line in text.splitlines() if line.strip()][-LAST_LINES:]
    return f" It said: {' | '.join(lines)[-LONGEST:]}" if lines else ""


def _replaced(word: str, values: Mapping[str, str]) -> str:
    for name, value in values.items():
        word = word.replace(f"{{{name}}}", value)
    return word
