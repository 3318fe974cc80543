"""What an audit leaves: a few files of rows from which every number of its page follows, and these rows as arrays."""

import dataclasses
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench import plugins
from jerkbench.arrays import FloatArray
from jerkbench.audit.campaign import METHOD, Campaign, picks, settings_of, tuning_losses
from jerkbench.audit.protocol import PUBLISHED, AuditMethod, AuditProtocol, audit_protocol
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.statistics.drives_and_tunings import Losses, log_losses
from jerkbench.files import write_atomically, write_text

PROTOCOL = "protocol.json"
JUDGED = -1
"""The number that stands for a tuning, of drives that no tuning has seen."""


@dataclass(frozen=True)
class AuditRows:
    """The rows of an audit, each table a file in its folder.

    Attributes:
        protocol: what was compared.
        drives: a drive a row: seed, tuning (-1: judged), level (log error of the first plain filter at its defaults),
            and what was drawn for it, in columns that begin with ``drawn.``.
        tuned: a setting of a tuning a row: filter, adaptation, tuning, trial, drives, lost, loss.
        judged: a run on an unseen drive a row: filter, adaptation, tuning, tried (settings of its search; 1: the
            defaults), trial, seed, status, log_error (of a lost run: NaN).
        settings: a knob of what a search has found a row: filter, adaptation, tuning, tried, knob, value.
    """

    protocol: AuditProtocol
    drives: pd.DataFrame
    tuned: pd.DataFrame
    judged: pd.DataFrame
    settings: pd.DataFrame

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The tables by their names."""
        return {name: getattr(self, name) for name in TABLES}

    def write(self, folder: Path) -> None:
        """Write each table into a file of its own."""
        for name, table in self.tables.items():
            write_rows(table, folder / f"{name}.parquet")


TABLES = tuple(known.name for known in dataclasses.fields(AuditRows) if known.name != "protocol")


def collected(campaign: Campaign) -> AuditRows:
    """Run what a campaign has not run yet, and return its rows.

    Raises:
        JerkbenchError: a plain filter was lost, or a run cannot be made.
        OSError: nothing can be stored.
    """
    protocol = campaign.protocol
    methods = [*protocol.competing, *protocol.beside]
    on_tuning = campaign.on_tuning(methods)
    settings = tuning_losses(on_tuning)
    picked = picks(protocol, settings)
    judged = campaign.judged(methods, picked)
    knobs = pd.DataFrame([row for own in picked.itertuples() for row in _setting(protocol, own)])
    levels = pd.concat([runs[["seed", "level"]].drop_duplicates("seed") for runs in (on_tuning, judged)])
    return AuditRows(protocol, _drives(protocol, levels), settings, _judged(judged, picked), knobs)


def _judged(runs: pd.DataFrame, picked: pd.DataFrame) -> pd.DataFrame:
    """The runs of what each search has found, and those of the defaults, which are run once."""
    defaults = picked[picked["tuning"] == 0].drop_duplicates(METHOD).assign(tried=1, trial=0)
    wanted = pd.concat([picked, defaults], ignore_index=True).drop(columns="loss")
    run_of = wanted["tuning"].where(wanted["trial"] > 0, 0)  # the defaults of every tuning are the same
    own = runs.rename(columns={"tuning": "run_of"})[[*METHOD, "run_of", "trial", "seed", "status", "log_error", "lost"]]
    rows = wanted.assign(run_of=run_of).merge(own.astype(dict.fromkeys(METHOD, str)), on=[*METHOD, "run_of", "trial"])
    rows["log_error"] = rows["log_error"].where(~rows["lost"])
    return rows.drop(columns=["run_of", "lost"]).astype({"tuning": np.int8, "tried": np.int16, "trial": np.int16})


def _drives(protocol: AuditProtocol, levels: pd.DataFrame) -> pd.DataFrame:
    dataset: Any = plugins.create("dataset", dict(protocol.laws))
    drives = levels.sort_values("seed", ignore_index=True)
    tuning = (drives["seed"] - protocol.seeds_to_tune_on(0)[0]) // protocol.tune_drives
    drives.insert(1, "tuning", tuning.where(drives["seed"] < protocol.seeds_to_judge_on[0], JUDGED))
    return drives.join(pd.DataFrame([dataset.columns(seed) for seed in drives["seed"].tolist()]))


def _setting(protocol: AuditProtocol, picked: Any) -> Iterator[Mapping[str, object]]:  # noqa: ANN401 - a named tuple
    method = AuditMethod(picked.filter, picked.adaptation)
    setting = settings_of(protocol, method, picked.tuning)[picked.trial]
    for knob, value in zip(protocol.spaces[method].names, setting, strict=True):
        yield {**method._asdict(), "tuning": picked.tuning, "tried": picked.tried, "knob": knob, "value": value}


# Reading and writing.


def write_protocol(protocol: AuditProtocol, folder: Path) -> None:
    """Write the protocol and its hash, before anything runs.

    Raises:
        JerkbenchError: the folder has another protocol's results.
    """
    path = folder / PROTOCOL
    if path.exists() and (there := json.loads(path.read_text(encoding="utf-8")))["digest"] != protocol.digest:
        raise JerkbenchError(
            f"{folder} has an audit of another protocol ({there['digest']}; this one is {protocol.digest}); give"
            " another folder (--results), or delete it."
        )
    write_text(path, json.dumps({"digest": protocol.digest, **dataclasses.asdict(protocol)}, indent=1))


def read_rows(folder: Path) -> AuditRows:
    """Return the rows of the audit in ``folder``.

    Raises:
        JerkbenchError: there is none, or its protocol is not what its hash says.
    """
    try:
        stated = json.loads((folder / PROTOCOL).read_text(encoding="utf-8"))
        tables = {name: pd.read_parquet(folder / f"{name}.parquet") for name in TABLES}
    except FileNotFoundError as error:
        raise JerkbenchError(f"{error.filename} is not there; run the audit to its end first.") from error
    digest = stated.pop("digest")
    protocol = audit_protocol(stated, folder / PROTOCOL)
    if protocol.digest != digest:
        raise JerkbenchError(f"{folder / PROTOCOL} says digest {digest}, but has {protocol.digest}; it was changed.")
    return AuditRows(protocol, **tables)


TEXTS = ("filter", "adaptation", "status")


def write_rows(rows: pd.DataFrame, path: Path) -> None:
    """Write rows as Parquet: each text as a code, the bytes of numbers apart, which compresses."""
    coded = rows.astype({name: "category" for name in TEXTS if name in rows})
    table = pa.Table.from_pandas(coded, preserve_index=False)
    floats = [known.name for known in table.schema if pa.types.is_floating(known.type)]
    how = {
        "compression": "zstd",
        "use_dictionary": [name for name in table.column_names if name not in floats],
        "column_encoding": dict.fromkeys(floats, "BYTE_STREAM_SPLIT"),
    }
    write_atomically(path, lambda partial: pq.write_table(table, partial, **how))


# From the rows to log errors by method, tuning and drive.


class Cubes(NamedTuple):
    """Log errors of some methods.

    Attributes:
        tuned: (M, R, D) as tuned, on the drives to judge on.
        on_tuning: (M, R) of what was found, on the drives to tune on.
    """

    tuned: FloatArray
    on_tuning: FloatArray


def cubes(rows: AuditRows, methods: Sequence[AuditMethod], tried: int = 0, cost: float = 0.0) -> Cubes:
    """Return the log errors of ``methods``, all of which have as many tunings and drives.

    Args:
        rows: of the audit.
        methods: in order.
        tried: how many settings a search has tried; default: as many as a method may.
        cost: of a lost run; default: that of the protocol. It changes what is judged, not what the search has found.
    """
    protocol, tried = rows.protocol, tried or rows.protocol.trials
    found = picks(protocol, rows.tuned)
    return Cubes(
        _array(_with_losses(rows, tried, cost or protocol.lost_costs), methods, ["tuning", "seed"]),
        _array(found[found["tried"] == tried], methods, ["tuning"]),
    )


def defaults(rows: AuditRows, methods: Sequence[AuditMethod]) -> FloatArray:
    """Return the log errors (M, D) of ``methods`` at their defaults."""
    return _array(_with_losses(rows, 1, rows.protocol.lost_costs), methods, ["seed"])


def losses_of(rows: AuditRows, cost: float = 0.0) -> Losses:
    """Return the log errors of all that are compared, with a ``cost`` of a lost run as in `cubes`."""
    protocol = rows.protocol
    methods, plains = (cubes(rows, own, 0, cost) for own in (protocol.methods, protocol.plains))
    wide = cubes(rows, protocol.plains, protocol.plain_trials, cost)
    published = np.array([protocol.adaptations[method.adaptation] in PUBLISHED for method in protocol.methods])
    model = np.array([protocol.filters.index(method.filter) for method in protocol.methods])
    of_tuning = methods.on_tuning, plains.on_tuning, wide.on_tuning
    return Losses(methods.tuned, plains.tuned, wide.tuned, *of_tuning, model, published, published)


def lost_shares(rows: AuditRows, methods: Sequence[AuditMethod]) -> FloatArray:
    """Return the share of the runs of each of ``methods``, as tuned, that were lost."""
    own = rows.judged[rows.judged["tried"] == rows.protocol.trials]
    shares = own["log_error"].isna().groupby([own[name].astype(str) for name in METHOD]).mean()
    return np.asarray(shares.loc[list(methods)], dtype=np.float64)


def _with_losses(rows: AuditRows, tried: int, cost: float) -> pd.DataFrame:
    own = rows.judged[rows.judged["tried"] == tried]
    level = own["seed"].map(rows.drives.set_index("seed")["level"]).to_numpy()
    error = own["log_error"].to_numpy(dtype=np.float64)
    return own.assign(loss=log_losses(np.exp(error), np.isnan(error), np.exp(level), cost))


def _array(table: pd.DataFrame, methods: Sequence[AuditMethod], axes: Sequence[str]) -> FloatArray:
    """The column ``loss`` of a table as an array: the methods, then the ``axes`` in the order of their values."""
    name = table["filter"].astype(str) + " + " + table["adaptation"].astype(str)
    names = [method.name for method in methods]
    known = table.assign(name=name)[name.isin(names)]
    wide = known.pivot_table(index=[*axes], columns="name", values="loss", aggfunc="first", dropna=False, observed=True)
    sizes = [known[axis].nunique() for axis in axes]
    return np.asarray(wide[names].to_numpy(dtype=np.float64).T.reshape(len(names), *sizes))
