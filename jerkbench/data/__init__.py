"""The verbs of `jerkbench data`, which look after recordings."""
