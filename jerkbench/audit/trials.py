"""The trials of an audit: what a scenario is run with, by its place among all settings of a method."""

from collections.abc import Callable, Iterable, Mapping, Sequence

import pandas as pd

from jerkbench.audit.methods import Method
from jerkbench.audit.scenarios import Scenario
from jerkbench.audit.searches import Search
from jerkbench.audit.stages import Settings, Stages

Trials = Mapping[Method, tuple[int, ...]]
"""Places of settings, of each method; 0 are its defaults."""

LookedAt = Callable[[str, Iterable[Scenario]], list[int]]
"""The numbers of the scenarios that belong to what a search was tuned on: `searches.seen` or `searches.unseen`."""


def needed_trials(
    trials: Mapping[Search, Iterable[int]], methods: Iterable[Method], scenarios: Sequence[Scenario], of: LookedAt
) -> list[Trials]:
    """Return for each scenario the defaults and the ``trials`` of those searches that it belongs to.

    What no verdict reads is not run: a setting that was tuned on one half is scored on the other half alone.
    """
    needed = [{method: {0} for method in methods} for _ in scenarios]
    for search, own in trials.items():
        for number in of(search.tuned_on, scenarios):
            needed[number][search.method].update(own)
    return [{method: tuple(sorted(own)) for method, own in by_method.items()} for by_method in needed]


def run_trials(
    stages: Stages, name: str, seeds: tuple[int, ...], settings: Sequence[Settings], needed: Sequence[Trials]
) -> pd.DataFrame:
    """Run of the ``settings`` of each scenario those that are ``needed``; ``trial`` is the place among all of them."""
    selected = [
        {method: tuple(all_of[method][trial] for trial in own) for method, own in trials.items()}
        for all_of, trials in zip(settings, needed, strict=True)
    ]
    rows = stages.run(name, seeds, selected)
    keys = zip(rows["scenario"], rows["filter"], rows["adaptation"], rows["trial"], strict=True)
    rows["trial"] = [needed[number][Method(model, adaptation)][place] for number, model, adaptation, place in keys]
    return rows
