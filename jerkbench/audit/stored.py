"""What an audit leaves: a few files of rows from which every number of its page follows."""

import dataclasses
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.audit.campaign import METHOD, Campaign, picks, trials_of, tuning_losses
from jerkbench.audit.pieces import method_and_space, write_rows
from jerkbench.audit.protocol import AuditMethod, AuditProtocol, audit_protocol
from jerkbench.errors import JerkbenchError
from jerkbench.files import write_text

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
    """Return the rows of a campaign at its end."""
    protocol, on_tuning, judged = campaign.protocol, campaign.on_tuning(), campaign.judged()
    settings = tuning_losses(on_tuning)
    picked = picks(protocol, settings)
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
    _, space = method_and_space(protocol.dataset, method)
    trial = trials_of(protocol, method, picked.tuning)[picked.trial]
    for knob, value in zip(space.names, trial.setting, strict=True):
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
