"""Runs without trajectories: side by side where they can go so, else one at a time."""

from collections.abc import Callable, Sequence

from jerkbench.contracts import Adaptation
from jerkbench.estimation.threads import side_by_side
from jerkbench.inertial.compiled.solution import Prepared, stream_compiled
from jerkbench.inertial.side_by_side.runs import goes_together, run_journeys
from jerkbench.kinematic.plugin_call import Rule, compiled_rule
from jerkbench.optional import clocked
from jerkbench.sums import Scoring, Streamed


def stream_all(
    prepare: Callable[[int], Prepared],
    scorings: Sequence[Scoring],
    adaptations: Sequence[Adaptation],
    *,
    updates: bool,
    attitude: bool,
    threads: int,
) -> list[Streamed | None]:
    """Return the sums of each run; None where one needs a trajectory, or raises an error.

    Args:
        prepare: returns run k; it may raise an error.
        scorings: what the errors of each count for.
        adaptations: their adaptations.
        updates: whether to keep what the updates saw.
        attitude: whether to keep the attitude.
        threads: how many to use.
    """
    prepared = side_by_side(prepare, range(len(scorings)), 1)
    rules = [_rule_of(run, adaptation) for run, adaptation in zip(prepared, adaptations, strict=True)]
    together = [
        k
        for k, (run, rule) in enumerate(zip(prepared, rules, strict=True))
        if run is not None and rule is not None and goes_together(run.journey, scorings[k])
    ]
    results: list[Streamed | None] = [None] * len(scorings)
    chosen = [run.journey for k in together if (run := prepared[k]) is not None], [scorings[k] for k in together]
    own = [rule for k in together if (rule := rules[k]) is not None]
    sums = run_journeys(*chosen, own, updates=updates, attitude=attitude, threads=threads)
    for k, result in zip(together, sums, strict=True):
        results[k] = result

    def alone(k: int) -> Streamed | None:
        """One at a time."""
        run = prepared[k]
        if run is None:
            return None
        return stream_compiled(run, scorings[k], adaptations[k], updates=updates, attitude=attitude)

    rest = sorted(set(range(len(scorings))) - set(together))
    for k, result in zip(rest, side_by_side(alone, rest, threads), strict=True):
        results[k] = result
    return results


def _rule_of(run: Prepared | None, adaptation: Adaptation) -> Rule | None:
    return None if run is None else compiled_rule(clocked(adaptation, run.journey.timeline))
