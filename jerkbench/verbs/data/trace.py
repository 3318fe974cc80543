"""`jerkbench data trace`: the errors of a recording's fixes against its reference, to lay over any other recording."""

import argparse
from pathlib import Path

from jerkbench.verbs.arguments import Verbs, add_verb
from jerkbench.verbs.data.source import add_source, dataset_of


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    trace = add_verb(
        verbs,
        "trace",
        "write the errors of a recording's fixes against its reference, to replay them elsewhere",
        answer,
    )
    trace.epilog = "Then: jerkbench run disturbance=replayed_gnss disturbance.replayed_gnss.trace=TARGET"
    add_source(trace)
    trace.add_argument("target", type=Path, help="the file to write, .parquet")
    trace.add_argument(
        "--offset", choices=("remove", "keep"), default="remove", help="the median error (default: remove)"
    )
    trace.add_argument("--licence", default="", help="of the data, to stand in the file")
    trace.add_argument("--origin", default="", help="where the data are, to stand in the file")


def answer(chosen: argparse.Namespace) -> None:
    """Write the trace, and say what it is like."""
    from jerkbench.errors import JerkbenchError, unknown
    from jerkbench.traces import SUFFIX, read_trace, trace_of, trace_text, write_trace

    target: Path = chosen.target
    if target.suffix != SUFFIX:
        raise JerkbenchError(unknown("suffix of a trace", target.suffix, [SUFFIX]))
    if target.exists():
        raise JerkbenchError(f"{target} is there already; delete it or give another name.")
    recording = dataset_of(chosen.source, chosen.dataset, chosen.set).load(chosen.seed)
    centred = chosen.offset == "remove"
    write_trace(trace_of(recording, centred=centred, licence=chosen.licence, origin=chosen.origin), target)
    print(f"{target}: {trace_text(read_trace(target))}")
