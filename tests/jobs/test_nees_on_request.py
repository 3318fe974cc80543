"""The sums of e' P^-1 e are worked out where a metric asks for them, and change no other value."""

from jerkbench.jobs.job import Protocol
from jerkbench.jobs.names import job_of_parts
from jerkbench.jobs.rows import job_rows

PARTS = {
    "dataset": {"name": "field", "duration_s": 12.0},
    "attitude": None,
    "filter": "baseline",
    "adaptation": "mtf",
    "engine": "compiled",
}


def row_of(*metrics):
    (row,), _ = job_rows(job_of_parts(PARTS, [], None, Protocol(seeds=1), metrics), [0])
    return row


def test_consistency_is_there_where_it_is_asked_for_and_changes_nothing_else():
    alone, both = row_of("position_rmse"), row_of("position_rmse", "consistency")

    assert both["anees"] > 0.0
    assert {name: both[name] for name in alone} == alone
