"""The command line. Each command imports only the libraries that it needs, so that commands start quickly."""

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

from jerkbench.cli import campaigns, plugins, recordings, results
from jerkbench.cli.arguments import group
from jerkbench.errors import INTERRUPTED, JerkbenchError, exit_with, let_interrupt_through, plain_output
from jerkbench.presets import take_folders

RUN_HELP = """\
jerkbench run [-m] [GROUP=NAME ...] [KEY=VALUE ...]

Runs one combination, or with -m all combinations of the values between commas.

  jerkbench run                                             the defaults: the baseline on simulated data
  jerkbench run filter=jerk adaptation=mtf seeds=20
  jerkbench run -m filter=baseline,jerk adaptation=none,mtf disturbance=none,gnss_outage
  jerkbench run -m noise.accel_mps2=0.1,0.2,0.5             a sweep of the process noise
  jerkbench run -m experiment=paper                         the complete comparison of the paper

GROUPs: dataset, disturbance, attitude, filter, adaptation, noise, engine, experiment. `jerkbench list` names the
plugins and presets, `jerkbench show KIND NAME` the parameters. Several disturbances are applied in the given order:
disturbance=[imu_bias,gnss_outage].

Set a parameter as GROUP.PARAMETER=VALUE. For disturbances use disturbance.NAME.PARAMETER=VALUE, because a run can have
several disturbances:

  jerkbench run adaptation=mtf adaptation.window=3
  jerkbench run disturbance=gnss_outage disturbance.gnss_outage.windows_s=[[50,60]]

r_scale.position=2 r_scale.velocity=0.5 scale the reported covariance R that the filter receives. The measurements do
not change.

Other KEYs: study, results, seeds, first_seed, burn_in_s, divergence_limit_m, metrics, workers, cluster, figures,
figures_pdf, report, notes. --dry prints the planned runs and the combinations that are left out,
and runs nothing. --config-dir DIR adds a folder with your presets (DIR/dataset/mine.yaml) to any command. The option
can be given several times. Results are in results/STUDY. A stored run is not computed again, so the same command
continues a sweep that was stopped.

A configuration can read an environment variable (${oc.env:NAME}) only if JERKBENCH_ENV=NAME,... lists the variable,
because the value of the variable appears in names and tables.

Exit codes: 0 all runs are complete (a diverged run is a result); 1 a run failed, or a result cannot be stored;
2 the input is invalid; 130 interrupted.

An error of a plugin is reported in one line. Set JERKBENCH_TRACEBACK=1 to see the traceback of a single run.

The command is a Hydra 1.3 application: --cfg job, --info and its other options work as Hydra documents them.
"""

SUITE = group(
    "suite",
    "compare your method with published ones on a fixed test set: run, verify, board",
    *(campaigns.suite_run_command, campaigns.suite_verify_command, campaigns.suite_board_command),
)

DATA = group(
    "data",
    "work with recordings: inspect, receiver, convert, export, fetch, trace, cache",
    *(recordings.inspect_command, recordings.receiver_command, recordings.convert_command),
    *(recordings.data_export_command, recordings.fetch_command, recordings.trace_command, recordings.cache_command),
)

COMMANDS = (
    *(plugins.list_command, plugins.show_command, DATA),
    *(results.table_command, results.figures_command, results.report_command, results.compare_command),
    *(campaigns.score_command, recordings.smooth_command, campaigns.tune_command, campaigns.audit_command, SUITE),
    *(results.rerun_command, results.export_command),
    *(plugins.new_command, plugins.check_command, results.cite_command),
)
"""The commands in the order in which `jerkbench --help` lists them."""


@cache
def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands.

    The parser of `run` is used only for help and shell completion, not for runs.
    """
    root = argparse.ArgumentParser(
        prog="jerkbench", description="Which navigation filter is better, by how much, on which recordings, and why?"
    )
    root.add_argument("--version", action="version", version=f"jerkbench {version('jerkbench')}")
    presets = "a folder with your presets (DIR/dataset/mine.yaml), for every command; can be given several times"
    root.add_argument("--config-dir", metavar="DIR", help=presets)
    commands = root.add_subparsers(dest="command", required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="run one combination, or with -m a sweep (jerkbench run --help)")
    for option in ("-m", "--dry", "--cfg"):
        run.add_argument(option)
    run.add_argument("overrides", nargs="*")
    for declare in COMMANDS:
        declare(commands)
    return root


REQUIRED_BYTES = 3 * 2**29
"""Address space that is needed to load all libraries [bytes]."""

SMALLER = "use fewer seeds or workers, shorter recordings, or a machine with more memory."


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command. If the input of the command is invalid, an error message is printed and the exit code is 2.

    Args:
        arguments: The arguments of the command line (by default, the arguments of this process).
    """
    if "_ARGCOMPLETE" in os.environ:
        from argcomplete import autocomplete

        autocomplete(parser(), default_completer=cast("Any", _overrides))
    given = list(sys.argv[1:] if arguments is None else arguments)
    if arguments is None:
        gc.set_threshold(50_000, 20, 100)  # importing libraries creates 200 000 objects that are never freed
        atexit.register(gc.freeze)
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # SIGTERM has the same effect as Ctrl-C
    sys.stdout = sys.stdout or os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")  # stdout is None if it is closed
    sys.stderr = sys.stderr or os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")
    with plain_output(), _error_messages():
        _require_installed()
        _require_date()
        given = take_folders(given)
        _require_memory()
        if given[:2] == ["help", "run"] or (given[:1] == ["run"] and {"-h", "--help"} & set(given)):
            print(RUN_HELP, end="")
        elif given[:1] == ["run"]:
            with _hydra_errors(given[1:]):
                from jerkbench.hydra_app.app import prepared_app

                prepared_app(given[1:])()
        else:
            with _file_errors("{path} cannot be read or written: {reason}; correct the path."):
                parsed = _parsed(given)
                parsed.function(parsed)


def _overrides(prefix: str, **_: object) -> list[str]:
    """Return the overrides that start with ``prefix`` (GROUP= or GROUP=NAME), for the shell completion."""
    from jerkbench.hydra_app.overrides import NAMED_GROUPS, names_in

    group, equals, _names = prefix.partition("=")
    overrides = [f"{group}={name}" for name in names_in(group)] if equals else [f"{group}=" for group in NAMED_GROUPS]
    return [override for override in overrides if override.startswith(prefix)]


@contextmanager
def _error_messages() -> Iterator[None]:
    """Convert exceptions to an error message in one line and an exit code, and print each warning in one line."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _one_line
            try:
                yield
            except Exception as error:
                let_interrupt_through(error)  # a library may have converted an interrupt to another exception
                raise
    except JerkbenchError as error:
        exit_with(error)
    except MemoryError as error:
        exit_with(JerkbenchError(f"There is not enough memory ({error or 'none is left'}); {SMALLER}"))
    except KeyboardInterrupt:
        print("jerkbench: interrupted.", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None
    except BrokenPipeError:  # the program that reads the output has ended, for example `head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:  # `_file_errors` has already converted errors of input and result files
        exit_with(JerkbenchError(f"The output cannot be written: {error.strerror or error}."))


def _require_installed() -> None:
    """Check that the package is installed, because its metadata are needed to find plugins and to store its version."""
    try:
        distribution("jerkbench")
    except PackageNotFoundError:
        tree = Path(__file__).parents[2]
        installing = f"{sys.executable} -m pip install -e {tree}"
        raise JerkbenchError(f"jerkbench runs from {tree} but is not installed. Run `{installing}`.") from None


def _require_date() -> None:
    """Check SOURCE_DATE_EPOCH before the runs start, because matplotlib would fail after the runs if it is invalid."""
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    if given and not given.isdecimal():
        raise JerkbenchError(
            f"SOURCE_DATE_EPOCH is '{given}'; give an integer number of seconds since 1970, or unset the variable."
        )


def _require_memory() -> None:
    """Check the memory limit of the process, because OpenBLAS hangs and LLVM aborts if the limit is too low."""
    try:
        from resource import RLIM_INFINITY, RLIMIT_AS, getrlimit
    except ImportError:  # Windows has no memory limit
        return
    limit = getrlimit(RLIMIT_AS)[0]
    if limit != RLIM_INFINITY and limit < REQUIRED_BYTES:
        needed = f"the libraries need {REQUIRED_BYTES // 2**20} MiB"
        raise JerkbenchError(f"The memory limit (ulimit -v) is {limit // 2**20} MiB, but {needed}; raise the limit.")


@contextmanager
def _hydra_errors(overrides: list[str]) -> Iterator[None]:
    """Convert exceptions of Hydra and OmegaConf to `JerkbenchError`."""
    os.environ["HYDRA_FULL_ERROR"] = "1"  # without this variable, Hydra prints the error and exits
    from hydra.errors import HydraException
    from omegaconf.errors import OmegaConfBaseException

    from jerkbench.hydra_app.overrides import hydra_message

    with _file_errors("Results cannot be written: {error}."):
        try:
            yield
        except (HydraException, OmegaConfBaseException) as error:  # some of these exceptions are also OSErrors
            sweeping = bool({"-m", "--multirun"} & set(overrides))
            raise JerkbenchError(hydra_message(error, sweeping=sweeping)) from error


@contextmanager
def _file_errors(message: str) -> Iterator[None]:
    """Convert exceptions about files and worker processes to `JerkbenchError`.

    Args:
        message: Format of the message about a file, with the fields ``path``, ``reason`` and ``error``.
    """
    try:
        yield
    except BrokenPipeError:
        raise
    except ChildProcessError as error:
        raise JerkbenchError(f"A worker process ended early: {error}. Start the command again.") from error
    except OSError as error:
        path, reason = error.filename or "A file", error.strerror or error
        raise JerkbenchError(message.format(path=path, reason=reason, error=error)) from error


def _parsed(given: list[str]) -> argparse.Namespace:
    """Parse the arguments of a command. If ``given`` is empty, print the help."""
    if given and "=" in given[0] and not given[0].startswith("-"):
        raise JerkbenchError(f"{given[0]} is not a command; to run this combination: jerkbench run {' '.join(given)}")
    parsed, rest = parser().parse_known_args(given if given[:1] not in ([], ["help"]) else [*given[1:], "--help"])
    if rest and (not hasattr(parsed, "overrides") or any(argument.startswith("-") for argument in rest)):
        parser().error(f"unrecognized arguments: {' '.join(rest)}")
    if rest:  # argparse separates KEY=VALUE arguments before and after an option
        parsed.overrides = [*parsed.overrides, *rest]
    return parsed


def _one_line(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    if not issubclass(category, RuntimeWarning):  # the status of a run already reports overflows
        print(f"jerkbench: {message}", file=sys.stderr)
