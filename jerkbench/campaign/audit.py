"""The runs of an audit, its rows and their files, and the rows as arrays of log errors."""

import hashlib
import json
from collections import Counter
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
    require_part,
)
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.drives_and_tunings import Losses, log_losses
from jerkbench.files import write_atomically, write_text
from jerkbench.jobs.executors import Cluster, Workers
from jerkbench.jobs.job import Job
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.jobs.manifest import MANIFEST
from jerkbench.jobs.progress import Progress
from jerkbench.notices import notify

METHOD_COLUMNS = ["filter", "adaptation"]
JUDGED = -1
"""The number of the tuning of drives that no tuning has used."""
TABLE_COLUMNS = {
    "drives": ("tuning", "seed", "level"),
    "tuned": (*METHOD_COLUMNS, "tuning", "trial", "drives", "lost", "loss"),
    "judged": (*METHOD_COLUMNS, "tuning", "tried", "trial", "seed", "status", "log_error"),
    "settings": (*METHOD_COLUMNS, "tuning", "tried", "knob", "value"),
}
"""Columns that each table must have. The last one is a number."""
TABLES = tuple(TABLE_COLUMNS)

_STATED = "protocol.json"
_FILES = (_STATED, *(f"{name}.parquet" for name in TABLES))
_TEXTS, _KEYS = (*METHOD_COLUMNS, "status", "knob"), (*METHOD_COLUMNS, "tuning", "tried", "trial", "seed")
_TYPES: dict[str, Any] = {
    **dict.fromkeys((*METHOD_COLUMNS, "status"), "category"),
    "tuning": np.int8,
    "trial": np.int16,
}
_ORIGIN = "Run `jerkbench audit` to its end; runs that are stored are not repeated."


@dataclass(frozen=True)
class AuditRows:
    """The rows of an audit. Each table is a file in its folder.

    Attributes:
        protocol: protocol of the audit.
        drives: one row for each drive: seed, tuning (-1: judged), level (log error of the first plain filter with its
            default setting), and the drawn quantities, in columns that start with ``drawn.``.
        tuned: one row for each setting of a tuning: filter, adaptation, tuning, trial, drives, lost, loss.
        judged: one row for each run on an unused drive: filter, adaptation, tuning, tried (number of settings of the
            search; 1: the default setting), trial, seed, status, log_error (NaN if the run failed).
        settings: one row for each parameter of a chosen setting: filter, adaptation, tuning, tried, knob, value.
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
        """Write each table to a file."""
        for name, table in self.tables.items():
            write_rows(table, folder / f"{name}.parquet")


def run_audit(protocol: AuditProtocol, folder: Path, cluster: Cluster, workers: int) -> None:
    """Compute the runs that are not stored in ``folder``, and write the rows and the manifest.

    Args:
        protocol: Protocol of the audit.
        folder: Folder of the audit.
        cluster: Where the runs are computed.
        workers: Number of processes, if the cluster starts them.

    Raises:
        JerkbenchError: The folder has the results of another protocol, or a run cannot be made.
        OSError: Nothing can be written.
    """
    made = {"protocol": protocol.digest, "code": code_digest(), "git_commit": git_commit(), "versions": versions()}
    if git_commit().endswith("+changes"):
        notify("the tree has changes that are not committed: nobody else can have this code, and the page says so")
    write_protocol(protocol, folder)
    with Workers(cluster, workers) as own:
        collected(protocol, CampaignRuns(folder / "runs", own)).write(folder)
    write_audit_manifest(folder, made)


def collected(protocol: AuditProtocol, runs: CampaignRuns) -> AuditRows:
    """Compute the runs that are not stored, and return the rows.

    Every setting runs on the drives to tune on. Then the default setting and the best setting of each search run on
    drives that no tuning has used.

    Raises:
        JerkbenchError: A plain filter failed, or a run cannot be made.
        OSError: Nothing can be stored.
    """
    methods = [*protocol.competing, *protocol.beside]
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
    wanted = {(tuning if trial else 0, AuditMethod(*names), trial) for tuning, *names, trial in found}  # default: once
    best = sorted(wanted | {(0, method, 0) for method in methods})
    judged = _run(protocol, runs, best, [protocol.judges(method) for _, method, _ in best], "Audit, judged unseen")
    levels = pd.concat([own[["seed", "level"]].drop_duplicates("seed") for own in (on_tuning, judged)])
    return AuditRows(protocol, _drives(protocol, levels), tuned, _of_picks(judged, picked), _settings(protocol, picked))


def _run(
    protocol: AuditProtocol,
    runs: CampaignRuns,
    tries: Sequence[tuple[int, AuditMethod, int]],
    seeds: Sequence[range],
    title: str,
) -> pd.DataFrame:
    """Compute settings (tuning, method, trial) that are not stored, each with its seeds.

    The level is the log error of the first plain filter with its default setting on a drive. A failed run costs
    ``lost_costs`` times the level.

    Returns:
        `METHOD_COLUMNS`, tuning, trial, seed, status, log_error, lost, level and loss.

    Raises:
        JerkbenchError: That filter failed, or has not run.
    """

    def jobs() -> Iterator[Job]:
        for (tuning, method, trial), draws in zip(tries, seeds, strict=True):
            job, space = protocol.jobs[method]
            yield replace(space.applied(job, protocol.settings_of(method, tuning)[trial]), draws=draws)

    with Progress(len(tries), doing=title, unit="settings") as bar:
        rows = runs.rows(jobs(), [POSITION_ERROR], bar)
    names = pd.DataFrame(
        [(*method, tuning, trial) for tuning, method, trial in tries], columns=[*METHOD_COLUMNS, "tuning", "trial"]
    )
    rows = names.iloc[rows.pop("place")].reset_index(drop=True).join(rows)
    with np.errstate(divide="ignore"):
        rows["log_error"] = np.log(rows.pop(POSITION_ERROR)).astype(np.float32)
    rows["status"] = rows["status"].mask(rows["status"] == "failed", "failed: " + rows["reason"])
    rows = rows.drop(columns=["reason", "run_s"]).astype(_TYPES)
    filter_, plain = protocol.plains[0]
    first = rows[(rows["filter"] == filter_) & (rows["adaptation"] == plain) & (rows["trial"] == 0)]
    levels = first[first["status"] == "ok"].drop_duplicates("seed").set_index("seed")["log_error"].astype(float)
    if missing := sorted(set(rows["seed"]) - set(levels.index)):
        raise JerkbenchError(
            f"On drive {missing[0]} {filter_} + {plain} failed with its default setting, or has not run, so that the"
            " cost of a failed run is unknown; make the faults milder, or run the audit to its end."
        )
    level, error = rows["seed"].map(levels).to_numpy(), rows["log_error"].to_numpy(dtype=float)
    lost = (rows["status"] != "ok").to_numpy() | ~np.isfinite(error)
    return rows.assign(lost=lost, level=level, loss=np.where(lost, level + np.log(protocol.lost_costs), error))


def picks(protocol: AuditProtocol, tuned: pd.DataFrame) -> pd.DataFrame:
    """Return the result of each search: the trial with the lowest loss, of equal ones the first.

    Returns:
        filter, adaptation, tuning, tried (number of settings), trial, loss.
    """
    order = tuned.sort_values([*METHOD_COLUMNS, "tuning", "loss", "trial"], kind="stable")
    plain = pd.MultiIndex.from_frame(order[METHOD_COLUMNS].astype(str)).isin(protocol.plains)
    searches = [(protocol.trials, order[order["trial"] < protocol.trials]), (protocol.plain_trials, order[plain])]
    best = [own.drop_duplicates([*METHOD_COLUMNS, "tuning"]).assign(tried=tried) for tried, own in searches]
    return pd.concat(best, ignore_index=True)[[*METHOD_COLUMNS, "tuning", "tried", "trial", "loss"]]


def _of_picks(runs: pd.DataFrame, picked: pd.DataFrame) -> pd.DataFrame:
    """The runs of the chosen settings, and those of the default setting, which is run once for all tunings."""
    defaults = picked[picked["tuning"] == 0].drop_duplicates(METHOD_COLUMNS).assign(tried=1, trial=0)
    wanted = pd.concat([picked, defaults], ignore_index=True).drop(columns="loss")
    run_of = wanted["tuning"].where(wanted["trial"] > 0, 0)
    own = runs.rename(columns={"tuning": "run_of"}).drop(columns=["level", "loss"])
    rows = wanted.assign(run_of=run_of).merge(
        own.astype(dict.fromkeys(METHOD_COLUMNS, str)), on=[*METHOD_COLUMNS, "run_of", "trial"]
    )
    rows["log_error"] = rows["log_error"].where(~rows["lost"])
    return rows.drop(columns=["run_of", "lost"]).astype({"tuning": np.int8, "tried": np.int16, "trial": np.int16})


def _drives(protocol: AuditProtocol, levels: pd.DataFrame) -> pd.DataFrame:
    dataset: Any = plugins.create("dataset", dict(protocol.laws))
    drives = levels.sort_values("seed", ignore_index=True)
    tuning = (drives["seed"] - protocol.seeds_to_tune_on(0)[0]) // protocol.tune_drives
    drives.insert(1, "tuning", tuning.where(drives["seed"] < protocol.seeds_to_judge_on[0], JUDGED))
    return drives.join(pd.DataFrame([dataset.columns(seed) for seed in drives["seed"].tolist()]))


def _settings(protocol: AuditProtocol, picked: pd.DataFrame) -> pd.DataFrame:
    """One row for each parameter of each chosen setting."""
    rows: list[dict[str, object]] = []
    for *names, tuning, tried, trial, _ in picked.itertuples(index=False, name=None):
        method = AuditMethod(*names)
        values = zip(protocol.jobs[method][1].names, protocol.settings_of(method, tuning)[trial], strict=True)
        head = {**method._asdict(), "tuning": tuning, "tried": tried}
        rows += [{**head, "knob": name, "value": value} for name, value in values]
    return pd.DataFrame(rows)


def write_protocol(protocol: AuditProtocol, folder: Path) -> None:
    """Write the protocol and its digest, before anything runs.

    Raises:
        JerkbenchError: The folder has the results of another protocol.
    """
    path = folder / _STATED
    if path.exists() and (there := _stated(path)["digest"]) != protocol.digest:
        raise JerkbenchError(
            f"{folder} has an audit of another protocol ({there}; this one is {protocol.digest}); give another folder"
            " (--results), or delete it."
        )
    write_text(path, json.dumps({"digest": protocol.digest, **asdict(protocol)}, indent=1))


def _stated(path: Path) -> dict[str, Any]:
    return read_json(path, {"digest": (is_text, "a digest")}, _ORIGIN)


def write_audit_manifest(folder: Path, made: Mapping[str, object]) -> None:
    """Write what the rows were made with, the hashes of the other files, and the hash of the manifest itself."""
    write_text(folder / MANIFEST, _manifest_text({**made, "files": file_hashes(folder, _FILES)}))


def _manifest_text(content: Mapping[str, object]) -> str:
    digest = hashlib.sha256(json.dumps(content).encode()).hexdigest()
    return json.dumps({**content, "digest": digest}, indent=1) + "\n"


def read_audit_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of an audit.

    Raises:
        JerkbenchError: A file is missing, or was changed after it was made.
    """
    path = folder / MANIFEST
    tests = {
        "files": (is_mapping_of(is_text), "hashes by the names of the files"),
        "git_commit": (is_text, "a commit"),
    }
    manifest = read_json(path, {}, _ORIGIN)
    unsigned = {key: value for key, value in manifest.items() if key != "digest"}
    if read_file(path, lambda own: own.read_text(encoding="utf-8"), _ORIGIN) != _manifest_text(unsigned):
        raise JerkbenchError(
            f"{path} cannot be read: it was changed after it was made, or an earlier version made it. {_ORIGIN}"
        )
    manifest = read_json(path, tests, _ORIGIN)
    for name in _FILES:
        changed = read_file(folder / name, lambda file: changed_files(folder, manifest["files"], [file.name]), _ORIGIN)
        if changed:
            raise JerkbenchError(f"{folder}: {changed[0]} {_ORIGIN}")
    return manifest


def read_rows(folder: Path) -> AuditRows:
    """Return the rows of the audit in ``folder``.

    Raises:
        JerkbenchError: There is no audit, a file was changed after it was made, or rows are missing.
    """
    read_audit_manifest(folder)
    stated = _stated(folder / _STATED)
    digest = stated.pop("digest")
    protocol = audit_protocol(stated, folder / _STATED)
    if protocol.digest != digest:
        raise JerkbenchError(f"{folder / _STATED} says digest {digest}, but has {protocol.digest}; it was changed.")
    tables = {}
    for name, (*keys, number) in TABLE_COLUMNS.items():
        of_keys = {key: "text" if key in _TEXTS else "whole numbers" for key in keys}
        tables[name] = read_table(folder / f"{name}.parquet", {**of_keys, number: "numbers"}, _ORIGIN)
    rows = AuditRows(protocol, **tables)
    _require_complete(rows, folder)
    return rows


def _require_complete(rows: AuditRows, folder: Path) -> None:
    """Check that each row is there once, and that its number is finite unless the run failed.

    Raises:
        JerkbenchError: A row or a number is missing, or there too often.
    """
    protocol, methods = rows.protocol, [*rows.protocol.competing, *rows.protocol.beside]
    for name, table in rows.tables.items():
        number, has_value = TABLE_COLUMNS[name][-1], table["status"] == "ok" if name == "judged" else True
        fits = (np.isfinite(table[number]) == has_value).all()
        expected = f"column '{number}' must be finite, except in runs that diverged or failed"
        require_part(folder / f"{name}.parquet", fits, expected, _ORIGIN)
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
    for key, own in rows.settings.groupby([*METHOD_COLUMNS, "knob"], observed=True):
        *names, knob = map(str, key)
        fits = len(own) == len(own.drop_duplicates(["tuning", "tried"])) == searches[AuditMethod(*names)]
        expected = f"the value of {knob} of {', '.join(names)} must be there once for each search"
        require_part(folder / "settings.parquet", fits, expected, _ORIGIN)


def _require_once(
    folder: Path, name: str, table: pd.DataFrame, each: str, wanted: Mapping[tuple[Any, ...], range]
) -> None:
    """Check that the column ``each`` has each value once in each wanted group, and that no other group exists."""
    by = [column for column in TABLE_COLUMNS[name] if column in _KEYS and column != each]
    found = table.groupby(by, observed=True)[each].agg(["size", "nunique", "min", "max"]).reset_index()
    groups = {tuple(own[: len(by)]): own[len(by) :] for own in found.itertuples(index=False, name=None)}
    for key in {**wanted, **groups}:
        own = wanted.get(key, range(0))
        fits = bool(own) and groups.get(key) == (len(own), len(own), own[0], own[-1])
        expected = f"the rows of {', '.join(map(str, key))} must be there once for each {each}, and no others"
        require_part(folder / f"{name}.parquet", fits, expected, _ORIGIN)


def write_rows(rows: pd.DataFrame, path: Path) -> None:
    """Write rows as Parquet. Texts are coded, and the bytes of numbers are split, which compresses better."""
    coded = rows.astype({name: "category" for name in (*METHOD_COLUMNS, "status") if name in rows})
    floats = [name for name in rows if pd.api.types.is_float_dtype(rows[name].dtype)]
    options: dict[str, Any] = {
        "compression": "zstd",
        "use_dictionary": [name for name in rows if name not in floats],
        "column_encoding": dict.fromkeys(floats, "BYTE_STREAM_SPLIT"),
    }
    write_atomically(path, lambda partial: coded.to_parquet(partial, index=False, **options))


class Cubes(NamedTuple):
    """Log errors of some methods.

    Attributes:
        tuned: (M, R, D) tuned, on the drives to judge on.
        on_tuning: (M, R) of the chosen settings, on the drives to tune on.
    """

    tuned: FloatArray
    on_tuning: FloatArray


def cubes(rows: AuditRows, methods: Sequence[AuditMethod], tried: int = 0, cost: float = 0.0) -> Cubes:
    """Return the log errors of ``methods``, all of which have the same number of tunings and drives.

    Args:
        rows: Rows of the audit.
        methods: The methods, in order.
        tried: Number of settings of a search; default: that of the methods.
        cost: Cost of a failed run; default: that of the protocol. It changes the losses on the drives to judge on, not
            the choice of the search.
    """
    protocol, tried = rows.protocol, tried or rows.protocol.trials
    found = picks(protocol, rows.tuned)
    return Cubes(
        _array(_with_losses(rows, tried, cost or protocol.lost_costs), methods, ["tuning", "seed"]),
        _array(found[found["tried"] == tried], methods, ["tuning"]),
    )


def defaults(rows: AuditRows, methods: Sequence[AuditMethod]) -> FloatArray:
    """Return the log errors (M, D) of ``methods`` with their default settings."""
    return _array(_with_losses(rows, 1, rows.protocol.lost_costs), methods, ["seed"])


def losses_of(rows: AuditRows, cost: float = 0.0) -> Losses:
    """Return the log errors of all methods that are compared, with a ``cost`` of a failed run as in `cubes`."""
    protocol = rows.protocol
    methods, plains = (cubes(rows, own, 0, cost) for own in (protocol.methods, protocol.plains))
    wide = cubes(rows, protocol.plains, protocol.plain_trials, cost)
    published = np.array([protocol.adaptations[method.adaptation] in PUBLISHED for method in protocol.methods])
    model = np.array([protocol.filters.index(method.filter) for method in protocol.methods])
    of_tuning = methods.on_tuning, plains.on_tuning, wide.on_tuning
    return Losses(methods.tuned, plains.tuned, wide.tuned, *of_tuning, model, published, published)


def failure_rates(rows: AuditRows, methods: Sequence[AuditMethod]) -> FloatArray:
    """Return the fraction of the runs of each tuned method that failed."""
    own = rows.judged[rows.judged["tried"] == rows.protocol.trials]
    rates = own["log_error"].isna().groupby([own[name] for name in METHOD_COLUMNS], observed=True).mean()
    return np.asarray(rates.loc[list(methods)], dtype=np.float64)


def _with_losses(rows: AuditRows, tried: int, cost: float) -> pd.DataFrame:
    own = rows.judged[rows.judged["tried"] == tried]
    level = own["seed"].map(rows.drives.set_index("seed")["level"]).to_numpy()
    error = own["log_error"].to_numpy(dtype=np.float64)
    return own.assign(loss=log_losses(np.exp(error), np.isnan(error), np.exp(level), cost))


def _array(table: pd.DataFrame, methods: Sequence[AuditMethod], axes: Sequence[str]) -> FloatArray:
    """The column ``loss`` of a table as an array: the methods, then the ``axes`` in the order of their values."""
    place = pd.MultiIndex.from_tuples(methods).get_indexer(pd.MultiIndex.from_frame(table[METHOD_COLUMNS]))
    if lacking := {*range(len(methods))} - {*np.unique(place).tolist()}:
        raise KeyError(methods[min(lacking)].name)
    known = table[place >= 0]
    codes, values = zip(*(pd.factorize(known[axis], sort=True) for axis in axes), strict=True)
    array = np.full((len(methods), *map(len, values)), np.nan)
    array[place[place >= 0], *codes] = known["loss"]
    return array
