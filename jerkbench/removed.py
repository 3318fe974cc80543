"""Words that earlier versions understood: whoever types one hears what to do instead."""

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise

from jerkbench.errors import JerkbenchError

REMOVED: Mapping[str, str] = {
    r"(\+*|--)cluster[= ](\S*\W)?loky\b.*": (
        "cluster=loky is gone; cluster=local, which is the default, starts processes of this machine as well."
    ),
    r"(\+*|--)cluster[= ](\S*\W)?ray\b.*": (
        "cluster=ray is gone; give cluster=dask, for this machine or for a cluster (docs/cluster.md)."
    ),
    r"(\+*results=|--results[= ])?(s3|gs|gcs|az|abfs|memory|file)://?.*": (
        "Results go to folders of this machine alone; give a path, and copy the folder to and from an object store."
    ),
    r"--fit": (
        "table --fit is gone; in LaTeX, put the table into \\resizebox{\\linewidth}{!}{...}, or give fewer --columns."
    ),
    r"\+*portable=.*": (
        "portable=true is gone; rows of two processors may differ in their last digits, and `jerkbench suite verify`"
        " compares them to within 1e-9."
    ),
    r"--attribution|--scale[= ]attribution": (
        "`jerkbench audit --attribution` is gone; the page of `jerkbench audit` says what each step brings."
    ),
}
"""What was typed, alone or with the word behind it, and the sentence."""


def refuse_removed(words: Sequence[str]) -> None:
    """Refuse words of a command line, or options of a configuration, that are no longer understood.

    Raises:
        JerkbenchError: there is one; says what to do instead.
    """
    for word in (*words, *map(" ".join, pairwise(words))):
        for pattern, sentence in REMOVED.items():
            if re.fullmatch(pattern, word, flags=re.DOTALL):
                raise JerkbenchError(sentence)
