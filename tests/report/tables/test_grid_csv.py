"""table.csv is written by columns; line by line it is what each metric's own table says."""

import numpy as np
import pandas as pd
import pytest

from jerkbench.report import summary
from jerkbench.report.columns import metric_columns
from jerkbench.report.summary import main_metric, summarise, write_tables
from jerkbench.report.writers import tidy_csv
from made_rows import cell_rows

LABELS = [
    ("drive,2", 'base"line', "none", "accel=0.1"),
    ("drive,2", "jerk", "mtf", "accel=0.1"),
    ("field", "jerk", "none", "accel=0.2"),
    ("field", 'base"line', "mtf", "accel=0.1"),
    ("field", "jerk", "mtf", "accel=0.1"),
]


def runs_of(count, replicate, seed):
    """Runs of every ending, with metrics that some of them lack, that are negative, zero, huge or the same in all."""
    rng, rows = np.random.default_rng(seed), []
    for dataset, model, rule, noise in LABELS:
        for row in cell_rows(model, rule, rng.lognormal(0, 1.5, count), dataset=dataset, noise=noise):
            anees, drift, speed = rng.lognormal(0, 1.5, 3)
            row |= {"replicate": replicate, "status": rng.choice(["ok", "diverged", "failed"], p=[0.8, 0.1, 0.1])}
            row |= {"anees": anees if rng.random() < 0.7 else np.nan, "drift_mps": drift - 1, "step_us": 3}
            rows.append(row | {"outage_end_m": np.nan, "velocity_rmse_mps": 1e300 * speed})
    return pd.DataFrame(rows)


@pytest.mark.parametrize(("count", "replicate"), [(1, "seed"), (3, "seed"), (6, "seed"), (21, "seed"), (4, "phase")])
def test_each_metric_has_the_lines_of_its_own_table(count, replicate, tmp_path):
    rows = runs_of(count, replicate, seed=count)
    write_tables(rows, tmp_path)

    first = main_metric(rows)
    others = [metric for metric in metric_columns(rows) if metric != first]
    assert (tmp_path / "table.csv").read_text(encoding="utf-8") == tidy_csv(
        [summarise(rows, metric, leaders=False) for metric in (first, *others)]
    )


def test_of_very_many_cells_the_markdown_has_the_first_table_alone(tmp_path, monkeypatch):
    rows = runs_of(3, "seed", seed=3)
    write_tables(rows, tmp_path / "few")
    monkeypatch.setattr(summary, "MANY_CELLS", len(LABELS) - 1)
    write_tables(rows, tmp_path / "many")

    few, many = ((tmp_path / name / "table.md").read_text(encoding="utf-8") for name in ("few", "many"))
    assert few.count("\n## ") > 0
    assert many.count("\n## ") == 0
    assert few.startswith(many)
    assert (tmp_path / "few" / "table.csv").read_bytes() == (tmp_path / "many" / "table.csv").read_bytes()
