"""The verbs but `run`: each a module with `add`, which declares its words and its `answer`."""

from jerkbench.verbs import (
    audit,
    check,
    cite,
    compare,
    data,
    export,
    figures,
    listing,
    new,
    pack,
    report,
    rerun,
    score,
    show,
    suite,
    table,
    tune,
)

VERBS = (
    *(listing, show, data),
    *(table, figures, report, compare, score),
    *(tune, audit, suite),
    *(rerun, export, pack),
    *(new, check, cite),
)
"""In the order in which `jerkbench --help` names them."""
