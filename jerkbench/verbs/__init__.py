"""The verbs but `run`, and the parser of the command line."""

import argparse
from functools import cache
from importlib.metadata import version

from jerkbench.verbs import campaigns, inspecting, plugins, recordings, results, single_runs
from jerkbench.verbs.arguments import group

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
