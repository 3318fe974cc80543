"""The output files of a tuning: page, table, figure, presets, and settings for other navigation programs."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from omegaconf import OmegaConf

from jerkbench.campaign.protocol import digest_of
from jerkbench.campaign.runs import Setting, Space
from jerkbench.campaign.search import SearchOutcome, Trials, Tuning
from jerkbench.contracts import is_attitude_only
from jerkbench.evaluation.judgement import DEFEATS, MARGIN, Judgement, Verdict, judged, log_ratios
from jerkbench.files import filled_template, write_text
from jerkbench.report.summary import TUNED
from jerkbench.report.writers import passive

TEMPLATES = Path(__file__).parent / "templates"
CURVE = (1, 4, 16, 64, 256, 1024)
"""Numbers of trials at which the budget curve (lowest loss against number of trials) is evaluated."""


def write_tuning(tuning: Tuning, folder: Path, command: str) -> str:
    """Write all output files of a tuning, and return the text of the page.

    Args:
        tuning: The tuned method.
        folder: Folder to which the files are written.
        command: The command that runs the tuned method.
    """
    write_presets(tuning, folder / "conf")
    page = f"{passive(tuning_page(tuning))}\nRun the tuned method with: {command}\n"
    write_text(folder / "tuning.md", page)
    write_text(folder / "tuning.json", json.dumps(record(tuning), indent=1) + "\n")
    write_text(folder / "trials.csv", trial_table(tuning).to_csv(index=False, lineterminator="\n"))
    if not is_attitude_only(tuning.job.method.filter):
        write_text(folder / "export" / "robot_localization.yaml", robot_localization(tuning))
    return page


def record(tuning: Tuning) -> dict[str, Any]:
    """Return the results of a tuning as plain data for a JSON file."""
    score, names = tuning.score, tuning.space.names
    cases = zip(tuning.cases.test, score.before.tolist(), score.tuned.tolist(), strict=True)
    return {
        "method": tuning.name,
        "objective": tuning.objective.name,
        "sampler": tuning.budget.sampler,
        "trials": len(tuning.outcome.trials),
        "split": tuning.cases.split,
        "setting": dict(zip(names, tuning.setting, strict=True)),
        "before": dict(zip(names, tuning.space.start, strict=True)),
        "intervals": dict(zip(names, indistinct_intervals(tuning.space, tuning.outcome), strict=True)),
        "unseen": {case.labels.scenario: {"before": before, "tuned": tuned} for case, before, tuned in cases},
        "lost": score.failed,
        "lost_before": score.failed_before,
        "runs": score.runs,
        "budget_curve": budget_curve(tuning.outcome.trials),
        "edges": tuning.space.at_edge(tuning.setting),
    }


def tuning_page(tuning: Tuning) -> str:
    """Return the page about one tuned method as Markdown text."""
    return filled_template(
        TEMPLATES / "tuning.md.jinja",
        {"shown": partial(_shown, tuning)},
        **record(tuning),
        parameters=tuning.space.parameters,
        meaning=tuning.objective.meaning,
        found=tuning.outcome.best > 0,
        improved=tuning.score.tuned.mean() < tuning.score.before.mean(),
        correlation=tuning.score.correlation,
    )


def tunings_table(tunings: Sequence[Tuning]) -> str:
    """Return a table of the tuned methods as text, with comparisons with the first method and with untuned settings."""
    lines = [
        f"{tuning.name:<32} {_shown(tuning, tuning.score.before):>10} {_shown(tuning, tuning.score.tuned):>10}"
        f" {tuning.score.failed:>4} of {tuning.score.runs}"
        for tuning in tunings
    ]
    title = f"Runs that were not used for tuning: {tunings[0].objective.meaning}."
    head = f"{'method':<32} {'before':>10} {'tuned':>10} {'lost':>4}"
    trials = tunings[0].budget.trials
    equal = f"Equal budgets: each of {len(tunings)} methods tried {trials} settings."
    budget = equal if len(tunings) > 1 else f"Budget: {trials} settings tried."
    return "\n".join([title, head, *lines, "", *_against_first(tunings), *against_default(tunings), budget])


def _against_first(tunings: Sequence[Tuning]) -> list[str]:
    """Return lines that compare the error of each tuned method with the error of the first method on the same seeds."""
    first, *others = tunings
    if not others:
        return []
    if not len(first.score.errors):
        return ["The methods are not compared with each other: a test needs several seeds or recordings.", ""]
    said = judged([log_ratios(other.score.errors, first.score.errors) for other in others])
    heading = (
        f"Error as a ratio to the error of {first.name}, both tuned, on the same seeds, with simultaneous 95 %"
        " intervals (a seed counts as failed if a run of any scenario diverged or failed):"
    )
    return [heading, *(_judged_line(other.name, judgement) for other, judgement in zip(others, said, strict=True)), ""]


def against_default(tunings: Sequence[Tuning]) -> list[str]:
    """Return lines that compare the error of each tuned setting with the error of the setting before the search."""
    changed = [tuning for tuning in tunings if tuning.outcome.best and len(tuning.score.errors)]
    if not changed:
        return []
    said = judged([log_ratios(tuning.score.errors, tuning.score.errors_before) for tuning in changed])
    pairs = list(zip(changed, said, strict=True))
    lines = ["Error of the tuned setting as a ratio to the error of the setting before the search:"]
    lines += [_judged_line(f"tuning of {tuning.name}", judgement) for tuning, judgement in pairs]
    worse = [tuning.name for tuning, judgement in pairs if judgement.verdict in DEFEATS]
    if worse:
        lines.append(
            f"Tuning made {', '.join(worse)} worse on runs that were not used for tuning. Publish the tuned row all the"
            " same: a choice of the default setting by these runs would be tuning on the test runs."
        )
    return [*lines, ""]


def _judged_line(name: str, judgement: Judgement) -> str:
    interval = f" [{judgement.low:.3f}, {judgement.high:.3f}]" if judgement.low == judgement.low else ""
    verdict = f"differ by less than {100 * MARGIN:g} %" if judgement.verdict is Verdict.SMALL else judgement.verdict
    reason = f", as {judgement.reason}" if judgement.reason else ""
    return f"{name:<32} {judgement.ratio:>10.3f}{interval} {verdict}{reason}; {judgement.failure_rates}"


def _shown(tuning: Tuning, losses: Any) -> str:  # noqa: ANN401 - a number or an array
    """Return the mean loss as text: an error ratio to the plain filter, or a difference from the plain filter."""
    mean = float(np.mean(losses))
    return f"{math.exp(mean):.3f}" if tuning.objective.relative else f"{mean:+.3f}"


def trial_table(tuning: Tuning) -> pd.DataFrame:
    """Return a table with one row for each trial: parameter values, losses of the scenarios, and failed runs."""
    trials, scenarios = tuning.outcome.trials, [case.labels.scenario for case in tuning.cases.tune]
    values = pd.DataFrame(np.array(trials.settings, dtype=np.float64), columns=tuning.space.names)
    losses = pd.DataFrame(trials.losses, columns=[f"loss: {scenario}" for scenario in scenarios])
    table = values.join(losses).assign(loss=trials.means, lost_runs=trials.failed.sum(axis=1))
    return table.rename_axis("trial").reset_index()


def budget_curve(trials: Trials) -> list[tuple[int, float]]:
    """Return pairs of n and the lowest loss of the first n trials, for n = 1, 4, 16, ... and for all trials."""
    best = np.minimum.accumulate(trials.means)
    sizes = [*(size for size in CURVE if size < len(best)), len(best)]
    return [(size, float(best[size - 1])) for size in sizes]


def indistinct_intervals(space: Space, outcome: SearchOutcome) -> list[tuple[float, float]]:
    """Return the range of values of each parameter for which the loss is not significantly larger than the lowest loss.

    A trial is indistinguishable from the selected trial if its mean loss is larger by at most 1.96 standard errors of
    the paired difference. The losses are paired, because all trials have runs with the same seeds. The range of a
    parameter contains its values in all indistinguishable trials. At both ends, the range is extended by half of the
    typical distance between trials, because no value between two trials was evaluated. For n trials in d dimensions,
    the typical distance is n^(-1/d) of the full range of the parameter.
    """
    trials, fractions = outcome.trials, space.fractions(outcome.trials.settings)
    difference = trials.runs - trials.runs[outcome.best]
    error = difference.std(axis=1, ddof=1) / np.sqrt(difference.shape[1]) if difference.shape[1] > 1 else np.zeros(1)
    near = fractions[difference.mean(axis=1) <= 1.96 * error]
    half = 0.5 * len(trials) ** (-1.0 / len(space.parameters))
    low, high = np.maximum(near.min(axis=0) - half, 0.0), np.minimum(near.max(axis=0) + half, 1.0)
    return [(p.bounds.value(a), p.bounds.value(b)) for p, a, b in zip(space.parameters, low, high, strict=True)]


TUNED_PARTS = ("filter", "adaptation", "attitude")


def preset_overrides(tuning: Tuning, *, typed: bool) -> list[str]:
    """Return the command-line overrides that select the presets of the tuned method.

    Args:
        tuning: The tuned method.
        typed: Whether the command line of the tuning selects an experiment. A run can have only one experiment, so in
            this case the presets of the filter, the adaptation and the attitude filter are selected separately.
    """
    if not typed:
        return [f"experiment={_name(tuning)}"]
    parts = [f"{part}={_name(tuning)}" for part in TUNED_PARTS if tuning.space.of_part(part, tuning.setting)]
    return parts + [f"r_scale.{key}={value}" for key, value in tuning.space.of_part("r_scale", tuning.setting).items()]


def notes_of_tuning(tuning: Tuning) -> list[str]:
    """Return the two notes that describe the tuning in the presets of a tuned method.

    The first note contains the budget, the split of the runs, the baseline and a hash of the search. The first note is
    equal for all methods that were tuned with the same budget on the same cases. The second note contains the search
    ranges of the parameters.
    """
    budget, cases = tuning.budget, tuning.cases
    attitude_only = is_attitude_only(tuning.job.method.filter)
    search = {
        "objective": tuning.objective.name,
        "budget": {**asdict(budget), "restarts": 1},  # so that the hash is the same as in earlier versions
        "split": cases.split,
        "scenarios": [case.labels.scenario for case in cases.tune] if not attitude_only else [],
    }
    plain = "mekf" if attitude_only else "the plain filter of the same model"
    effort = f"{TUNED}objective={tuning.objective.name}, trials={budget.trials}, finalists={budget.finalists}"
    effort = f"{effort}, sampler={budget.sampler}"
    ranges = ", ".join(f"{parameter.name} {parameter.bounds}" for parameter in tuning.space.parameters)
    parts = {"filter", "adaptation"} - {parameter.part for parameter in tuning.space.parameters}
    untuned = [f"{part} {tuning.job.spec[part]['name']}" for part in sorted(parts) if fields(tuning.job.part(part))]
    defaults = f". Without a range, with its defaults: {', '.join(untuned)}" if untuned else ""
    return [
        f"{effort}; {cases.split}; compared with {plain} with default parameters; search {digest_of(search)}.",
        f"Search ranges of {tuning.name}: {ranges}{defaults}.",
    ]


def write_presets(tuning: Tuning, folder: Path) -> None:
    """Write a preset for each tuned plugin to a subfolder of ``folder``, and an experiment that selects the presets.

    Presets and an experiment with names that end in _untuned contain the setting before the search.
    """
    notes = notes_of_tuning(tuning)
    _write_setting(tuning, folder, "tuned", tuning.setting, notes)
    _write_setting(tuning, folder, "untuned", tuning.space.start, [f"The setting of {tuning.name} before the tuning."])


def _write_setting(tuning: Tuning, folder: Path, state: str, setting: Setting, notes: list[str]) -> None:
    spec, choices, preset = tuning.job.spec, {}, _name(tuning, state)
    for part in TUNED_PARTS:
        plugin, values = str(spec[part]["name"]), tuning.space.of_part(part, setting)
        if values or part != "attitude":
            choices[part] = preset if values else plugin
        if values:
            given = {key: value for key, value in spec[part].items() if key != "name"}
            plain = {key: list(value) if isinstance(value, tuple) else value for key, value in given.items()}
            text = _text(notes[0], {"defaults": [plugin, "_self_"], **plain, **values})
            write_text(folder / part / f"{preset}.yaml", text)
    factors = tuning.space.of_part("r_scale", setting)
    defaults = [{f"override /{part}": preset} for part, preset in choices.items()]
    experiment = {"defaults": [*defaults, "_self_"], **({"r_scale": factors} if factors else {}), "notes": notes}
    write_text(folder / "experiment" / f"{preset}.yaml", f"# @package _global_\n{_text(notes[0], experiment)}")


def _name(tuning: Tuning, state: str = "tuned") -> str:
    return f"{tuning.name}_{state}".replace("-", "_")


def _text(first_line: str, content: dict[str, Any]) -> str:
    return f"# {first_line}\n{OmegaConf.to_yaml(OmegaConf.create(content))}"


HOUR_S = 3600.0
UNDECIDED = (0.05, 0.05, 0.06, 0.03, 0.03, 0.06, 0.025, 0.025, 0.04, 0.01, 0.01, 0.02, 0.01, 0.01, 0.015)
"""Default process noise variances of robot_localization: x y z, roll pitch yaw, their rates, and ax ay az."""


def robot_localization(tuning: Tuning) -> str:
    """Return the text of a configuration file for robot_localization with the tuned parameters.

    Comments in the file list the parameters that cannot be converted.
    """
    spec = tuning.space.applied(tuning.job, tuning.setting).spec
    density, walk = (
        _velocity_density(spec["filter"], tuning.interval_s),
        spec["filter"].get("accel_walk_mps2_per_sqrt_s"),
    )
    variances = list(UNDECIDED)
    if density is not None:
        variances[6:9] = [density] * 3
    if walk is not None:
        variances[12:15] = [walk**2] * 3
    return filled_template(
        TEMPLATES / "robot_localization.yaml.jinja",
        {"g": "{:.6g}".format},
        r_scale=spec["r_scale"],
        density=density,
        walk=walk,
        diagonal=np.diag(variances).ravel().tolist() if (density, walk) != (None, None) else [],
        gate=_gate(spec["adaptation"]),
        adaptation=spec["adaptation"]["name"],
    )


def _velocity_density(model: Mapping[str, Any], interval_s: float | None) -> float | None:
    """Return the power spectral density of the velocity random walk [m2/s3], or None if no parameter defines it."""
    if (sigma := model.get("accel_mps2")) is not None and interval_s is not None:
        return float(sigma**2 * interval_s)
    if (walk := model.get("velocity_walk_mps_per_sqrt_s")) is not None:
        return float(walk**2)
    if (walk := model.get("velocity_random_walk_mps_per_sqrt_h")) is not None:
        return float(walk**2 / HOUR_S)
    return None


def _gate(adaptation: Mapping[str, Any]) -> float | None:
    """Return the Mahalanobis distance above which an adaptation drops measurements, or None if it has no threshold."""
    if (probability := adaptation.get("probability")) is None:
        return None
    from scipy.stats import chi2

    return math.sqrt(float(chi2.ppf(probability, 3)))
