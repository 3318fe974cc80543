"""The files of a tuning: its page, table and figure, presets, and settings for other programs."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from omegaconf import OmegaConf

from jerkbench.arrays import FloatArray
from jerkbench.campaign.protocol import digest_of
from jerkbench.campaign.search import SearchOutcome, Trials, Tuning
from jerkbench.campaign.space import Space
from jerkbench.contracts import is_attitude_only
from jerkbench.evaluation.judgement import DEFEATS, MARGIN, Judgement, Verdict, judged, log_ratios
from jerkbench.files import filled_template, write_text
from jerkbench.report.review import TUNED
from jerkbench.report.writers import passive

HERE = Path(__file__).parent
CURVE = (1, 4, 16, 64, 256, 1024)
"""Numbers of trials at which the budget curve is evaluated."""
BINS = 8
"""Parts of the range of a parameter in its profile, and on each side of a map of two parameters."""


def write_tuning(tuning: Tuning, folder: Path, command: str) -> str:
    """Write the page, the record, the trials, the presets and the files for other programs; return the page.

    Args:
        tuning: The tuned method.
        folder: Folder of the method.
        command: The command that runs the tuned method.
    """
    write_presets(tuning, folder / "conf")
    page = f"{passive(tuning_page(tuning))}\nTake it with: {command}\n"
    write_text(folder / "tuning.md", page)
    write_text(folder / "tuning.json", json.dumps(record(tuning), indent=1) + "\n")
    write_text(folder / "trials.csv", trial_table(tuning).to_csv(index=False, lineterminator="\n"))
    if not is_attitude_only(tuning.job.method.filter):
        for name, text in other_programs(tuning).items():
            write_text(folder / "export" / name, text)
    return page


def record(tuning: Tuning) -> dict[str, Any]:
    """Return the tuning as plain data."""
    score, names = tuning.score, tuning.space.names
    cases = zip(tuning.cases.test, score.before.tolist(), score.chosen.tolist(), strict=True)
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
        "restarts": [float(own.chosen.mean()) for own in tuning.scores],
        "edges": tuning.space.at_edge(tuning.setting),
    }


def tuning_page(tuning: Tuning) -> str:
    """Return the page of one tuned method, as Markdown."""
    return filled_template(
        HERE / "tuning.md.jinja",
        {"shown": partial(_shown, tuning)},
        **record(tuning),
        parameters=tuning.space.parameters,
        meaning=tuning.objective.meaning,
        found=tuning.outcome.place > 0,
        improved=tuning.score.chosen.mean() < tuning.score.before.mean(),
    )


def tunings_table(tunings: Sequence[Tuning]) -> str:
    """Return the tuned methods as a table, compared with the first one and each with its setting before the search."""
    lines = [
        f"{tuning.name:<32} {_shown(tuning, tuning.score.before):>10} {_shown(tuning, tuning.score.chosen):>10}"
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
    """Compare each tuned method with the first one, seed by seed over all scenarios, as one family of comparisons."""
    first, *others = tunings
    if not others:
        return []
    if not len(first.score.errors):
        return ["The methods are not compared with each other: they have no errors on common seeds.", ""]
    said = judged([log_ratios(other.score.errors, first.score.errors) for other in others])
    heading = (
        f"Error as a ratio to the error of {first.name}, both tuned, on the same seeds, with simultaneous 95 %"
        " intervals (a seed counts as lost if a run of any scenario is lost):"
    )
    return [heading, *(_judged_line(other.name, own) for other, own in zip(others, said, strict=True)), ""]


def against_default(tunings: Sequence[Tuning]) -> list[str]:
    """Compare each tuned setting with the setting before the search, and name the methods that tuning made worse."""
    changed = [tuning for tuning in tunings if tuning.outcome.place and len(tuning.score.errors)]
    if not changed:
        return []
    said = judged([log_ratios(tuning.score.errors, tuning.score.errors_before) for tuning in changed])
    lines = ["Error of the tuned setting as a ratio to the error of the setting before the search:"]
    lines += [_judged_line(f"tuning of {tuning.name}", own) for tuning, own in zip(changed, said, strict=True)]
    worse = [tuning.name for tuning, own in zip(changed, said, strict=True) if own.verdict in DEFEATS]
    if worse:
        lines.append(
            f"Tuning made {', '.join(worse)} worse on runs that were not used for tuning. Publish the tuned row all the"
            " same: a choice of the default setting by these runs would be tuning on the test runs."
        )
    return [*lines, ""]


def _judged_line(name: str, own: Judgement) -> str:
    interval = f" [{own.low:.3f}, {own.high:.3f}]" if own.low == own.low else ""
    verdict = f"differ by less than {100 * MARGIN:g} %" if own.verdict is Verdict.SMALL else str(own.verdict)
    reason = f", as {own.reason}" if own.reason else ""
    return f"{name:<32} {own.ratio:>10.3f}{interval} {verdict}{reason}; {own.failure_rates}"


def _shown(tuning: Tuning, losses: Any) -> str:  # noqa: ANN401 - a number or an array
    """The mean loss: as a ratio to the plain filter, or as a difference to it."""
    mean = float(np.mean(losses))
    return f"{math.exp(mean):.3f}" if tuning.objective.relative else f"{mean:+.3f}"


def trial_table(tuning: Tuning) -> pd.DataFrame:
    """Return one row for each trial: its number, its values, the loss of each scenario and their mean."""
    trials, scenarios = tuning.outcome.trials, [case.labels.scenario for case in tuning.cases.tune]
    values = pd.DataFrame(np.array(trials.settings, dtype=np.float64), columns=tuning.space.names)
    losses = pd.DataFrame(trials.losses, columns=[f"loss: {scenario}" for scenario in scenarios])
    table = values.join(losses).assign(loss=trials.means, lost_runs=trials.failed.sum(axis=1))
    return table.rename_axis("trial").reset_index()


def budget_curve(trials: Trials) -> list[tuple[int, float]]:
    """Return (trials, lowest loss) after 1, 4, 16, ... and all trials; the first trial is the default setting."""
    best = np.minimum.accumulate(trials.means)
    sizes = [*(size for size in CURVE if size < len(best)), len(best)]
    return [(size, float(best[size - 1])) for size in sizes]


def indistinct_intervals(space: Space, outcome: SearchOutcome) -> list[tuple[float, float]]:
    """Return for each parameter the range of values that cannot be distinguished from the chosen one.

    A trial cannot be distinguished if its mean loss over the runs (with the same seeds: paired) exceeds that of the
    chosen one by at most 1.96 standard errors. The range is extended by half of the distance at which n trials lie in
    d dimensions, n^(-1/d) of the range, because nothing was tried between two trials.
    """
    trials, fractions = outcome.trials, space.fractions(outcome.trials.settings)
    difference = trials.runs - trials.runs[outcome.place]
    error = difference.std(axis=1, ddof=1) / np.sqrt(difference.shape[1]) if difference.shape[1] > 1 else np.zeros(1)
    near = fractions[difference.mean(axis=1) <= 1.96 * error]
    half = 0.5 * len(trials) ** (-1.0 / len(space.parameters))
    low, high = np.maximum(near.min(axis=0) - half, 0.0), np.minimum(near.max(axis=0) + half, 1.0)
    return [(p.bounds.value(a), p.bounds.value(b)) for p, a, b in zip(space.parameters, low, high, strict=True)]


def write_figure(tuning: Tuning, folder: Path) -> Path:
    """Draw the profile of each parameter, the map of the two that matter most, and the budget curve."""
    from jerkbench.report.plots.style import save_figure
    from jerkbench.report.plots.sweeps import Map, Profile, search_figure

    space, trials = tuning.space, tuning.outcome.trials
    fractions, drawn = space.fractions(trials.settings), None
    profiles = [
        Profile(
            parameter.name,
            values,
            np.array([parameter.bounds.value((part + 0.5) / BINS) for part in range(BINS)]),
            _lowest_losses(fractions[:, [k]], trials.means),
            tuning.setting[k],
            parameter.bounds.log,
        )
        for k, (parameter, values) in enumerate(zip(space.parameters, np.array(trials.settings).T, strict=True))
    ]
    if len(profiles) > 1:
        spread = [np.nan_to_num(np.nanmax(profile.least) - np.nanmin(profile.least)) for profile in profiles]
        first, second = np.argsort(spread, kind="stable")[:-3:-1].tolist()
        x, y = space.fractions([tuning.setting])[0, [first, second]].tolist()
        lowest = _lowest_losses(fractions[:, [first, second]], trials.means)
        drawn = Map(space.names[first], space.names[second], lowest, (x, y))
    title = f"{tuning.name}: {tuning.objective.name}, {len(trials)} settings"
    path = folder / "search.png"
    save_figure(search_figure(profiles, trials.means, drawn, budget_curve(trials), title), path)
    return path


def _lowest_losses(fractions: FloatArray, losses: FloatArray) -> FloatArray:
    """The lowest loss in each part of the ranges of the parameters (n, d); NaN: no trial is in this part."""
    from scipy.stats import binned_statistic_dd

    ranges = [(0.0, 1.0)] * fractions.shape[1]
    return np.asarray(binned_statistic_dd(fractions, losses, "min", bins=BINS, range=ranges).statistic)


TUNED_PARTS = ("filter", "adaptation", "attitude")


def preset_words(tuning: Tuning, *, typed: bool) -> list[str]:
    """Return the words that choose what was tuned.

    Args:
        tuning: the tuned method.
        typed: whether the words of the tuning choose an experiment themselves; a run takes one only.
    """
    if not typed:
        return [f"experiment={_name(tuning)}"]
    setting = tuning.setting
    parts = [f"{part}={_name(tuning)}" for part in TUNED_PARTS if tuning.space.of_part(part, setting)]
    return parts + [f"r_scale.{key}={value}" for key, value in tuning.space.of_part("r_scale", setting).items()]


def notes_of_tuning(tuning: Tuning) -> list[str]:
    """Return the notes that the presets give to their runs: effort, split, baseline and hash; then the ranges.

    The first note is the same for all methods that were tuned with the same effort on the same cases.
    """
    budget, cases = tuning.budget, tuning.cases
    alone = is_attitude_only(tuning.job.method.filter)
    search = {
        "objective": tuning.objective.name,
        "budget": asdict(budget),
        "split": cases.split,
        "scenarios": [case.labels.scenario for case in cases.tune] if not alone else [],
    }
    plain = "mekf" if alone else "the plain filter of the same model"
    effort = f"{TUNED}objective={tuning.objective.name}, trials={budget.trials}, finalists={budget.finalists}"
    effort = f"{effort}, sampler={budget.sampler}"
    ranges = ", ".join(f"{own.name} {own.bounds}" for own in tuning.space.parameters)
    return [
        f"{effort}; {cases.split}; compared with {plain} with default parameters; search {digest_of(search)}.",
        f"Search ranges of {tuning.name}: {ranges}.",
    ]


def write_presets(tuning: Tuning, folder: Path) -> None:
    """Write a preset of each part that was tuned to the groups in ``folder``, and an experiment that chooses them."""
    spec, chosen, notes = tuning.job.spec, {}, notes_of_tuning(tuning)
    for part in TUNED_PARTS:
        plugin, values = str(spec[part]["name"]), tuning.space.of_part(part, tuning.setting)
        if values or part != "attitude":
            chosen[part] = _name(tuning) if values else plugin
        if values:
            plain = {key: list(own) if isinstance(own, tuple) else own for key, own in spec[part].items()}
            del plain["name"]
            text = _text(notes[0], {"defaults": [plugin, "_self_"], **plain, **values})
            write_text(folder / part / f"{_name(tuning)}.yaml", text)
    told = tuning.space.of_part("r_scale", tuning.setting)
    defaults = [{f"override /{part}": preset} for part, preset in chosen.items()]
    whole = {"defaults": [*defaults, "_self_"], **({"r_scale": told} if told else {}), "notes": notes}
    write_text(folder / "experiment" / f"{_name(tuning)}.yaml", f"# @package _global_\n{_text(notes[0], whole)}")


def _name(tuning: Tuning) -> str:
    """The name of the experiment."""
    return f"{tuning.name}_tuned".replace("-", "_")


def _text(first_line: str, content: dict[str, Any]) -> str:
    return f"# {first_line}\n{OmegaConf.to_yaml(OmegaConf.create(content))}"


MGAL_PER_MG = 980.665
HOUR_S = 3600.0
UNDECIDED = (0.05, 0.05, 0.06, 0.03, 0.03, 0.06, 0.025, 0.025, 0.04, 0.01, 0.01, 0.02, 0.01, 0.01, 0.015)
"""robot_localization's own process noise, of x y z, roll pitch yaw, their rates, and ax ay az."""

CORRELATION_H = 1.0
"""Correlation time of KF-GINS' biases where our filter has a random walk."""


def other_programs(tuning: Tuning) -> dict[str, str]:
    """Return the settings for other programs, by the name of the file: what maps to them, and what does not."""
    spec = tuning.space.applied(tuning.job, tuning.setting).spec
    values = {
        f"{part}.{key}": float(value)
        for part in ("filter", "adaptation", "r_scale")
        for key, value in spec[part].items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }
    density, walk = _velocity_density(values, tuning.interval_s), values.get("filter.accel_walk_mps2_per_sqrt_s")
    variances = list(UNDECIDED)
    if density is not None:
        variances[6:9] = [density] * 3
    if walk is not None:
        variances[12:15] = [walk**2] * 3
    noise, gate, name = _imu_noise(values, density), _gate(values), str(spec["adaptation"]["name"])
    own = {key.partition(".")[2]: value for key, value in values.items() if key.startswith("filter.")}
    adaptation = f"Does not map: the adaptation {name}; without it the tuned noises need not be the best."
    if name == "chi2" and gate:
        distance = f"sqrt(chi2(p, 3)) = {gate:.4g}"
        adaptation = f"The adaptation chi2 is a gate, {distance}, in robot_localization; it maps nowhere else."
    content = {
        "values": values,
        "density": density,
        "walk": walk,
        "diagonal": np.diag(variances).ravel().tolist() if (density, walk) != (None, None) else [],
        "noise": noise,
        "vrw": noise["vrw"],
        "own": own if spec["filter"]["name"] == "eskf15" else None,
        "gate": gate,
        "adaptation": adaptation if name != "none" else "",
    }
    names = ("robot_localization.yaml", "kf-gins.yaml", "eskf15.yaml")
    return {name: filled_template(HERE / f"{name}.jinja", {"g": "{:.6g}".format}, **content) for name in names}


def _velocity_density(values: Mapping[str, float], interval_s: float | None) -> float | None:
    """Density of the random walk of the velocity [m2/s3]: sigma_a^2 dt, or the equivalent parameter of the filter."""
    if (sigma := values.get("filter.accel_mps2")) is not None and interval_s is not None:
        return sigma**2 * interval_s
    if (walk := values.get("filter.velocity_walk_mps_per_sqrt_s")) is not None:
        return walk**2
    if (walk := values.get("filter.velocity_random_walk_mps_per_sqrt_h")) is not None:
        return walk**2 / HOUR_S
    return None


def _imu_noise(values: Mapping[str, float], density: float | None) -> dict[str, float | None]:
    """The values of ``imunoise``; None: the filter has no such parameter."""
    noise: dict[str, float | None] = dict.fromkeys(("arw", "vrw", "gbstd", "abstd", "corrtime"))
    noise["vrw"] = None if density is None else math.sqrt(density * HOUR_S)
    instability, walk = (values.get(f"filter.{n}") for n in ("accel_instability_mg", "bias_mps2_per_sqrt_s"))
    if instability is not None:
        noise["arw"] = values.get("filter.angle_random_walk_deg_per_sqrt_h")
        noise["gbstd"] = values.get("filter.gyro_instability_deg_per_h")
        noise |= {"abstd": instability * MGAL_PER_MG, "corrtime": values["filter.accel_correlation_s"] / HOUR_S}
    elif walk is not None:  # of a Gauss-Markov process with that walk: 2 sigma^2/tau
        noise |= {"abstd": 1e5 * (walk * math.sqrt(CORRELATION_H * HOUR_S / 2.0)), "corrtime": CORRELATION_H}
    return noise


def _gate(values: Mapping[str, float]) -> float | None:
    """The Mahalanobis distance beyond which a gate rejects a block; None: the adaptation is not a gate."""
    if (probability := values.get("adaptation.probability")) is None:
        return None
    from scipy.stats import chi2

    return math.sqrt(float(chi2.ppf(probability, 3)))
