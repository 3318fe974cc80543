"""The verbs that tune before they score: `tune`, `audit`, and the group `suite`."""

import argparse
import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jerkbench.cli.arguments import RUN_PROGRAMS, WHERE, argument, count, output, verb


@verb(
    argument("-m", "--multirun", action="store_true", help="tune each of several methods, with equal budgets"),
    argument(
        "--compare", action="store_true", help="then run the tuned methods on unused seeds, and print their table"
    ),
    argument("words", nargs="*", metavar="KEY=VALUE", help="what to tune, on what, with which budget"),
)
def tune_verb(chosen: argparse.Namespace) -> None:
    """Find the best setting of a method, and score it on runs that the search has not seen.

    KEY=VALUE are those of `jerkbench run`. Several values of dataset, disturbance and attitude, separated by commas,
    are the scenarios of one tuning. Several values of filter and adaptation are methods, all tuned with the same budget
    (-m).

      jerkbench tune filter=jerk adaptation=mtf disturbance=none,noise_step trials=64
      jerkbench tune -m filter=baseline,jerk adaptation=none,mtf,chi2 disturbance=none,outliers study=alike
      jerkbench tune -m filter=baseline,jerk adaptation=none,mtf disturbance=outliers --compare   and their table
      jerkbench tune filter=bias dataset=rosbag dataset.file=drive.bag objective=likelihood   your own log, no reference
      jerkbench tune -m filter=attitude_only attitude=mahony,mekf dataset=field               attitude filters alone

    It tunes every parameter with a range (`jerkbench show filter jerk`), and the factors on the reported R
    (r_scale.position, r_scale.velocity). knobs=[filter.accel_mps2,...] selects fewer.

      trials=64            how many settings are tried, the default setting among them
      sampler=sobol        sobol (for comparisons), tpe, cma_es (the extra `tune`); sampler_seed=1: other settings
      objective=rmse       rmse: log of the ratio to the plain filter of the same model, a lost run counts log 100;
                           likelihood: of the innovations, without a reference; inclination: of an attitude filter alone
      split=auto           seeds; time (share=0.5: tuned on the first half, tested on the second);
                           recordings, families (held_out=[NAME,...]: tested on these, tuned without them)
      tune_seeds=16 choose_seeds=16 test_seeds=40 first_seed=0      disjoint; the test seeds are read at the end
      finalists=8          so many of the best settings are tried again on the seeds to choose on
      restarts=1           how many searches with different settings: their spread is luck
      cluster=local        threads of this process; dask, slurm, ...: each scenario goes to a worker (docs/cluster.md)

    Written to results/STUDY/tune/METHOD: tuning.md, presets for `jerkbench run --config-dir`, settings for
    robot_localization, KF-GINS and eskf15, every trial. If you stop it, the same command continues.

    Raises:
        JerkbenchError: a word is unknown, or what it asks for cannot be tuned.
    """
    from jerkbench.hydra_app.tuning import tune_all

    tune_all(chosen.words, several=chosen.multirun, compare=chosen.compare)


@verb(
    argument("--scale", default="full", help="name of the protocol (default: full)"),
    argument("--results", type=output, default=Path("results"), help="folder of all results"),
    argument("--stored", action="store_true", help="judge the stored rows of any version, and run nothing"),
    argument(
        "--against", type=Path, metavar="FOLDER", help="say which verdicts another audit in FOLDER does not share"
    ),
    *WHERE,
)
def audit_verb(chosen: argparse.Namespace) -> None:
    """Tune every adaptive filter and the plain one alike, and judge them on unseen drives.

    SCALE is a protocol in conf/audit: what is compared, on which random drives, with which budget. The protocol and its
    hash are written before anything runs. Every drive and every setting follows from the hash.

      jerkbench audit --scale small      minutes: shows that all of it runs, answers nothing
      jerkbench audit --scale medium     two models, without what iterates: a minute, five if all must be compiled
      jerkbench audit                    the whole protocol: 20 minutes on two cores; --cluster and --workers for more
      jerkbench audit --scale second     the same with other drives and other tunings
      jerkbench audit --against results/audit-second     which verdicts the second one does not share

    The same command goes on where it was stopped. --stored judges what is stored, whatever version computed it, and
    runs nothing.

    RESULTS/audit-SCALE has answer.json with the answer, methods.csv, kinds.csv and apart.csv with its numbers, the rows
    that they follow from (judged.parquet, tuned.parquet, drives.parquet, settings.parquet), manifest.json with hashes,
    and protocol.json. experiments/audit/audit_page.py makes a page with figures from them.

    Raises:
        JerkbenchError: there is no such protocol, or a run failed.
    """
    from jerkbench.campaign.answer import AUDIT_FOLDER, compare_audits, judged_audit
    from jerkbench.campaign.audit import run_audit
    from jerkbench.campaign.protocol import read_protocol
    from jerkbench.hydra_app.configuration import cluster_named
    from jerkbench.jobs.executors import processors

    workers = chosen.workers or processors()
    protocol, folder = read_protocol(chosen.scale), chosen.results / f"{AUDIT_FOLDER}{chosen.scale}"
    if chosen.against:
        print(compare_audits(folder, chosen.against))
        return
    if not chosen.stored:
        run_audit(protocol, folder, cluster_named(chosen.cluster), workers)
    print("\n".join(judged_audit(folder).sentences))
    print(f"Written to {folder}.")


SUBMITTED_GROUPS = ("filter", "adaptation", "noise", "r_scale")
"""Groups of a method; all else is the suite's."""

DEFAULT_SUITE = "v2"


@verb(
    argument("words", nargs="+", metavar="KEY=VALUE", help="the method"),
    argument("--scale", default=DEFAULT_SUITE, help=f"name of the suite in conf/suite (default: {DEFAULT_SUITE})"),
    argument("--name", default="", help="what the board calls it (default: filter + adaptation)"),
    argument("--out", type=output, metavar="FOLDER", help="of the entry (default: results/suite-SCALE/NAME)"),
    *WHERE,
)
def suite_run_verb(chosen: argparse.Namespace) -> None:
    """Tune and score a method by the suite's protocol, and write its entry.

    KEY=VALUE are those of `jerkbench run` that make a method: filter, adaptation, noise, r_scale and what is in them.

      jerkbench suite run filter=jerk adaptation=mtf
      jerkbench suite run filter=baseline adaptation=my_rule --scale v2-tiny    seconds: does it run?
      jerkbench suite run filter=command filter.command="./mine {recording} {out}" --name mine

    A method whose parameters have ranges is tuned on 60 random drives and scored on 240 others; one without, and a
    program, is scored as it is given. The plain filter is tuned alike. The same command goes on where it was stopped.
    Written: entry.md, rows.parquet, settings.yaml, manifest.json (docs/suite.md).

    Raises:
        JerkbenchError: a word is unknown, the method does not fit, or the suite is not the frozen one.
    """
    from jerkbench.campaign.entry import enter
    from jerkbench.campaign.runs import CampaignRuns, MethodSpec
    from jerkbench.hydra_app.configuration import cluster_named
    from jerkbench.jobs.executors import Workers, processors

    spec = _spec(chosen.words)
    method = MethodSpec(**{kind: dict(spec[kind]) for kind in ("filter", "adaptation", "r_scale")})
    name = chosen.name or method.name
    stem = re.sub(r"[^\w.]+", "-", name).strip("-.") or "entry"
    folder = chosen.out or Path("results") / f"suite-{chosen.scale}" / stem
    scale = [] if chosen.scale == DEFAULT_SUITE else ["--scale", chosen.scale]
    command = shlex.join(["jerkbench", "suite", "run", *chosen.words, *scale])
    with Workers(cluster_named(chosen.cluster), chosen.workers or processors()) as workers:
        print(enter(chosen.scale, method, name, CampaignRuns(folder, workers), command))
    print(f"Written to {folder}.")


def _spec(words: Sequence[str]) -> Mapping[str, Any]:
    from jerkbench.errors import PluginError
    from jerkbench.hydra_app.composition import composed
    from jerkbench.hydra_app.overrides import owner

    for word in words:
        if owner(word) not in SUBMITTED_GROUPS:
            raise PluginError(
                f"'{word}' is not part of a method; the suite sets all else. Give {', '.join(SUBMITTED_GROUPS)} and"
                " what is in them, for example filter=jerk adaptation=mtf adaptation.window=3."
            )
    return composed(words).job().spec


@verb(
    argument("entry", type=Path, help="its folder"),
    RUN_PROGRAMS,
    argument("--rows", type=count, default=12, help="how many rows to compute once more (default: 12)"),
)
def suite_verify_verb(chosen: argparse.Namespace) -> None:
    """Check digests, completeness, score and a sample of rows of an entry.

      jerkbench suite verify results/suite-v2-tiny/jerk-none
      jerkbench suite verify results/suite-v2-tiny/jerk-none --rows 2

    Raises:
        JerkbenchError: there is no entry.
    """
    from jerkbench.campaign.board import verify
    from jerkbench.campaign.entry import read_entry

    checked = verify(read_entry(chosen.entry), chosen.rows, run_programs=chosen.run_programs)
    for sentence in (*checked.mistakes, *checked.remarks):
        print(sentence)
    if checked.mistakes:
        raise SystemExit(1)
    print(
        f"{chosen.entry} is what it says, as far as was checked; {checked.rerun} of its own rows were computed again."
    )


@verb(
    argument("folder", type=Path, help="with a folder for each entry"),
    argument("--rows", type=count, default=3, help="how many rows of each entry to compute again (default: 3)"),
)
def suite_board_verb(chosen: argparse.Namespace) -> None:
    """Write a sortable page of all entries of a folder, each verified.

      jerkbench suite board results/suite-v2-tiny
      jerkbench suite board results/suite-v2-tiny --rows 1

    Raises:
        JerkbenchError: there is no entry, or they are of several suites.
    """
    from jerkbench.campaign.board import write_board

    for path in write_board(chosen.folder, chosen.rows):
        print(path)
