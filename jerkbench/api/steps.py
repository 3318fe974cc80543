"""A run step by step: plain objects in, plain objects out."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from jerkbench import plugins
from jerkbench.api.combination import listed
from jerkbench.estimate import Estimate
from jerkbench.jobs.job import Protocol, metric_names, replaced
from jerkbench.jobs.names import Part, choose, is_plugin, noise_of, plugin_of
from jerkbench.recording import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def load(dataset: Part | None = None, seed: int = Protocol.first_seed) -> Recording:
    """Return the recording of a data set; of a simulated one, that of ``seed``.

    Raises:
        JerkbenchError: it is unknown, its parameters do not fit, or its files cannot be read.
    """
    recording: Recording = plugin_of("dataset", dataset).load(seed)
    return recording


def disturb(recording: Recording, disturbance: Part | Sequence[Part], seed: int = Protocol.first_seed) -> Recording:
    """Return the recording after one disturbance, or several in order, with the random numbers of ``seed``.

    Raises:
        JerkbenchError: one is unknown, its parameters do not fit, or the recording lacks what it changes.
    """
    for part in listed(disturbance):
        parts = [part] if is_plugin(part) else list(choose("disturbance", part).plain.values())
        for chosen in parts:
            plugin = chosen if is_plugin(chosen) else plugins.create("disturbance", chosen)
            recording = plugin.apply(recording, seed)
    return recording


def estimate(
    recording: Recording,
    *,
    filter: Part | None = None,  # noqa: A002 - the group's name
    adaptation: Part | None = None,
    attitude: Part | None = None,
    noise: Part | None = None,
    engine: Part | None = None,
) -> Estimate:
    """Return what a filter makes of a recording; the arguments are those of `run`.

    A recording does not say which attitude filter its data set prefers: of a recorded drive that is mostly
    ``attitude="real"``.

    Raises:
        JerkbenchError: something is unknown or does not fit, or the recording lacks an input.
    """
    from jerkbench.jobs.inputs import attitude_of
    from jerkbench.jobs.rows import solution

    model = plugin_of("filter", filter)
    model = dataclasses.replace(model, **replaced(type(model), noise_of(noise).plain))
    oriented = attitude_of(recording, plugin_of("attitude", attitude))
    return solution(recording, oriented, model, plugin_of("adaptation", adaptation), plugin_of("engine", engine))


def evaluate(
    estimate: Estimate,
    recording: Recording,
    *,
    metrics: Sequence[str] = (),
    burn_in_s: float = Protocol.burn_in_s,
) -> dict[str, float]:
    """Return the metrics of an estimate against the recording's reference, by column name, the unit last.

    Args:
        estimate: of the recording.
        recording: with its reference.
        metrics: names of those to compute, or ["all"]; empty: those that are cheap.
        burn_in_s: errors count from this time on [s].

    Raises:
        JerkbenchError: a metric is unknown, or nothing counts.
    """
    from jerkbench.evaluation.evaluated_run import evaluate_run

    chosen = [plugins.create("metric", {"name": name}) for name in metric_names(list(metrics))]
    return evaluate_run(estimate, recording, burn_in_s, chosen)


def figure(recording: Recording, estimates: Mapping[str, Estimate], kind: str = "errors") -> "Figure":
    """Return a figure of estimates by name: their ``errors`` over time, or the ``trajectory``.

    Raises:
        JerkbenchError: there is no such kind of figure.
    """
    from jerkbench.errors import JerkbenchError, unknown
    from jerkbench.report.plots.errors_over_time import error_figure
    from jerkbench.report.plots.trajectory import trajectory_figure

    kinds: dict[str, Callable[..., Figure]] = {"errors": error_figure, "trajectory": trajectory_figure}
    if kind not in kinds:
        raise JerkbenchError(unknown("kind of figure", kind, kinds))
    return kinds[kind](recording, dict(estimates))
