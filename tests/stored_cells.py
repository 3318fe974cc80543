"""Stored cells as a run leaves them, made without one."""

import pyarrow.parquet as pq

from jerkbench.jobs.store import RowBlock, Store, table_of

LABELS = {
    "dataset": "field",
    "disturbance": "none",
    "attitude": "field",
    "filter": "jerk",
    "adaptation": "none",
    "noise": "default",
}
NAMED = ("dataset", "attitude", "filter", "adaptation", "engine")
SPEC = {**{kind: {"name": LABELS.get(kind, "compiled")} for kind in NAMED}, "disturbance": [], "metrics": []}
PROTOCOL = {"seeds": 1, "first_seed": 0, "burn_in_s": 5.0, "divergence_limit_m": 1000.0}


def about(**changed):
    """What stands beside the rows of a cell."""
    beside = {"labels": LABELS, "spec": SPEC, "protocol": PROTOCOL, "data": "", "notes": ["a note"], "code": "a"}
    return {**beside, "versions": {}, "commit": "", "created": "2026-01-01T00:00:00Z", "seconds": 0.5, **changed}


def row(rmse_m=0.1 + 0.2, seed=0, status="ok", **labels):
    """A row of a run."""
    told = {"seed": seed, "replicate": "seed", "status": status, "reason": ""}
    return {**LABELS, **labels, **told, "position_rmse_m": rmse_m}


def write_blocks(store, blocks):
    """Store blocks of rows as one file."""
    store.write([table_of(blocks)])


def store_cell(store, key, rows, metadata):
    """Store a whole cell, as a part of its own."""
    write_blocks(store, [RowBlock(key, len(rows), rows, metadata)])


def put(folder, key, rmse_m, *, seeds=1, conditions=None, **changed):
    """Store a cell of a few runs; ``changed`` are labels, or what stands beside the rows."""
    named = {name: changed.pop(name) for name in LABELS if name in changed}
    more = {"notes": [f"recording of {key}"], **changed, **(conditions or {})}
    ran = {kind: {"name": named[kind].partition("(")[0]} for kind in NAMED if kind in named}
    ran |= (
        {"disturbance": [{"name": part} for part in named["disturbance"].split("+")]} if "disturbance" in named else {}
    )
    more = {
        **more,
        "spec": {**SPEC, **ran, **more.get("spec", {})},
        "protocol": {**PROTOCOL, **more.get("protocol", {})},
    }
    rows = [row(rmse_m, seed, **named) for seed in range(seeds)]
    store_cell(Store(folder), key, rows, about(labels={**LABELS, **named}, **more))


def drop(store, keys):
    """Delete some cells, as if they had never run; the others become a file each."""
    cells, _ = store.read()
    for path in store.folder.glob("*.parquet"):
        path.unlink()
    for cell in cells:
        if cell.key not in keys:
            store_cell(store, cell.key, cell.rows.to_dict("records"), cell.metadata)


def keys_of(folder):
    """The keys of all cells of a study, complete or not."""
    tables = (pq.read_table(path, columns=["cell.key"]) for path in (folder / "cells").glob("*.parquet"))
    return sorted({key for table in tables for key in table["cell.key"].to_pylist()})
