"""The runs of an audit; what they leave, rows from which every number of its page follows; and these as arrays."""

import dataclasses
import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from jerkbench import plugins
from jerkbench.arrays import FloatArray
from jerkbench.audit.protocol import PUBLISHED, AuditMethod, AuditProtocol, audit_protocol
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.drives_and_tunings import Losses, log_losses
from jerkbench.files import write_atomically, write_text
from jerkbench.jobs.executors import Cluster, Workers
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.jobs.manifest import MANIFEST
from jerkbench.jobs.progress import Progress
from jerkbench.notices import notify
from jerkbench.tuning.entrant import RunRules, Site, Try
from jerkbench.tuning.stored_files import (
    Test,
    changed_files,
    file_hashes,
    is_mapping_of,
    is_string,
    is_text,
    read_file,
    read_table,
    require_parts,
    require_regular,
    require_table_columns,
)

_STATED = "protocol.json"
_METHOD = ["filter", "adaptation"]
POSITION_ERROR = "position_rmse_m"
"""The column that counts."""
TYPES: dict[str, Any] = {**dict.fromkeys((*_METHOD, "status"), "category"), "tuning": np.int8, "trial": np.int16}
RULES = RunRules(("position_rmse",), numbers=(POSITION_ERROR,))
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


TABLE_COLUMNS = {
    "drives": ("tuning", "seed", "level"),
    "tuned": (*_METHOD, "tuning", "trial", "drives", "lost", "loss"),
    "judged": (*_METHOD, "tuning", "tried", "trial", "seed", "status", "log_error"),
    "settings": (*_METHOD, "tuning", "tried", "knob", "value"),
}
"""Columns that each table must have, by the names of the tables. The last one is a number."""

TABLES = tuple(TABLE_COLUMNS)
_FILES = (_STATED, *(f"{name}.parquet" for name in TABLES))
_TEXTS, _KEYS = (*_METHOD, "status"), (*_METHOD, "tuning", "tried", "trial", "seed")


# The runs of an audit: every setting on the drives to tune on, then the best of each tuning on unseen drives.


def collected(protocol: AuditProtocol, site: Site) -> AuditRows:
    """Run at ``site`` what is not stored there yet, and return the rows.

    Raises:
        JerkbenchError: a plain filter was lost, or a run cannot be made.
        OSError: nothing can be stored.
    """
    methods = [*protocol.competing, *protocol.beside]
    tries = [
        Try(tuning, protocol.drives, method.entrant, setting, trial, protocol.seeds_to_tune_on(tuning))
        for tuning in range(protocol.tunings)
        for method in methods
        if tuning in protocol.tunings_of(method)
        for trial, setting in enumerate(protocol.settings_of(method, tuning))
    ]
    on_tuning = _run(protocol, site, tries, "Audit, settings tried")
    of_setting = on_tuning.groupby([*_METHOD, "tuning", "trial"], observed=True, sort=True)
    tuned = of_setting.agg(drives=("seed", "size"), lost=("lost", "sum"), loss=("loss", "mean")).reset_index()
    picked = picks(protocol, tuned)
    judged = _judged(protocol, site, methods, picked)
    levels = pd.concat([runs[["seed", "level"]].drop_duplicates("seed") for runs in (on_tuning, judged)])
    return AuditRows(protocol, _drives(protocol, levels), tuned, _of_picks(judged, picked), _knobs(protocol, picked))


def _judged(protocol: AuditProtocol, site: Site, methods: Sequence[AuditMethod], picked: pd.DataFrame) -> pd.DataFrame:
    """Run the defaults of ``methods``, and what each search has ``picked``, on unseen drives; returns the runs."""
    found = picked[["tuning", *_METHOD, "trial"]].itertuples(index=False, name=None)
    wanted = {(tuning if trial else 0, AuditMethod(*names), trial) for tuning, *names, trial in found}  # defaults: once
    wanted |= {(0, method, 0) for method in methods}
    tries = [
        Try(tuning, protocol.drives, own.entrant, protocol.settings_of(own, tuning)[trial], trial, protocol.judges(own))
        for tuning, own, trial in sorted(wanted)
    ]
    return _run(protocol, site, tries, "Audit, judged unseen")


def _run(protocol: AuditProtocol, site: Site, tries: Sequence[Try], title: str) -> pd.DataFrame:
    """Run what is not stored; returns `METHOD`, tuning, trial, seed, status, log_error, lost, level and loss.

    The level is the log error of the first plain filter at its defaults on a drive; a lost run costs ``lost_costs`` of
    it.

    Raises:
        JerkbenchError: that filter was lost itself, or has not run.
    """
    with Progress(len(tries), doing=title, unit="settings") as bar:
        rows = site.rows(tries, RULES, bar)
    with np.errstate(divide="ignore"):
        rows["log_error"] = np.log(rows.pop(POSITION_ERROR)).astype(np.float32)
    rows["status"] = rows["status"].mask(rows["status"] == "failed", "failed: " + rows["reason"])
    runs = rows.drop(columns=["reason", "seconds"]).rename(columns={"scenario": "tuning"}).astype(TYPES)
    filter_, plain = protocol.plains[0]
    first = runs[(runs["filter"] == filter_) & (runs["adaptation"] == plain) & (runs["trial"] == 0)]
    levels = first[first["status"] == "ok"].drop_duplicates("seed").set_index("seed")["log_error"].astype(float)
    if missing := sorted(set(runs["seed"]) - set(levels.index)):
        raise JerkbenchError(
            f"On drive {missing[0]} {filter_} + {plain} was lost at its defaults, or has not run, so that a lost run"
            " costs nothing that is known; make the faults milder, or run the audit to its end."
        )
    level, error = runs["seed"].map(levels).to_numpy(), runs["log_error"].to_numpy(dtype=float)
    lost = (runs["status"] != "ok").to_numpy() | ~np.isfinite(error)
    return runs.assign(lost=lost, level=level, loss=np.where(lost, level + np.log(protocol.lost_costs), error))


def picks(protocol: AuditProtocol, tuned: pd.DataFrame) -> pd.DataFrame:
    """Return what each search has found: the trial with the lowest loss, of equals the first.

    Returns:
        filter, adaptation, tuning, tried (how many settings), trial, loss.
    """
    found = _lowest(tuned[tuned["trial"] < protocol.trials], protocol.trials)
    plain = pd.MultiIndex.from_frame(tuned[_METHOD].astype(str)).isin(protocol.plains)
    return pd.concat([found, _lowest(tuned[plain], protocol.plain_trials)], ignore_index=True)


def _lowest(tuned: pd.DataFrame, tried: int) -> pd.DataFrame:
    """Of each tuning of each method; those of equal losses are sorted by their trials."""
    order = tuned.sort_values([*_METHOD, "tuning", "loss", "trial"], kind="stable")
    first = order.drop_duplicates([*_METHOD, "tuning"])
    return first.assign(tried=tried)[[*_METHOD, "tuning", "tried", "trial", "loss"]]


def _of_picks(runs: pd.DataFrame, picked: pd.DataFrame) -> pd.DataFrame:
    """The runs of what each search has found, and those of the defaults, which are run once."""
    defaults = picked[picked["tuning"] == 0].drop_duplicates(_METHOD).assign(tried=1, trial=0)
    wanted = pd.concat([picked, defaults], ignore_index=True).drop(columns="loss")
    run_of = wanted["tuning"].where(wanted["trial"] > 0, 0)  # the defaults of every tuning are the same
    own = runs.rename(columns={"tuning": "run_of"}).drop(columns=["level", "loss"])
    rows = wanted.assign(run_of=run_of).merge(own.astype(dict.fromkeys(_METHOD, str)), on=[*_METHOD, "run_of", "trial"])
    rows["log_error"] = rows["log_error"].where(~rows["lost"])
    return rows.drop(columns=["run_of", "lost"]).astype({"tuning": np.int8, "tried": np.int16, "trial": np.int16})


def _drives(protocol: AuditProtocol, levels: pd.DataFrame) -> pd.DataFrame:
    dataset: Any = plugins.create("dataset", dict(protocol.laws))
    drives = levels.sort_values("seed", ignore_index=True)
    tuning = (drives["seed"] - protocol.seeds_to_tune_on(0)[0]) // protocol.tune_drives
    drives.insert(1, "tuning", tuning.where(drives["seed"] < protocol.seeds_to_judge_on[0], JUDGED))
    return drives.join(pd.DataFrame([dataset.columns(seed) for seed in drives["seed"].tolist()]))


def _knobs(protocol: AuditProtocol, picked: pd.DataFrame) -> pd.DataFrame:
    """A row for each knob of what each search has found."""
    rows, found = [], picked[[*_METHOD, "tuning", "tried", "trial"]].itertuples(index=False, name=None)
    for *names, tuning, tried, trial in found:
        method, head = AuditMethod(*names), {"tuning": tuning, "tried": tried}
        values = zip(protocol.spaces[method].names, protocol.settings_of(method, tuning)[trial], strict=True)
        rows += [{**method._asdict(), **head, "knob": knob, "value": value} for knob, value in values]
    return pd.DataFrame(rows)


# Reading and writing.

_ORIGIN = "Run `jerkbench audit` to its end; runs that are stored are not repeated."


def write_protocol(protocol: AuditProtocol, folder: Path) -> None:
    """Write the protocol and its hash, before anything runs.

    Raises:
        JerkbenchError: the folder has another protocol's results.
    """
    path = folder / _STATED
    if path.exists() and (there := _stated(path)["digest"]) != protocol.digest:
        raise JerkbenchError(
            f"{folder} has an audit of another protocol ({there}; this one is {protocol.digest}); give another folder"
            " (--results), or delete it."
        )
    write_text(path, json.dumps({"digest": protocol.digest, **dataclasses.asdict(protocol)}, indent=1))


def _stated(path: Path) -> dict[str, Any]:
    require_regular([path], _ORIGIN)
    stated = read_file(path, lambda own: json.loads(own.read_text(encoding="utf-8")), _ORIGIN)
    fits = isinstance(stated, dict) and is_text(stated.get("digest"))
    require_parts(path, {"": fits or "a JSON object with a digest"}, _ORIGIN)
    return dict(stated)


def write_audit_manifest(folder: Path, made: Mapping[str, object]) -> None:
    """Write what the rows were made with, the hashes of the other files, and the hash of all of this."""
    write_text(folder / MANIFEST, _manifest_text({**made, "files": file_hashes(folder, _FILES)}))


def _manifest_text(content: Mapping[str, object]) -> str:
    digest = hashlib.sha256(json.dumps(content).encode()).hexdigest()
    return json.dumps({**content, "digest": digest}, indent=1) + "\n"


def _manifest(path: Path) -> dict[str, Any]:
    text = path.read_text(encoding="utf-8")
    content = json.loads(text)
    content = {key: value for key, value in content.items() if key != "digest"} if isinstance(content, dict) else {}
    if _manifest_text(content) != text:
        raise ValueError("it was changed after it was made, or an earlier version made it")
    return content


def read_audit_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of an audit.

    Raises:
        JerkbenchError: a file is missing, or was changed after it was made.
    """
    require_regular((folder / name for name in (MANIFEST, *_FILES)), _ORIGIN)
    manifest = read_file(folder / MANIFEST, _manifest, _ORIGIN)
    hashes, commit = manifest.get("files"), manifest.get("git_commit")
    parts: dict[str, bool | str] = {
        "'files'": is_mapping_of(is_text)(hashes) or "hashes by the names of the files",
        "'git_commit'": is_text(commit) or "a commit",
    }
    require_parts(folder / MANIFEST, parts, _ORIGIN)
    for name in _FILES:
        for sentence in read_file(folder / name, lambda path: changed_files(folder, hashes, [path.name]), _ORIGIN):
            raise JerkbenchError(f"{folder}: {sentence} {_ORIGIN}")
    return dict(manifest)


def read_rows(folder: Path) -> AuditRows:
    """Return the rows of the audit in ``folder``.

    Raises:
        JerkbenchError: there is none, a file was changed after it was made, or rows are missing.
    """
    read_audit_manifest(folder)
    stated = _stated(folder / _STATED)
    digest = stated.pop("digest")
    protocol = audit_protocol(stated, folder / _STATED)
    if protocol.digest != digest:
        raise JerkbenchError(f"{folder / _STATED} says digest {digest}, but has {protocol.digest}; it was changed.")
    rows = AuditRows(protocol, **{name: _table(folder / f"{name}.parquet", TABLE_COLUMNS[name]) for name in TABLES})
    _require_complete(rows, folder)
    return rows


def _table(path: Path, columns: Sequence[str]) -> pd.DataFrame:
    table = read_file(path, read_table, _ORIGIN)
    kinds = {name: "text" if name in (*_TEXTS, "knob") else "whole numbers" for name in columns[:-1]}
    require_table_columns(path, table, {**kinds, columns[-1]: "numbers"}, _IS_KIND, _ORIGIN)
    rows: pd.DataFrame = table.to_pandas(ignore_metadata=True)
    return rows


_IS_KIND: Mapping[str, Test] = {
    "text": lambda kind: is_string(kind.value_type if pa.types.is_dictionary(kind) else kind),
    "whole numbers": pa.types.is_integer,
    "numbers": pa.types.is_floating,
}


def _require_complete(rows: AuditRows, folder: Path) -> None:
    """Check that each row is there once, and that its number is finite unless the run diverged or failed.

    Raises:
        JerkbenchError: a row or a number is missing, or there too often.
    """
    protocol, methods = rows.protocol, [*rows.protocol.competing, *rows.protocol.beside]
    for name, table in rows.tables.items():
        number, has_value = TABLE_COLUMNS[name][-1], table["status"] == "ok" if name == "judged" else True
        fits = (np.isfinite(table[number]) == has_value).all()
        said = "finite, except in runs that diverged or failed"
        require_parts(folder / f"{name}.parquet", {f"column '{number}'": bool(fits) or said}, _ORIGIN)
    seeds = {(r,): protocol.seeds_to_tune_on(r) for r in range(protocol.tunings)}
    tunings = [(method, r) for method in methods for r in protocol.tunings_of(method)]
    trials = {(*method, r): range(max(protocol.searches(method))) for method, r in tunings}
    _require_once(folder, "drives", rows.drives, "seed", {**seeds, (JUDGED,): protocol.seeds_to_judge_on})
    _require_once(folder, "tuned", rows.tuned, "trial", trials)
    found = picks(protocol, rows.tuned).drop(columns="loss").itertuples(index=False, name=None)
    judges = {own: protocol.judges(AuditMethod(*own[:2])) for own in found}
    judges |= {(*method, 0, 1, 0): protocol.judges(method) for method in methods}
    _require_once(folder, "judged", rows.judged, "seed", judges)
    searches = Counter(method for method, _ in tunings for _ in protocol.searches(method))
    for key, own in rows.settings.groupby([*_METHOD, "knob"], observed=True):
        *names, knob = map(str, key)
        fits = len(own) == len(own.drop_duplicates(["tuning", "tried"])) == searches[AuditMethod(*names)]
        part = {f"the value of {knob} of {', '.join(names)}": fits or "there once for each search"}
        require_parts(folder / "settings.parquet", part, _ORIGIN)


def _require_once(
    folder: Path, name: str, table: pd.DataFrame, each: str, wanted: Mapping[tuple[Any, ...], range]
) -> None:
    """Check that for each wanted group of rows, and no other, the column ``each`` has each value once."""
    by = [column for column in TABLE_COLUMNS[name] if column in _KEYS and column != each]
    found = table.groupby(by, observed=True)[each].agg(["size", "nunique", "min", "max"]).reset_index()
    groups = {tuple(own[: len(by)]): own[len(by) :] for own in found.itertuples(index=False, name=None)}
    for key in {**wanted, **groups}:
        own = wanted.get(key, range(0))
        fits = bool(own) and groups.get(key) == (len(own), len(own), own[0], own[-1])
        part = {f"the rows of {', '.join(map(str, key))}": fits or f"there once for each {each}, and no others"}
        require_parts(folder / f"{name}.parquet", part, _ORIGIN)


def write_rows(rows: pd.DataFrame, path: Path) -> None:
    """Write rows as Parquet: each text as a code, the bytes of numbers apart, which compresses."""
    coded = rows.astype({name: "category" for name in _TEXTS if name in rows})
    table = pa.Table.from_pandas(coded, preserve_index=False)
    floats = [known.name for known in table.schema if pa.types.is_floating(known.type)]
    how = {
        "compression": "zstd",
        "use_dictionary": [name for name in table.column_names if name not in floats],
        "column_encoding": dict.fromkeys(floats, "BYTE_STREAM_SPLIT"),
    }
    write_atomically(path, lambda partial: pq.write_table(table, partial, **how))


_CHANGED = "+changes"
"""The end of a commit with changes."""


def run_audit(protocol: AuditProtocol, folder: Path, cluster: Cluster, workers: int) -> None:
    """Run what is not stored in ``folder`` yet, and write the rows and the manifest.

    Args:
        protocol: what is compared.
        folder: of the audit.
        cluster: what runs it.
        workers: number of processes, where the cluster starts them.

    Raises:
        JerkbenchError: the folder has another protocol's results, or a run cannot be made.
        OSError: nothing can be written.
    """
    made = {"protocol": protocol.digest, "code": code_digest(), "git_commit": git_commit(), "versions": versions()}
    if git_commit().endswith(_CHANGED):
        notify("the tree has changes that are not committed: nobody else can have this code, and the page says so")
    write_protocol(protocol, folder)
    with Workers(cluster, workers) as own:
        collected(protocol, Site(folder / "runs", own)).write(folder)
    write_audit_manifest(folder, made)


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
    shares = own["log_error"].isna().groupby([own[name] for name in _METHOD], observed=True).mean()
    return np.asarray(shares.loc[list(methods)], dtype=np.float64)


def _with_losses(rows: AuditRows, tried: int, cost: float) -> pd.DataFrame:
    own = rows.judged[rows.judged["tried"] == tried]
    level = own["seed"].map(rows.drives.set_index("seed")["level"]).to_numpy()
    error = own["log_error"].to_numpy(dtype=np.float64)
    return own.assign(loss=log_losses(np.exp(error), np.isnan(error), np.exp(level), cost))


def _array(table: pd.DataFrame, methods: Sequence[AuditMethod], axes: Sequence[str]) -> FloatArray:
    """The column ``loss`` of a table as an array: the methods, then the ``axes`` in the order of their values."""
    place = pd.MultiIndex.from_tuples(methods).get_indexer(pd.MultiIndex.from_frame(table[_METHOD]))
    if lacking := {*range(len(methods))} - {*np.unique(place).tolist()}:
        raise KeyError(methods[min(lacking)].name)
    known = table[place >= 0]
    codes, values = zip(*(pd.factorize(known[axis], sort=True) for axis in axes), strict=True)
    array = np.full((len(methods), *map(len, values)), np.nan)
    array[place[place >= 0], *codes] = known["loss"]
    return array
