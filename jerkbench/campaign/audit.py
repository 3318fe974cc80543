"""Computation of the runs of an audit, storage of their rows in files, and conversion of the rows to arrays."""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.arrays import FloatArray
from jerkbench.campaign.protocol import PUBLISHED, AuditMethod, AuditProtocol, audit_protocol
from jerkbench.campaign.runs import POSITION_ERROR, CampaignRuns
from jerkbench.campaign.stored_files import (
    changed_files,
    file_hashes,
    is_mapping_of,
    is_text,
    read_file,
    read_json,
    read_table,
)
from jerkbench.errors import JerkbenchError, notify
from jerkbench.evaluation.drives_and_tunings import Losses, log_losses
from jerkbench.files import write_atomically, write_text
from jerkbench.jobs.executors import Cluster, Workers
from jerkbench.jobs.job import Job
from jerkbench.jobs.key import MANIFEST, code_digest, git_commit, versions
from jerkbench.jobs.progress import Progress

METHOD_COLUMNS = ["filter", "adaptation"]
JUDGED = -1
"""Value of the column ``tuning`` for the evaluation drives, which no tuning has used."""
TABLE_COLUMNS = {
    "drives": ("tuning", "seed", "level"),
    "tuned": (*METHOD_COLUMNS, "tuning", "trial", "drives", "lost", "loss"),
    "judged": (*METHOD_COLUMNS, "tuning", "tried", "trial", "seed", "status", "log_error"),
    "settings": (*METHOD_COLUMNS, "tuning", "tried", "knob", "value"),
}
"""Columns that each table must have. The last column of each table contains floating point numbers."""

_STATED = "protocol.json"
_FILES = (_STATED, *(f"{name}.parquet" for name in TABLE_COLUMNS))
_TEXTS = (*METHOD_COLUMNS, "status", "knob")
_TYPES: Any = {**dict.fromkeys((*METHOD_COLUMNS, "status"), "category"), "tuning": np.int8, "trial": np.int16}
_ORIGIN = "Run `jerkbench audit` to its end; runs that are stored are not repeated."


@dataclass(frozen=True)
class AuditRows:
    """The results of the runs of an audit, as four tables. Each table is stored in a separate Parquet file.

    Attributes:
        protocol: The protocol of the audit.
        drives: Table with one row for each simulated drive. The column ``tuning`` is the number of the tuning that uses
            the drive, or -1 for an evaluation drive. The column ``level`` is the log error of the first plain filter
            with its default setting on the drive. Columns that start with ``drawn.`` contain the random quantities of
            the drive.
        tuned: Table with one row for each setting that a tuning evaluates. The column ``drives`` is the number of runs,
            ``lost`` is the number of failed runs, and ``loss`` is the mean log error.
        judged: Table with one row for each run on an evaluation drive. The column ``tried`` is the number of settings
            that the search evaluated, or 1 for the default setting. The column ``log_error`` is NaN if the run failed.
        settings: Table with one row for each parameter of a selected setting. The columns ``knob`` and ``value``
            contain the name and the value of the parameter.
    """

    protocol: AuditProtocol
    drives: pd.DataFrame
    tuned: pd.DataFrame
    judged: pd.DataFrame
    settings: pd.DataFrame

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The four tables of the audit by name."""
        return {name: getattr(self, name) for name in TABLE_COLUMNS}

    def write(self, folder: Path) -> None:
        """Write each table to a Parquet file in ``folder``."""
        for name, table in self.tables.items():
            write_rows(table, folder / f"{name}.parquet")


def run_audit(protocol: AuditProtocol, folder: Path, cluster: Cluster, workers: int) -> None:
    """Compute all runs of an audit that are not yet stored in ``folder``, and write the tables and the manifest.

    Args:
        protocol: Protocol of the audit.
        folder: Folder in which the audit is stored.
        cluster: The cluster that computes the runs.
        workers: Number of worker processes, for clusters that start local processes.

    Raises:
        JerkbenchError: The folder contains the results of another protocol, or a run cannot be computed.
        OSError: The results cannot be written.
    """
    made = {"protocol": protocol.digest, "code": code_digest(), "git_commit": git_commit(), "versions": versions()}
    if git_commit().endswith("+changes"):
        notify("the checkout has uncommitted changes, so this audit cannot be reproduced; its manifest states this")
    write_protocol(protocol, folder)
    with Workers(cluster, workers) as executor:
        collected(protocol, CampaignRuns(folder / "runs", executor)).write(folder)
    write_audit_manifest(folder, made)


def collected(protocol: AuditProtocol, runs: CampaignRuns) -> AuditRows:
    """Compute all runs of an audit that are not yet stored, and return the tables with all runs.

    First, each method runs with every candidate setting on the tuning drives. Afterwards, each method runs on the
    evaluation drives, which no tuning has used, with its default setting and with the best setting of each search.

    Raises:
        JerkbenchError: The first plain filter failed on a drive, or a run cannot be computed.
        OSError: The results cannot be written.
    """
    methods = [*protocol.competing, *protocol.separate]
    tries = [
        (tuning, method, trial)
        for tuning in range(protocol.tunings)
        for method in methods
        if tuning in protocol.tunings_of(method)
        for trial in range(len(protocol.settings_of(method, tuning)))
    ]
    seeds = [protocol.seeds_to_tune_on(tuning) for tuning, *_ in tries]
    on_tuning = _run(protocol, runs, tries, seeds, "Audit, settings tried")
    of_setting = on_tuning.groupby([*METHOD_COLUMNS, "tuning", "trial"], observed=True, sort=True)
    tuned = of_setting.agg(drives=("seed", "size"), lost=("lost", "sum"), loss=("loss", "mean")).reset_index()
    picked = picks(protocol, tuned)
    found = picked[["tuning", *METHOD_COLUMNS, "trial"]].itertuples(index=False, name=None)
    # The default setting is the same in all tunings, so it runs only once, as tuning 0.
    wanted = {(tuning if trial else 0, AuditMethod(*names), trial) for tuning, *names, trial in found}
    best = sorted(wanted | {(0, method, 0) for method in methods})
    judged = _run(protocol, runs, best, [protocol.judges(method) for _, method, _ in best], "Audit, judged unseen")
    levels = pd.concat([rows[["seed", "level"]].drop_duplicates("seed") for rows in (on_tuning, judged)])
    return AuditRows(protocol, _drives(protocol, levels), tuned, _of_picks(judged, picked), _settings(protocol, picked))


Try = tuple[int, AuditMethod, int]
"""The number of a tuning, a method, and the number of a setting."""


def _run(
    protocol: AuditProtocol, runs: CampaignRuns, tries: Sequence[Try], seeds: Sequence[range], title: str
) -> pd.DataFrame:
    """Compute the runs that are not yet stored, and return one row for each run of each setting.

    The level of a drive is the log error of the first plain filter with its default setting. The loss of a failed run
    is the level of the drive plus log(``lost_costs``).

    Raises:
        JerkbenchError: With its default setting, the first plain filter failed or did not run on a drive.
    """

    def jobs() -> Iterator[Job]:
        for (tuning, method, trial), draws in zip(tries, seeds, strict=True):
            job, space = protocol.jobs[method]
            yield replace(space.applied(job, protocol.settings_of(method, tuning)[trial]), draws=draws)

    with Progress(len(tries), doing=title, unit="settings") as bar:
        rows = runs.rows(jobs(), [POSITION_ERROR], bar)
    settings = [(*method, tuning, trial) for tuning, method, trial in tries]
    names = pd.DataFrame(settings, columns=[*METHOD_COLUMNS, "tuning", "trial"])
    rows = names.iloc[rows.pop("job_index")].reset_index(drop=True).join(rows)
    with np.errstate(divide="ignore"):
        rows["log_error"] = np.log(rows.pop(POSITION_ERROR)).astype(np.float32)
    rows["status"] = rows["status"].mask(rows["status"] == "failed", "failed: " + rows["reason"])
    rows = rows.drop(columns=["reason", "run_s"]).astype(_TYPES)
    filter_, plain = protocol.plains[0]
    first = rows[(rows["filter"] == filter_) & (rows["adaptation"] == plain) & (rows["trial"] == 0)]
    levels = first[first["status"] == "ok"].drop_duplicates("seed").set_index("seed")["log_error"].astype(float)
    if missing := sorted(set(rows["seed"]) - set(levels.index)):
        run = f"{filter_} + {plain} on drive {missing[0]} with its default setting"
        raise JerkbenchError(f"The run of {run} failed or is missing. Make the faults milder, or finish the audit.")
    level, error = rows["seed"].map(levels).to_numpy(), rows["log_error"].to_numpy(dtype=float)
    diverged = (rows["status"] != "ok").to_numpy() | ~np.isfinite(error)
    return rows.assign(lost=diverged, level=level, loss=np.where(diverged, level + np.log(protocol.lost_costs), error))


def picks(protocol: AuditProtocol, tuned: pd.DataFrame) -> pd.DataFrame:
    """Return the trial with the lowest loss in each search.

    Of several trials with equal losses, return the first trial.

    Returns:
        A table with the columns filter, adaptation, tuning, tried (number of settings that the search evaluated), trial
        and loss.
    """
    order = tuned.sort_values([*METHOD_COLUMNS, "tuning", "loss", "trial"], kind="stable")
    plain = pd.MultiIndex.from_frame(order[METHOD_COLUMNS].astype(str)).isin(protocol.plains)
    searches = [(protocol.trials, order[order["trial"] < protocol.trials]), (protocol.plain_trials, order[plain])]
    best = [
        candidates.drop_duplicates([*METHOD_COLUMNS, "tuning"]).assign(tried=tried) for tried, candidates in searches
    ]
    return pd.concat(best, ignore_index=True)[[*METHOD_COLUMNS, "tuning", "tried", "trial", "loss"]]


def _of_picks(runs: pd.DataFrame, picked: pd.DataFrame) -> pd.DataFrame:
    """Return the runs of the selected settings, and the runs of the default settings, which all tunings share."""
    defaults = picked[picked["tuning"] == 0].drop_duplicates(METHOD_COLUMNS).assign(tried=1, trial=0)
    wanted = pd.concat([picked, defaults], ignore_index=True).drop(columns="loss")
    run_of = wanted["tuning"].where(wanted["trial"] > 0, 0)
    renamed = runs.rename(columns={"tuning": "run_of"}).drop(columns=["level", "loss"])
    renamed = renamed.astype(dict.fromkeys(METHOD_COLUMNS, str))
    rows = wanted.assign(run_of=run_of).merge(renamed, on=[*METHOD_COLUMNS, "run_of", "trial"])
    rows["log_error"] = rows["log_error"].where(~rows["lost"])
    return rows.drop(columns=["run_of", "lost"]).astype({"tuning": np.int8, "tried": np.int16, "trial": np.int16})


def _drives(protocol: AuditProtocol, levels: pd.DataFrame) -> pd.DataFrame:
    dataset: Any = plugins.create("dataset", dict(protocol.laws))
    drives = levels.sort_values("seed", ignore_index=True)
    tuning = (drives["seed"] - protocol.seeds_to_tune_on(0)[0]) // protocol.tune_drives
    drives.insert(1, "tuning", tuning.where(drives["seed"] < protocol.seeds_to_judge_on[0], JUDGED))
    return drives.join(pd.DataFrame([dataset.columns(seed) for seed in drives["seed"].tolist()]))


def _settings(protocol: AuditProtocol, picked: pd.DataFrame) -> pd.DataFrame:
    rows: list[dict[str, object]] = []
    for *names, tuning, tried, trial, _ in picked.itertuples(index=False, name=None):
        method = AuditMethod(*names)
        values = zip(protocol.jobs[method][1].names, protocol.settings_of(method, tuning)[trial], strict=True)
        head = {**method._asdict(), "tuning": tuning, "tried": tried}
        rows += [{**head, "knob": name, "value": value} for name, value in values]
    return pd.DataFrame(rows)


def write_protocol(protocol: AuditProtocol, folder: Path) -> None:
    """Write the protocol of an audit and its digest to ``folder``, before the first run.

    Raises:
        JerkbenchError: The folder contains the results of another protocol.
    """
    path = folder / _STATED
    if path.exists() and (there := _stated(path)["digest"]) != protocol.digest:
        digests = f"its digest is {there}, and the digest of this protocol is {protocol.digest}"
        raise JerkbenchError(f"{folder} is an audit of another protocol: {digests}. Delete {folder} or set --results.")
    write_text(path, json.dumps({"digest": protocol.digest, **asdict(protocol)}, indent=1))


def _stated(path: Path) -> dict[str, Any]:
    return read_json(path, {"digest": (is_text, "a digest")}, _ORIGIN)


def write_audit_manifest(folder: Path, made: Mapping[str, object]) -> None:
    """Write the manifest, with the provenance ``made`` of the rows, hashes of the files, and a hash of the manifest."""
    write_text(folder / MANIFEST, _manifest_text({**made, "files": file_hashes(folder, _FILES)}))


def _manifest_text(content: Mapping[str, object]) -> str:
    digest = hashlib.sha256(json.dumps(content).encode()).hexdigest()
    return json.dumps({**content, "digest": digest}, indent=1) + "\n"


def read_audit_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest of an audit, and verify the hashes of all files that it lists.

    Raises:
        JerkbenchError: A file is missing, or was changed after it was written.
    """
    path = folder / MANIFEST
    tests = {"files": (is_mapping_of(is_text), "hashes by names of files"), "git_commit": (is_text, "a commit")}
    manifest = read_json(path, {}, _ORIGIN)
    unsigned = {key: value for key, value in manifest.items() if key != "digest"}
    if read_file(path, lambda source: source.read_text(encoding="utf-8"), _ORIGIN) != _manifest_text(unsigned):
        changed = "the file was changed after the audit, or an earlier version of jerkbench wrote the file"
        raise JerkbenchError(f"{path} cannot be read: {changed}. {_ORIGIN}")
    manifest = read_json(path, tests, _ORIGIN)
    for name in _FILES:
        changed = read_file(folder / name, lambda file: changed_files(folder, manifest["files"], [file.name]), _ORIGIN)
        if changed:
            raise JerkbenchError(f"{folder}: {changed[0]} {_ORIGIN}")
    return manifest


def read_rows(folder: Path) -> AuditRows:
    """Read the tables of the audit in ``folder``, and check that they are unchanged.

    Raises:
        JerkbenchError: The folder contains no audit, a file was changed after it was written, or rows are missing.
    """
    read_audit_manifest(folder)
    stated = _stated(folder / _STATED)
    digest = stated.pop("digest")
    protocol = audit_protocol(stated, folder / _STATED)
    if protocol.digest != digest:
        raise JerkbenchError(f"{folder / _STATED} was changed: its digest is {protocol.digest} instead of {digest}.")
    tables = {}
    for name, (*keys, number) in TABLE_COLUMNS.items():
        of_keys = {key: "text" if key in _TEXTS else "whole numbers" for key in keys}
        tables[name] = read_table(folder / f"{name}.parquet", {**of_keys, number: "numbers"}, _ORIGIN)
    return AuditRows(protocol, **tables)


def write_rows(rows: pd.DataFrame, path: Path) -> None:
    """Write a table to a Parquet file, with encodings of text and floating point numbers that make the file small."""
    coded = rows.astype({name: "category" for name in (*METHOD_COLUMNS, "status") if name in rows})
    floats = [name for name in rows if pd.api.types.is_float_dtype(rows[name].dtype)]
    options: dict[str, Any] = {
        "compression": "zstd",
        "use_dictionary": [name for name in rows if name not in floats],
        "column_encoding": dict.fromkeys(floats, "BYTE_STREAM_SPLIT"),
    }
    write_atomically(path, lambda partial: coded.to_parquet(partial, index=False, **options))


class Cubes(NamedTuple):
    """Log errors of M methods as arrays, for R tunings and D evaluation drives.

    Attributes:
        tuned: (M, R, D) log errors of the tuned methods on the evaluation drives.
        on_tuning: (M, R) mean log errors of the selected settings on the tuning drives.
    """

    tuned: FloatArray
    on_tuning: FloatArray


def cubes(rows: AuditRows, methods: Sequence[AuditMethod], tried: int = 0, cost: float = 0.0) -> Cubes:
    """Return the log errors of ``methods``, which must all have the same number of tunings and drives.

    Args:
        rows: The tables of the audit.
        methods: The methods, in the order of the first axis of the arrays.
        tried: Number of settings that each search evaluates (by default, ``trials`` of the protocol).
        cost: Factor by which the error of the first plain filter is multiplied to obtain the error of a failed run (by
            default, ``lost_costs`` of the protocol). The cost changes the losses on the evaluation drives, but not the
            settings that the searches have selected.
    """
    protocol, tried = rows.protocol, tried or rows.protocol.trials
    found = picks(protocol, rows.tuned)
    return Cubes(
        _array(_with_losses(rows, tried, cost or protocol.lost_costs), methods, ["tuning", "seed"]),
        _array(found[found["tried"] == tried], methods, ["tuning"]),
    )


def defaults(rows: AuditRows, methods: Sequence[AuditMethod]) -> FloatArray:
    """Return the (M, D) log errors of M methods with their default settings on D evaluation drives."""
    return _array(_with_losses(rows, 1, rows.protocol.lost_costs), methods, ["seed"])


def losses_of(rows: AuditRows, cost: float = 0.0) -> Losses:
    """Return the log errors of all compared methods and of the plain filters.

    Args:
        rows: The tables of the audit.
        cost: The cost of a failed run, as in `cubes`.
    """
    protocol = rows.protocol
    methods, plains = (cubes(rows, group, 0, cost) for group in (protocol.methods, protocol.plains))
    wide = cubes(rows, protocol.plains, protocol.plain_trials, cost)
    published = np.array([protocol.adaptations[method.adaptation] in PUBLISHED for method in protocol.methods])
    model = np.array([protocol.filters.index(method.filter) for method in protocol.methods])
    of_tuning = methods.on_tuning, plains.on_tuning, wide.on_tuning
    return Losses(methods.tuned, plains.tuned, wide.tuned, *of_tuning, model, published, published)


def failure_rates(rows: AuditRows, methods: Sequence[AuditMethod]) -> FloatArray:
    """Return the fraction of failed runs of each tuned method on the evaluation drives."""
    runs = rows.judged[rows.judged["tried"] == rows.protocol.trials]
    rates = runs["log_error"].isna().groupby([runs[name] for name in METHOD_COLUMNS], observed=True).mean()
    return np.asarray(rates.loc[list(methods)], dtype=np.float64)


def _with_losses(rows: AuditRows, tried: int, cost: float) -> pd.DataFrame:
    runs = rows.judged[rows.judged["tried"] == tried]
    level = runs["seed"].map(rows.drives.set_index("seed")["level"]).to_numpy()
    error = runs["log_error"].to_numpy(dtype=np.float64)
    return runs.assign(loss=log_losses(np.exp(error), np.isnan(error), np.exp(level), cost))


def _array(table: pd.DataFrame, methods: Sequence[AuditMethod], axes: Sequence[str]) -> FloatArray:
    """Return the column ``loss`` as an array with one axis for the methods and one axis for each column in ``axes``."""
    position = pd.MultiIndex.from_tuples(methods).get_indexer(pd.MultiIndex.from_frame(table[METHOD_COLUMNS]))
    if lacking := {*range(len(methods))} - {*np.unique(position).tolist()}:
        raise KeyError(methods[min(lacking)].name)
    known = table[position >= 0]
    codes, values = zip(*(pd.factorize(known[axis], sort=True) for axis in axes), strict=True)
    array = np.full((len(methods), *map(len, values)), np.nan)
    array[position[position >= 0], *codes] = known["loss"]
    return array
