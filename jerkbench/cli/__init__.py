"""The command line: one verb after the other, each answering at once; heavy libraries load where they are used."""

import argparse
import atexit
import gc
import os
import signal
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import Any, cast

from jerkbench.cli import campaigns, inspecting, plugins, recordings, results, single_runs
from jerkbench.cli.arguments import group
from jerkbench.errors import INTERRUPTED, JerkbenchError, exit_with, let_interrupt_through
from jerkbench.notices import plain_output
from jerkbench.presets import take_folders
from jerkbench.renamed import refuse_removed

RUN_HELP = """\
jerkbench run [-m] [GROUP=NAME ...] [KEY=VALUE ...]

Runs one combination, or with -m all combinations of the values between commas.

  jerkbench run                                             the defaults: the baseline on the simulated field
  jerkbench run filter=jerk adaptation=mtf seeds=20
  jerkbench run -m filter=baseline,jerk adaptation=none,mtf disturbance=none,gnss_outage
  jerkbench run -m noise.accel_mps2=0.1,0.2,0.5             a sweep of the process noise
  jerkbench run -m experiment=paper                         the paper's whole comparison

GROUPs: dataset, disturbance, attitude, filter, adaptation, noise, engine, experiment. `jerkbench list` names the
plugins and presets, `jerkbench show KIND NAME` the parameters. Several disturbances act in order:
disturbance=[imu_bias,gnss_outage].

Set a parameter as GROUP.PARAMETER=VALUE. For disturbances use disturbance.NAME.PARAMETER=VALUE, because a run can have
several:

  jerkbench run adaptation=mtf adaptation.window=3
  jerkbench run disturbance=gnss_outage disturbance.gnss_outage.windows_s=[[50,60]]

r_scale.position=2 r_scale.velocity=0.5 scale the reported R that the filter gets; the data stay as they are.

Other KEYs: study, results, seeds, first_seed, burn_in_s, divergence_limit_m, metrics, workers, cluster, figures,
figures_pdf, report, notes. --dry prints what would run, what is left out and how long it takes, and runs nothing.
--config-dir DIR, with any verb, adds a folder with presets of your own (DIR/dataset/mine.yaml); several may be given.
Results are in results/STUDY. A combination that is done is not run again. If you stop a sweep, the same command
continues it.

A configuration reads an environment variable (${oc.env:NAME}) only if JERKBENCH_ENV=NAME,... names it, because its
value appears in names and tables.

Exit codes: 0 all runs are done (a run that diverged is a result); 1 a run failed, or something cannot be stored;
2 the input is wrong; 130 interrupted.

An error of a plugin is one sentence. JERKBENCH_TRACEBACK=1 in the environment shows the traceback of a single run.

It is a Hydra 1.3 app: --cfg job, --info, hydra/launcher=... and the rest work as Hydra documents them.
"""

SUITE = group(
    "suite",
    "compare your method with published ones on a fixed test set: run, verify, board",
    *(campaigns.suite_run_verb, campaigns.suite_verify_verb, campaigns.suite_board_verb),
)

DATA = group(
    "data",
    "work with recordings: inspect, receiver, convert, export, fetch, trace, cache",
    *(
        inspecting.inspect_verb,
        inspecting.receiver_verb,
        recordings.convert_verb,
        recordings.data_export_verb,
    ),
    *(recordings.fetch_verb, recordings.trace_verb, recordings.cache_verb),
)

VERBS = (
    *(plugins.list_verb, plugins.show_verb, DATA),
    *(results.table_verb, results.figures_verb, results.report_verb, results.compare_verb, single_runs.score_verb),
    *(inspecting.smooth_verb, campaigns.tune_verb, campaigns.audit_verb, SUITE),
    *(single_runs.rerun_verb, single_runs.export_verb),
    *(plugins.new_verb, plugins.check_verb, results.cite_verb),
)
"""In the order in which `jerkbench --help` names them."""


@cache
def parser() -> argparse.ArgumentParser:
    """Return the parser of every command; of `run`, which Hydra parses, it has what a shell completes."""
    whole = argparse.ArgumentParser(
        prog="jerkbench", description="Which navigation filter is better, by how much, on which recordings, and why?"
    )
    whole.add_argument("--version", action="version", version=f"jerkbench {version('jerkbench')}")
    presets = "a folder with presets of your own (DIR/dataset/mine.yaml), for every verb; it may be given several times"
    whole.add_argument("--config-dir", metavar="DIR", help=presets)
    verbs = whole.add_subparsers(dest="verb", required=True, metavar="VERB")
    run = verbs.add_parser("run", help="run one combination, or with -m a sweep (jerkbench run --help)")
    for option in ("-m", "--dry", "--cfg"):
        run.add_argument(option)
    run.add_argument("words", nargs="*")
    for declare in VERBS:
        declare(verbs)
    return whole


ROOM_BYTES = 3 * 2**29
"""Address space in which all libraries load."""

SMALLER = "take fewer seeds or workers, shorter data, or a larger machine."


def main(arguments: Sequence[str] | None = None) -> None:
    """Run ``arguments`` (default: the process's own); exits with 2 and a sentence where the input is at fault."""
    if "_ARGCOMPLETE" in os.environ:
        from argcomplete import autocomplete

        autocomplete(parser(), default_completer=cast("Any", _overrides))
    words = list(sys.argv[1:] if arguments is None else arguments)
    if arguments is None:
        gc.set_threshold(50_000, 20, 100)  # imported libraries leave 200 000 objects that are never garbage
        atexit.register(gc.freeze)
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C
    sys.stdout = sys.stdout or os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")  # what the caller has closed
    sys.stderr = sys.stderr or os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")
    with plain_output(), _errors_in_words(), _interrupt_first():
        _require_installed()
        _require_date()
        refuse_removed(words)
        words = take_folders(words)
        _require_room()
        if words[:2] == ["help", "run"] or (words[:1] == ["run"] and {"-h", "--help"} & set(words)):
            print(RUN_HELP, end="")
        elif words[:1] == ["run"]:
            with _hydra_in_words(words[1:]):
                from jerkbench.hydra_app.app import prepared_app

                prepared_app(words[1:])()
        else:
            with _files_in_words("{path} cannot be read or written: {reason}; correct the path."):
                chosen = _chosen(words)
                chosen.answer(chosen)


def _overrides(prefix: str, **_: object) -> list[str]:
    """Return the overrides that begin with ``prefix``, for the completion of a shell: GROUP= and GROUP=NAME."""
    from jerkbench.hydra_app.overrides import NAMED_GROUPS, names_in

    group, equals, _names = prefix.partition("=")
    words = [f"{group}={name}" for name in names_in(group)] if equals else [f"{group}=" for group in NAMED_GROUPS]
    return [word for word in words if word.startswith(prefix)]


@contextmanager
def _errors_in_words() -> Iterator[None]:
    """Turn what ends a command into a sentence and an exit code, and warnings into a line each."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _one_line
            yield
    except JerkbenchError as error:
        exit_with(error)
    except MemoryError as error:
        exit_with(JerkbenchError(f"There is not enough memory ({error or 'none is left'}); {SMALLER}"))
    except KeyboardInterrupt:
        print("jerkbench: interrupted.", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None
    except BrokenPipeError:  # the reader, `head` for example, has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:  # of standard output; those of files have their own sentences
        exit_with(JerkbenchError(f"What it says cannot be written: {error.strerror or error}."))


@contextmanager
def _interrupt_first() -> Iterator[None]:
    """Let an interrupt through as one, whatever a library made of it."""
    try:
        yield
    except Exception as error:
        let_interrupt_through(error)
        raise


def _require_installed() -> None:
    """Refuse to run from a folder alone.

    Raises:
        JerkbenchError: this Python has no such distribution, by which Hydra finds our parts and a result its version.
    """
    try:
        distribution("jerkbench")
    except PackageNotFoundError:
        tree = Path(__file__).parents[2]
        raise JerkbenchError(
            f"It runs from {tree}, but is not installed for this Python; do so once: {sys.executable} -m pip install -e"
            f" {tree}"
        ) from None


def _require_date() -> None:
    """Refuse a date of files that is none, on which matplotlib fails after everything has run.

    Raises:
        JerkbenchError: SOURCE_DATE_EPOCH is no number.
    """
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    if given and not given.isdecimal():
        raise JerkbenchError(f"SOURCE_DATE_EPOCH is '{given}'; give whole seconds since 1970, or unset it.")


def _require_room() -> None:
    """Refuse a limit on memory in which libraries do not load: OpenBLAS waits for ever in it, and LLVM aborts.

    Raises:
        JerkbenchError: the limit is below `ROOM_BYTES`.
    """
    try:
        from resource import RLIM_INFINITY, RLIMIT_AS, getrlimit
    except ImportError:  # Windows has no such limit
        return
    limit = getrlimit(RLIMIT_AS)[0]
    if limit != RLIM_INFINITY and limit < ROOM_BYTES:
        raise JerkbenchError(
            f"A process may have {limit // 2**20} MiB of memory here (ulimit -v); the libraries need"
            f" {ROOM_BYTES // 2**20} MiB: raise the limit."
        )


@contextmanager
def _hydra_in_words(words: list[str]) -> Iterator[None]:
    """Turn what Hydra has to say about the configuration into one sentence."""
    os.environ["HYDRA_FULL_ERROR"] = "1"  # let errors through, instead of printing them and exiting
    from hydra.errors import HydraException
    from omegaconf.errors import OmegaConfBaseException

    from jerkbench.hydra_app.overrides import hydra_sentence

    with _files_in_words("Results cannot be written: {error}."):
        try:
            yield
        except (HydraException, OmegaConfBaseException) as error:  # some are an OSError, too
            sweeping = bool({"-m", "--multirun"} & set(words))
            raise JerkbenchError(hydra_sentence(error, sweeping=sweeping)) from error


@contextmanager
def _files_in_words(sentence: str) -> Iterator[None]:
    """Turn what is wrong with a file, or a worker, into a sentence about ``path``, ``reason`` or ``error``."""
    try:
        yield
    except BrokenPipeError:
        raise
    except ChildProcessError as error:
        raise JerkbenchError(f"A worker ended before its work was done: {error}. Start the command again.") from error
    except OSError as error:
        path, reason = error.filename or "A file", error.strerror or error
        raise JerkbenchError(sentence.format(path=path, reason=reason, error=error)) from error


def _chosen(words: list[str]) -> argparse.Namespace:
    """Read the words of a verb; help where there are none."""
    chosen, behind = parser().parse_known_args(words if words[:1] not in ([], ["help"]) else [*words[1:], "--help"])
    if behind and (not hasattr(chosen, "words") or any(word.startswith("-") for word in behind)):
        parser().error(f"unrecognized arguments: {' '.join(behind)}")
    if behind:  # KEY=VALUE behind an option, which argparse does not put to those before it
        chosen.words = [*chosen.words, *behind]
    return chosen


def _one_line(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    if not issubclass(category, RuntimeWarning):  # NumPy's, about a number; a result that is not finite has a status
        print(f"jerkbench: {message}", file=sys.stderr)
