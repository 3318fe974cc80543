"""The commands that tune methods: `tune`, `audit`, and the subcommands of `suite`."""

import argparse
import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jerkbench.cli.arguments import EXECUTION, RUN_PROGRAMS, argument, command, count, flag


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
    from jerkbench.errors import PluginError
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
