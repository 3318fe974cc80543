"""The campaign of an audit: every setting on the drives to tune on, then the best of each tuning on unseen drives."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import pandas as pd

from jerkbench.audit.protocol import AuditMethod, AuditProtocol
from jerkbench.errors import JerkbenchError
from jerkbench.jobs.progress import Progress
from jerkbench.tuning.entrant import RunRules, Site, Try, tried_settings
from jerkbench.tuning.space import Setting

METHOD = ["filter", "adaptation"]
ERROR = "position_rmse_m"
"""The column that counts."""
TYPES: dict[str, Any] = {**dict.fromkeys((*METHOD, "status"), "category"), "tuning": np.int8, "trial": np.int16}
RULES = RunRules(("position_rmse",), numbers=(ERROR,))


@dataclass(frozen=True)
class Campaign:
    """The runs of an audit, which go on where they were stopped.

    Attributes:
        protocol: what is compared.
        site: where its runs are stored, and who runs them.
    """

    protocol: AuditProtocol
    site: Site

    def on_tuning(self, methods: Sequence[AuditMethod]) -> pd.DataFrame:
        """Run every setting of ``methods`` on the drives of its tuning; returns the runs.

        Raises:
            JerkbenchError: a plain filter was lost, or a run cannot be made.
            OSError: nothing can be stored.
        """
        tries = [
            Try(tuning, self.protocol.drives, method.entrant, setting, trial, self.protocol.seeds_to_tune_on(tuning))
            for tuning in range(self.protocol.tunings)
            for method in methods
            if tuning in self.protocol.tunings_of(method)
            for trial, setting in enumerate(settings_of(self.protocol, method, tuning))
        ]
        return self._run(tries, "Audit, settings tried")

    def judged(self, methods: Sequence[AuditMethod], picked: pd.DataFrame) -> pd.DataFrame:
        """Run the defaults of ``methods``, and what each search has ``picked``, on unseen drives; returns the runs."""
        found = picked[["tuning", *METHOD, "trial"]].itertuples(index=False, name=None)
        wanted = {(tuning if trial else 0, *names, trial) for tuning, *names, trial in found}  # the defaults run once
        wanted |= {(0, *method, 0) for method in methods}
        tries = []
        for tuning, *names, trial in sorted(wanted):
            method, drives = AuditMethod(*names), self.protocol.drives
            setting = settings_of(self.protocol, method, tuning)[trial]
            tries.append(Try(tuning, drives, method.entrant, setting, trial, self.protocol.judges(method)))
        return self._run(tries, "Audit, judged unseen")

    def _run(self, tries: Sequence[Try], title: str) -> pd.DataFrame:
        """Run what is not stored; returns `METHOD`, tuning, trial, seed, status, log_error, lost, level and loss."""
        with Progress(len(tries), doing=title, unit="settings") as bar:
            rows = self.site.rows(tries, RULES, bar)
        with np.errstate(divide="ignore"):
            rows["log_error"] = np.log(rows.pop(ERROR)).astype(np.float32)
        failed = rows["status"] == "failed"
        rows["status"] = rows["status"].mask(failed, "failed: " + rows["reason"])
        runs = rows.drop(columns=["reason", "seconds"]).rename(columns={"scenario": "tuning"}).astype(TYPES)
        return with_losses(self.protocol, runs)


def settings_of(protocol: AuditProtocol, method: AuditMethod, tuning: int) -> tuple[Setting, ...]:
    """Return the settings that a tuning tries of a method, its defaults first; a longer search begins as a shorter."""
    count, scramble = max(protocol.searches(method)), protocol.seeds_to_tune_on(tuning)[0]
    return _settings(count, protocol.spaces[method], scramble)


_settings = lru_cache(maxsize=8192)(tried_settings)


def with_losses(protocol: AuditProtocol, runs: pd.DataFrame) -> pd.DataFrame:
    """Return runs with ``lost``, the ``level`` of their drive, and their ``loss``.

    The level is the log error of the first plain filter at its defaults; a lost run costs ``lost_costs`` of it.

    Raises:
        JerkbenchError: that filter was lost itself, or has not run.
    """
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


def tuning_losses(runs: pd.DataFrame) -> pd.DataFrame:
    """Return each setting of a tuning, from its runs: filter, adaptation, tuning, trial, drives, lost, mean loss."""
    settings = runs.groupby([*METHOD, "tuning", "trial"], observed=True, sort=True)
    return settings.agg(drives=("seed", "size"), lost=("lost", "sum"), loss=("loss", "mean")).reset_index()


def picks(protocol: AuditProtocol, tuned: pd.DataFrame) -> pd.DataFrame:
    """Return what each search has found: the trial with the lowest loss, of equals the first.

    Returns:
        filter, adaptation, tuning, tried (how many settings), trial, loss.
    """
    found = [_lowest(tuned[tuned["trial"] < protocol.trials], protocol.trials)]
    plain = pd.MultiIndex.from_frame(tuned[METHOD].astype(str)).isin(protocol.plains)
    return pd.concat([*found, _lowest(tuned[plain], protocol.plain_trials)], ignore_index=True)


def _lowest(tuned: pd.DataFrame, tried: int) -> pd.DataFrame:
    """Of each tuning of each method; those of equal losses are sorted by their trials."""
    order = tuned.sort_values([*METHOD, "tuning", "loss", "trial"], kind="stable")
    first = order.drop_duplicates([*METHOD, "tuning"])
    return first.assign(tried=tried)[[*METHOD, "tuning", "tried", "trial", "loss"]]
