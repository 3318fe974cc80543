"""A tuning in words and numbers: what was spent, what was found, what it is worth where nothing was tuned."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from jerkbench.evaluation.statistics.judgement import judged
from jerkbench.evaluation.statistics.over_seeds import log_ratios
from jerkbench.tuning.curves import budget_curve, knob_intervals
from jerkbench.tuning.search import Tuning, equal_budgets


def tuning_page(tuning: Tuning) -> str:
    """Return the page of one tuned method, as Markdown."""
    return "\n".join([f"# {tuning.name}, tuned", "", *_spent(tuning), "", *_knobs(tuning), "", *_worth(tuning), ""])


def tunings_table(tunings: Sequence[Tuning]) -> str:
    """Return the tuned methods side by side, and whether they were tuned alike.

    Raises:
        JerkbenchError: they were not.
    """
    lines = [
        f"{tuning.name:<32} {_shown(tuning, tuning.score.before):>10} {_shown(tuning, tuning.score.chosen):>10}"
        f" {tuning.score.lost:>4} of {tuning.score.runs}"
        for tuning in tunings
    ]
    head = f"{'on runs that were not seen':<32} {'before':>10} {'tuned':>10} {'lost':>4}"
    equal = equal_budgets({tuning.name: tuning.outcome for tuning in tunings})
    return "\n".join([head, *lines, "", *_against_the_first(tunings), equal])


def _against_the_first(tunings: Sequence[Tuning]) -> list[str]:
    """Compare each tuned method with the first one, seed by seed over all scenarios, as one family of comparisons."""
    first, *others = tunings
    if not (others and first.effort.objective.relative and len(first.score.of_seeds)):
        return []
    said = judged([log_ratios(other.score.of_seeds, first.score.of_seeds) for other in others])
    lines = [
        f"{other.name:<32} {own.ratio:>10.3f} [{own.low:.3f}, {own.high:.3f}] {own.verdict}; {own.losses}"
        for other, own in zip(others, said, strict=True)
    ]
    return [f"as a ratio to {first.name}, both tuned; 95 %, all at once; a seed is lost if a scenario is:", *lines, ""]


def record(tuning: Tuning) -> Mapping[str, Any]:
    """Return the tuning as plain data."""
    return {
        "method": tuning.name,
        "objective": tuning.effort.objective.name,
        "sampler": tuning.effort.budget.sampler,
        "trials": len(tuning.outcome.trials),
        "split": tuning.cases.split,
        "setting": dict(zip(tuning.space.names, tuning.setting, strict=True)),
        "before": dict(zip(tuning.space.names, tuning.space.start, strict=True)),
        "intervals": dict(zip(tuning.space.names, knob_intervals(tuning.space, tuning.outcome), strict=True)),
        "unseen": {
            case.labels.scenario: {"before": float(before), "tuned": float(chosen)}
            for case, before, chosen in zip(tuning.cases.test, tuning.score.before, tuning.score.chosen, strict=True)
        },
        "lost": tuning.score.lost,
        "lost_before": tuning.score.lost_before,
        "runs": tuning.score.runs,
        "budget_curve": budget_curve(tuning.outcome.trials),
        "restarts": [float(restart.score.chosen.mean()) for restart in tuning.restarts],
        "edges": tuning.space.at_edge(tuning.setting),
    }


def warnings(tuning: Tuning) -> list[str]:
    """Return what a reader has to know before he uses the setting."""
    sentences = tuning.space.at_edge(tuning.setting)
    before, chosen = float(tuning.score.before.mean()), float(tuning.score.chosen.mean())
    if tuning.outcome.place == 0:
        sentences.append("No setting was better than the one before the search.")
    elif chosen >= before:
        sentences.append("On runs that were not seen the tuned setting is no better than the one before the search.")
    return sentences


def _spent(tuning: Tuning) -> Iterator[str]:
    effort = tuning.effort
    yield f"Objective: {effort.objective.name}; {effort.objective.meaning}."
    yield f"Split: {tuning.cases.split}."
    budget = equal_budgets({tuning.name: tuning.outcome})
    yield f"{budget} Sampler {effort.budget.sampler}, {len(tuning.space.knobs)} knobs."


def _knobs(tuning: Tuning) -> Iterator[str]:
    yield "| knob | before | tuned | cannot be told apart | range |"
    yield "|---|---|---|---|---|"
    columns = zip(tuning.space.knobs, tuning.setting, knob_intervals(tuning.space, tuning.outcome), strict=True)
    for knob, value, (low, high) in columns:
        yield f"| {knob.name} | {knob.start:.4g} | {value:.4g} | {low:.3g} to {high:.3g} | {knob.bounds} |"


def _worth(tuning: Tuning) -> Iterator[str]:
    yield "On runs that the search has not seen:"
    yield ""
    yield "| scenario | before | tuned |"
    yield "|---|---|---|"
    for case, before, chosen in zip(tuning.cases.test, tuning.score.before, tuning.score.chosen, strict=True):
        yield f"| {case.labels.scenario} | {_shown(tuning, before)} | {_shown(tuning, chosen)} |"
    yield ""
    yield f"Lost runs: {tuning.score.lost} of {tuning.score.runs} (before: {tuning.score.lost_before})."
    curve = ", ".join(f"{size}: {_shown(tuning, loss)}" for size, loss in budget_curve(tuning.outcome.trials))
    yield f"Best of the trials so far, on the runs tuned on: {curve}."
    if len(tuning.restarts) > 1:
        losses = np.array([restart.score.chosen.mean() for restart in tuning.restarts])
        low, high = _shown(tuning, losses.min()), _shown(tuning, losses.max())
        yield f"{len(losses)} searches, with other scrambles, come to {low} to {high}; that much is luck."
    yield from warnings(tuning)


def _shown(tuning: Tuning, losses: Any) -> str:  # noqa: ANN401 - a number or an array
    """The mean loss: as a ratio to the plain filter, or as a difference to it."""
    mean = float(np.mean(losses))
    return f"{math.exp(mean):.3f}" if tuning.effort.objective.relative else f"{mean:+.3f}"
