"""The campaign of an audit: every setting on the drives to tune on, then the best of each tuning on unseen drives."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import pandas as pd

from jerkbench.audit.pieces import Piece, RunLedger, Trial, drive_blocks, method_and_space, run_piece
from jerkbench.audit.protocol import AuditMethod, AuditProtocol
from jerkbench.campaigns.entrant import tried_settings
from jerkbench.errors import JerkbenchError
from jerkbench.jobs.cluster import Workers
from jerkbench.jobs.dispatch import Order, outcomes
from jerkbench.jobs.identity import Identity, identity_of
from jerkbench.jobs.progress import Progress

METHOD = ["filter", "adaptation"]


@dataclass(frozen=True)
class Campaign:
    """The runs of an audit, which go on where they were stopped.

    Attributes:
        protocol: what is compared.
        ledger: where runs are kept.
        workers: who runs them.
    """

    protocol: AuditProtocol
    ledger: RunLedger
    workers: Workers

    def run(self, methods: Sequence[AuditMethod], title: str) -> None:
        """Tune ``methods`` and judge them, as far as it is not done yet.

        Raises:
            JerkbenchError: a plain filter was lost, or a run cannot be made.
            OSError: nothing can be stored.
        """
        self._run(self._to_tune(methods), f"{title}, settings tried")
        found = picks(self.protocol, tuning_losses(self.on_tuning()))
        self._run(self._to_judge(methods, found), f"{title}, judged unseen")

    def on_tuning(self) -> pd.DataFrame:
        """Return the runs on the drives of all tunings, with their losses."""
        first, last = self.protocol.seeds_to_tune_on(0)[0], self.protocol.seeds_to_judge_on[0]
        return with_losses(self.protocol, self.ledger.runs(range(first, last)))

    def judged(self) -> pd.DataFrame:
        """Return the runs on unseen drives, with their losses."""
        return with_losses(self.protocol, self.ledger.runs(self.protocol.seeds_to_judge_on))

    def _to_tune(self, methods: Sequence[AuditMethod]) -> Iterator[list[Piece]]:
        """All methods on one block of drives, block after block: the drives of a block are made once."""
        for tuning in range(self.protocol.tunings):
            seeds = self.protocol.seeds_to_tune_on(tuning)
            own = {m: trials_of(self.protocol, m, tuning) for m in methods if tuning in self.protocol.tunings_of(m)}
            for block in drive_blocks(seeds):
                yield [Piece(self.protocol.dataset, method, trials, block) for method, trials in own.items()]

    def _to_judge(self, methods: Sequence[AuditMethod], picked: pd.DataFrame) -> Iterator[list[Piece]]:
        of_method = dict(iter(picked.groupby(METHOD, observed=True)))
        own = {method: self._trials(method, of_method[method]) for method in methods}
        for block in drive_blocks(self.protocol.seeds_to_judge_on):
            wanted = {method: [seed for seed in block if seed in self.protocol.judges(method)] for method in methods}
            yield [
                Piece(self.protocol.dataset, method, own[method], range(seeds[0], seeds[-1] + 1))
                for method, seeds in wanted.items()
                if seeds
            ]

    def _trials(self, method: AuditMethod, picked: pd.DataFrame) -> tuple[Trial, ...]:
        """The defaults, and what each search of a method has found."""
        wanted = {(0, 0), *zip(picked["tuning"], picked["trial"], strict=True)}
        tried = {tuning: trials_of(self.protocol, method, tuning) for tuning in self.protocol.tunings_of(method)}
        return tuple(tried[tuning][trial] for tuning, trial in sorted(wanted))

    def _run(self, groups: Iterable[list[Piece]], title: str) -> None:
        planned = list(groups)
        done = self.ledger.keys({piece.seeds[0] for pieces in planned for piece in pieces})
        left = [own for pieces in planned if (own := [piece for piece in pieces if piece.key not in done])]
        count, missing = sum(map(len, planned)), sum(map(len, left))
        order = Order(work=run_piece, groups=left, identity=cache(partial(self._identity, left)))
        lent = self.workers.lent(missing) if missing else None
        with Progress(count, count - missing, doing=title, unit="pieces") as bar:
            try:
                for _, runs in outcomes(order, lent):
                    if isinstance(runs, Exception):
                        raise runs
                    self.ledger.add(runs)
                    bar.advance()
            finally:
                self.ledger.flush()

    def _identity(self, groups: Sequence[Sequence[Piece]]) -> Identity:
        methods = {piece.method for pieces in groups for piece in pieces}
        return identity_of(method_and_space(self.protocol.dataset, method)[0] for method in methods)


def trials_of(protocol: AuditProtocol, method: AuditMethod, tuning: int) -> tuple[Trial, ...]:
    """Return the settings that a tuning tries of a method, its defaults first; a longer search begins as a shorter."""
    _, space = method_and_space(protocol.dataset, method)
    scramble = protocol.seeds_to_tune_on(tuning)[0]
    settings = tried_settings(max(protocol.searches(method)), space, scramble)
    return tuple(Trial(tuning, number, setting) for number, setting in enumerate(settings))


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
