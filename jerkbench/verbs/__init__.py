"""The verbs that read results: each a file with `add`, which declares its words, and `answer`."""

from jerkbench.verbs import compare, export, figures, report, rerun, table

VERBS = (table, figures, report, compare, rerun, export)
"""In the order in which `jerkbench --help` names them."""
