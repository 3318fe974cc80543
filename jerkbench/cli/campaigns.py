"""The commands that evaluate methods: `score`, `tune`, `audit`, and the subcommands of `suite`."""

import argparse
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from jerkbench.cli.arguments import EXECUTION, RUN_PROGRAMS, argument, command, count, flag
from jerkbench.errors import JerkbenchError, PluginError, RecordingError

OVERRIDE = re.compile(r"[+~]*[A-Za-z_][\w./@]*=")

NAME_KEY = "name="


@command(
    argument("overrides", nargs="+", metavar="FILE | KEY=VALUE", help="trajectories, one for each seed or with {seed}"),
    argument("--reference", type=Path, metavar="FILE", help="reference trajectory (.tum, .pos, a table)"),
)
def score_command(arguments: argparse.Namespace) -> None:
    """Score trajectories of other programs, and add them to a study as rows.

    KEY=VALUE are arguments of `jerkbench run`, which define the recording (dataset, disturbance, their parameters,
    first_seed), the scoring (burn_in_s, metrics), and the study of the rows (study, results). name=NAME is the name of
    the method in tables. filter.KEY=VALUE defines the columns of the file (`jerkbench show filter trajectory`).

      jerkbench score mine.tum dataset=field disturbance=gnss_outage name=mine study=external
      jerkbench score 'run_{seed}.csv' dataset=field name=mine study=external filter.frame=ned
      jerkbench score mine.tum --reference truth.tum       both have the same clock and axes; nothing is aligned

    Raises:
        JerkbenchError: No file is given, a file does not exist, or the arguments do not define a recording.
    """
    from jerkbench.hydra_app.app import score_files
    from jerkbench.hydra_app.composition import composed
    from jerkbench.io.trajectory import SEED, pattern_of, seeds_of

    files = [given for given in arguments.overrides if not OVERRIDE.match(given)]
    overrides = [given for given in arguments.overrides if OVERRIDE.match(given)]
    if not files:
        raise JerkbenchError("No trajectory is given; give a file, or a pattern with {seed} such as 'run_{seed}.csv'.")
    pattern = pattern_of(files)
    typed = [override.partition("=")[2] for override in overrides if override.startswith("first_seed=")]
    first = int(typed[-1]) if typed and typed[-1].isdecimal() else 0
    seeds = list(seeds_of(pattern)) if SEED in pattern else [first]
    if not seeds:
        raise JerkbenchError(f"No file matches {pattern}; correct the pattern.")
    label = next((override.removeprefix(NAME_KEY) for override in overrides if override.startswith(NAME_KEY)), "")
    others = [override for override in overrides if not override.startswith(NAME_KEY)]
    others = ["filter=trajectory", *_seed_overrides(seeds, overrides), *others]
    if arguments.reference is None:
        score_files(composed(others), pattern, label)
        return
    name = str(arguments.reference.name).replace("'", "\\'")
    dataset = ["dataset=table", f"dataset.reference_file='{name}'"]  # the label in tables contains the name of the file
    clock = ["filter.clock=unix"] if {arguments.reference.suffix, Path(files[0]).suffix} == {".tum"} else []
    settings = _reference_settings(arguments.reference.expanduser(), overrides)
    score_files(composed([*dataset, *clock, *others]), pattern, label, settings)


def _reference_settings(path: Path, overrides: list[str]) -> dict[str, Any]:
    """Return the parameters of `dataset=table` for a recording that consists only of a reference trajectory.

    Parameters that the user has set with overrides are left out.

    Raises:
        RecordingError: The file does not exist, or its columns with time and position cannot be recognised.
    """
    from jerkbench.datasets.table import Tables
    from jerkbench.inspection.guessing import guess_tables
    from jerkbench.io.trajectory import TUM

    if not path.is_file():
        raise RecordingError(f"The reference {path} does not exist; correct the path.")
    settings: dict[str, Any] = {"folder": str(path.resolve().parent), "position_file": path.name}
    if path.suffix == ".tum":
        settings |= TUM | {"position_time": TUM["time"], "position_columns": TUM["position"], "position_frame": "enu"}
    elif path.suffix != ".pos":
        settings |= guess_tables(path).settings
    names = ("file", "time", "time_unit", "frame")
    settings |= {f"reference_{name}": settings[key] for name in names if (key := f"position_{name}") in settings}
    settings |= {"reference_position": settings.get("position_columns", ()), "drop_leaps": False, "imu_file": ""}
    typed = {override.partition("=")[0].removeprefix("dataset.") for override in overrides}
    settings |= {"velocity_file": "", "reference_source": f"{path.name} (see dataset.reference_independent)"}
    return {f.name: settings[f.name] for f in fields(Tables) if f.name in settings and f.name not in typed}


def _seed_overrides(seeds: list[int], overrides: list[str]) -> list[str]:
    """Return the overrides ``first_seed`` and ``seeds`` for the seeds of the trajectory files.

    Raises:
        PluginError: The file of a seed between the first and the last seed is missing.
    """
    missing = sorted(set(range(seeds[0], seeds[-1] + 1)) - set(seeds))
    if missing and not any(override.startswith("seeds=") for override in overrides):
        lacking = f"{', '.join(map(str, missing))} (of {seeds[0]} to {seeds[-1]})"
        raise PluginError(f"The files of the seeds {lacking} are missing; add these, or give first_seed=... seeds=...")
    return [f"first_seed={seeds[0]}", f"seeds={len(seeds)}"]


@command(
    flag("-m", "--multirun", help="tune several methods with the same budget"),
    flag("--compare", help="run the methods before and after tuning on unused data, and print their table"),
    argument("overrides", nargs="*", metavar="KEY=VALUE", help="the method, the scenarios and the budget"),
)
def tune_command(arguments: argparse.Namespace) -> None:
    """Find the best setting of a method, and test it on runs that the search has not used.

    KEY=VALUE are arguments of `jerkbench run`. Several values of dataset, disturbance and attitude, separated by
    commas, are the scenarios of one tuning. With -m, each combination of several filters and adaptations is a method,
    and all methods are tuned with the same budget.

      jerkbench tune filter=jerk adaptation=mtf disturbance=none,noise_step trials=64
      jerkbench tune -m filter=baseline,jerk adaptation=none,mtf,chi2 disturbance=none,outliers study=mtf_chi2
      jerkbench tune -m filter=baseline,jerk adaptation=none,mtf disturbance=outliers --compare   with a table
      jerkbench tune filter=bias dataset=rosbag dataset.file=drive.bag objective=likelihood   a log without a reference
      jerkbench tune -m filter=attitude_only attitude=mahony,mekf dataset=field               attitude filters

    The search changes every parameter with a range (`jerkbench show filter jerk`), and the factors on the reported R
    (r_scale.position, r_scale.velocity). knobs=[filter.accel_mps2,...] selects some of these parameters.

      trials=64            number of settings, including the default setting
      sampler=sobol        sobol (for comparisons), tpe, cma_es (the extra `tune`); sampler_seed=1: other settings
      objective=rmse       rmse: log of the RMSE relative to the plain filter of the same model, a diverged run counts
                           as log 100; likelihood: of the innovations, needs no reference; inclination: error of an
                           attitude filter
      split=auto           seeds; time (share=0.5: tuned on the first half, tested on the second half);
                           recordings, families (held_out=[NAME,...]: used only for the test)
      tune_seeds=16 choose_seeds=16 test_seeds=40 first_seed=0      disjoint; the test seeds are used at the end
      finalists=8          number of the best settings that are evaluated again on the validation seeds (choose_seeds)
      cluster=local        threads of this process; dask, slurm, ...: one worker for each scenario (docs/cluster.md)

    The folder results/STUDY/tune/METHOD has tuning.md, presets for `jerkbench run --config-dir`, settings for
    robot_localization, and every trial. The same command continues a search that was stopped.

    Raises:
        JerkbenchError: An argument is unknown, or the method has nothing to tune.
    """
    from jerkbench.hydra_app.tuning import tune_all

    tune_all(arguments.overrides, several=arguments.multirun, compare=arguments.compare)


@command(
    argument("--scale", default="full", help="name of the protocol (default: full)"),
    argument("--results", type=Path, default=Path("results"), help="folder of all results"),
    flag("--stored", help="evaluate the stored rows of any version, and run nothing"),
    *EXECUTION,
)
def audit_command(arguments: argparse.Namespace) -> None:
    """Tune all adaptive filters and the plain filter with the same budget, and compare them on unseen drives.

    SCALE is a protocol in conf/audit, which defines the methods, the random drives and the budget. The protocol and its
    hash are written before the first run. The hash determines every drive and every setting.

      jerkbench audit --scale small      some minutes; tests the program, too small for conclusions
      jerkbench audit --scale medium     two models, no iterated filters: 1 minute, 5 minutes with compilation
      jerkbench audit                    the complete protocol: 40 minutes on two cores; see --cluster and --workers
      jerkbench audit --scale second     the same protocol with other drives and other tunings

    The same command continues an audit that was stopped. --stored evaluates the stored rows of any version, and runs
    nothing.

    RESULTS/audit-SCALE has answer.json with the conclusion, methods.csv, kinds.csv and apart.csv with the numbers, the
    rows from which the numbers are computed (judged.parquet, tuned.parquet, drives.parquet, settings.parquet),
    manifest.json with hashes, and protocol.json. experiments/audit/audit_page.py makes a page with figures from these
    files.

    Raises:
        JerkbenchError: The protocol does not exist, or a run failed.
    """
    from jerkbench.campaign.answer import AUDIT_FOLDER, judged_audit
    from jerkbench.campaign.audit import run_audit
    from jerkbench.campaign.protocol import read_protocol
    from jerkbench.hydra_app.configuration import cluster_named
    from jerkbench.jobs.executors import processors

    workers = arguments.workers or processors()
    protocol, folder = read_protocol(arguments.scale), arguments.results / f"{AUDIT_FOLDER}{arguments.scale}"
    if not arguments.stored:
        run_audit(protocol, folder, cluster_named(arguments.cluster), workers)
    print("\n".join(judged_audit(folder).sentences))
    print(f"Written to {folder}.")


SUBMITTED_GROUPS = ("filter", "adaptation", "noise", "r_scale")
"""Groups whose options define a method. The suite defines all other options."""

DEFAULT_SUITE = "v2"


@command(
    argument("overrides", nargs="+", metavar="KEY=VALUE", help="the method"),
    argument("--scale", default=DEFAULT_SUITE, help=f"name of the suite in conf/suite (default: {DEFAULT_SUITE})"),
    argument("--name", default="", help="name of the method on the board (default: filter + adaptation)"),
    argument("--out", type=Path, metavar="FOLDER", help="folder of the entry (default: results/suite-SCALE/NAME)"),
    *EXECUTION,
)
def suite_run_command(arguments: argparse.Namespace) -> None:
    """Tune and score a method by the protocol of the suite, and write its entry.

    KEY=VALUE are arguments of `jerkbench run` that define a method: filter, adaptation, noise, r_scale and their
    parameters.

      jerkbench suite run filter=jerk adaptation=mtf
      jerkbench suite run filter=baseline adaptation=my_rule --scale v2-tiny    takes seconds, tests the method
      jerkbench suite run filter=command filter.command="./mine {recording} {out}" --name mine

    A method whose parameters have ranges is tuned on 60 random drives and scored on 240 other drives. A method without
    ranges, or an external program, is scored without tuning. The plain filter is tuned in the same way. The same
    command continues a run that was stopped. The entry has entry.md, rows.parquet, settings.yaml and manifest.json
    (docs/suite.md).

    Raises:
        JerkbenchError: An argument is unknown, the method is not compatible, or the files of the suite were changed.
    """
    from jerkbench.campaign.entry import enter
    from jerkbench.campaign.runs import CampaignRuns, MethodSpec
    from jerkbench.hydra_app.configuration import cluster_named
    from jerkbench.jobs.executors import Workers, processors

    spec = _spec(arguments.overrides)
    method = MethodSpec(**{kind: dict(spec[kind]) for kind in ("filter", "adaptation", "r_scale")})
    name = arguments.name or method.name
    stem = re.sub(r"[^\w.]+", "-", name).strip("-.") or "entry"
    folder = arguments.out or Path("results") / f"suite-{arguments.scale}" / stem
    scale = [] if arguments.scale == DEFAULT_SUITE else ["--scale", arguments.scale]
    typed = shlex.join(["jerkbench", "suite", "run", *arguments.overrides, *scale])
    with Workers(cluster_named(arguments.cluster), arguments.workers or processors()) as workers:
        print(enter(arguments.scale, method, name, CampaignRuns(folder, workers), typed))
    print(f"Written to {folder}. For the leaderboard: jerkbench suite board {shlex.quote(str(folder.parent))}")


def _spec(overrides: Sequence[str]) -> Mapping[str, Any]:
    from jerkbench.hydra_app.composition import composed
    from jerkbench.hydra_app.overrides import owner

    for override in overrides:
        if owner(override) not in SUBMITTED_GROUPS:
            allowed = f"{', '.join(SUBMITTED_GROUPS)} and their parameters, for example adaptation.window=3"
            raise PluginError(f"The suite does not accept '{override}'; give only options of a method: {allowed}.")
    return composed(overrides).job().spec


@command(
    argument("entry", type=Path, help="folder of the entry"),
    RUN_PROGRAMS,
    argument("--rows", type=count, default=12, help="number of rows to compute again (default: 12)"),
)
def suite_verify_command(arguments: argparse.Namespace) -> None:
    """Check the digests, the completeness, the score and a sample of rows of an entry.

      jerkbench suite verify results/suite-v2-tiny/jerk-none
      jerkbench suite verify results/suite-v2-tiny/jerk-none --rows 2

    Raises:
        JerkbenchError: The folder has no entry.
    """
    from jerkbench.campaign.board import verify
    from jerkbench.campaign.entry import read_entry

    checked = verify(read_entry(arguments.entry), arguments.rows, run_programs=arguments.run_programs)
    for message in (*checked.mistakes, *checked.remarks):
        print(message)
    if checked.mistakes:
        raise SystemExit(1)
    print(f"{arguments.entry}: no differences found. {checked.rerun} rows of the entry were computed again.")


@command(
    argument("folder", type=Path, help="folder that contains the folders of the entries"),
    argument("--rows", type=count, default=3, help="number of rows of each entry to compute again (default: 3)"),
)
def suite_board_command(arguments: argparse.Namespace) -> None:
    """Verify all entries of a folder, and write a sortable page that ranks the entries.

      jerkbench suite board results/suite-v2-tiny
      jerkbench suite board results/suite-v2-tiny --rows 1

    Raises:
        JerkbenchError: The folder has no entries, or entries of several suites.
    """
    from jerkbench.campaign.board import write_board

    print(write_board(arguments.folder, arguments.rows))
