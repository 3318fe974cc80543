"""What a tuning leaves: its page and curves, presets of ours, settings for other programs with what does not map."""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from omegaconf import OmegaConf

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.judgement import MARGIN, Judgement, Verdict, judged, log_ratios
from jerkbench.files import filled_template, write_text
from jerkbench.tuning.evaluate import Trials
from jerkbench.tuning.search import SearchOutcome, Tuning, equal_budgets
from jerkbench.tuning.space import Space

if TYPE_CHECKING:
    from matplotlib.figure import Figure


HERE = Path(__file__).parent


def tuning_page(tuning: Tuning) -> str:
    """Return the page of one tuned method, as Markdown."""
    return filled_template(
        HERE / "tuning.md.jinja",
        {"shown": partial(_shown, tuning)},
        tuning=tuning,
        objective=tuning.effort.objective,
        budget=equal_budgets({tuning.name: tuning.outcome}),
        knobs=list(zip(tuning.space.knobs, tuning.setting, knob_intervals(tuning.space, tuning.outcome), strict=True)),
        cases=list(zip(tuning.cases.test, tuning.score.before, tuning.score.chosen, strict=True)),
        curve=budget_curve(tuning.outcome.trials),
        restarts=[float(restart.score.chosen.mean()) for restart in tuning.restarts],
        warnings=warnings(tuning),
    )


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
    head = f"{'method':<32} {'before':>10} {'tuned':>10} {'lost':>4}"
    equal = equal_budgets({tuning.name: tuning.outcome for tuning in tunings})
    title = f"Runs that were not used for tuning: {tunings[0].effort.objective.meaning}."
    return "\n".join([title, head, *lines, "", *_against_the_first(tunings), equal])


def _against_the_first(tunings: Sequence[Tuning]) -> list[str]:
    """Compare each tuned method with the first one, seed by seed over all scenarios, as one family of comparisons."""
    first, *others = tunings
    if not others:
        return []
    if not len(first.score.errors):
        return ["The methods are not compared with each other: they have no errors on common seeds.", ""]
    said = judged([log_ratios(other.score.errors, first.score.errors) for other in others])
    lines = [
        f"{other.name:<32} {own.ratio:>10.3f}{_interval(own)} {_words(own)}; {own.failure_rates}"
        for other, own in zip(others, said, strict=True)
    ]
    heading = (
        f"Error as a ratio to the error of {first.name}, both tuned, on the same seeds, with simultaneous 95 %"
        " intervals (a seed counts as lost if a run of any scenario is lost):"
    )
    return [heading, *lines, ""]


def _interval(judgement: Judgement) -> str:
    return f" [{judgement.low:.3f}, {judgement.high:.3f}]" if judgement.low == judgement.low else ""


def _words(judgement: Judgement) -> str:
    if judgement.verdict is Verdict.SMALL:
        return f"differ by less than {100 * MARGIN:g} %"
    return f"{judgement.verdict}, as {judgement.reason}" if judgement.reason else str(judgement.verdict)


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


def _shown(tuning: Tuning, losses: Any) -> str:  # noqa: ANN401 - a number or an array
    """The mean loss: as a ratio to the plain filter, or as a difference to it."""
    mean = float(np.mean(losses))
    return f"{math.exp(mean):.3f}" if tuning.effort.objective.relative else f"{mean:+.3f}"


# Curves over the trials of a search: profiles, the budget, settings that cannot be told apart.

LOOKS = (1, 4, 16, 64, 256, 1024)
"""Budgets at which the curve is read."""

BINS = 8
"""Parts of a knob's range in its profile; of two knobs in their map as many on each side."""


def budget_curve(trials: Trials) -> list[tuple[int, float]]:
    """Return (trials, loss of the best of them) after 1, 4, 16, ... and all trials; after 1: before the search."""
    best = np.minimum.accumulate(trials.means)
    sizes = [*(size for size in LOOKS if size < len(best)), len(best)]
    return [(size, float(best[size - 1])) for size in sizes]


def profile(space: Space, trials: Trials, knob: int) -> tuple[FloatArray, FloatArray]:
    """Return the middles (b,) of parts of a knob's range, in its unit, and the least loss (b,) of a trial in each.

    NaN where no trial lies.
    """
    share = shares(space, trials)[:, knob]
    part = np.minimum((BINS * share).astype(np.int64), BINS - 1)
    least = [trials.means[part == k].min(initial=np.inf) for k in range(BINS)]
    middles = [space.knobs[knob].bounds.value((k + 0.5) / BINS) for k in range(BINS)]
    return np.array(middles), np.where(np.isfinite(least), least, np.nan)


def loss_map(space: Space, trials: Trials, first: int, second: int) -> FloatArray:
    """Return (b, b) the least loss of a trial in each part of two knobs' ranges: rows by the first; NaN: none."""
    both = np.minimum((BINS * shares(space, trials)[:, [first, second]]).astype(np.int64), BINS - 1)
    least = np.full((BINS, BINS), np.inf)
    np.minimum.at(least, (both[:, 0], both[:, 1]), trials.means)
    return np.where(np.isfinite(least), least, np.nan)


def shares(space: Space, trials: Trials) -> FloatArray:
    """Return (n, d) how much of the way through each range the values are."""
    return np.array([[k.share(v) for k, v in zip(space.knobs, setting, strict=True)] for setting in trials.settings])


def importance(space: Space, trials: Trials) -> list[int]:
    """Return the knobs by how much their profile varies, the most first."""
    profiles = (profile(space, trials, k)[1] for k in range(len(space.knobs)))
    spread = [np.nan_to_num(np.ptp(least[np.isfinite(least)])) for least in profiles]
    return [int(k) for k in np.argsort(spread, kind="stable")[::-1]]


def indistinct(outcome: SearchOutcome) -> list[int]:
    """Return the places of the trials that cannot be told from the chosen one.

    Their mean loss over the runs (the same draws: paired) is no larger than by 1.96 standard errors of the difference.
    """
    trials = outcome.trials
    difference = trials.runs - trials.runs[outcome.place]
    error = difference.std(axis=1, ddof=1) / np.sqrt(difference.shape[1]) if difference.shape[1] > 1 else np.zeros(1)
    return [int(k) for k in np.flatnonzero(difference.mean(axis=1) <= 1.96 * error)]


def knob_intervals(space: Space, outcome: SearchOutcome) -> list[tuple[float, float]]:
    """Return for each knob the least and the largest value that cannot be told from the chosen one.

    Those of `indistinct` trials, and beyond them half of the distance at which n trials lie in d dimensions, n^(-1/d)
    of the range: between two trials nothing was tried.
    """
    share = shares(space, outcome.trials)
    near, half = share[indistinct(outcome)], 0.5 * len(share) ** (-1.0 / len(space.knobs))
    low, high = np.maximum(near.min(axis=0) - half, 0.0), np.minimum(near.max(axis=0) + half, 1.0)
    return [(k.bounds.value(a), k.bounds.value(b)) for k, a, b in zip(space.knobs, low, high, strict=True)]


def tuning_figure(tuning: Tuning) -> "Figure":
    """Draw the profile of each knob, the map of the two that matter most, and the curve of the budget."""
    from jerkbench.report.plots.sweeps import Map, Profile, search_figure

    space, trials, drawn = tuning.space, tuning.outcome.trials, None
    profiles = [
        Profile(knob.name, values, *profile(space, trials, k), tuning.setting[k], knob.bounds.log)
        for k, (knob, values) in enumerate(zip(space.knobs, np.array(trials.settings).T, strict=True))
    ]
    if len(space.knobs) > 1:
        first, second = importance(space, trials)[:2]
        chosen = [space.knobs[k].share(tuning.setting[k]) for k in (first, second)]
        least = loss_map(space, trials, first, second)
        drawn = Map(space.names[first], space.names[second], least, (chosen[0], chosen[1]))
    title = f"{tuning.name}: {tuning.effort.objective.name}, {len(trials)} settings"
    return search_figure(profiles, trials.means, drawn, budget_curve(trials), title)


# Presets of ours.

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


def write_presets(tuning: Tuning, folder: Path, remarks: str) -> None:
    """Write a preset of each part that was tuned, and an experiment that chooses them.

    Args:
        tuning: the tuned method.
        folder: below which the groups are.
        remarks: the first line of each file, and the note on its runs.
    """
    spec, chosen = tuning.job.spec, {}
    for part in TUNED_PARTS:
        plugin, values = str(spec[part]["name"]), tuning.space.of_part(part, tuning.setting)
        if values or part != "attitude":
            chosen[part] = _name(tuning) if values else plugin
        if values:
            plain = {key: list(own) if isinstance(own, tuple) else own for key, own in spec[part].items()}
            del plain["name"]
            text = _text(remarks, {"defaults": [plugin, "_self_"], **plain, **values})
            write_text(folder / part / f"{_name(tuning)}.yaml", text)
    told = tuning.space.of_part("r_scale", tuning.setting)
    defaults = [{f"override /{part}": preset} for part, preset in chosen.items()]
    whole = {"defaults": [*defaults, "_self_"], **({"r_scale": told} if told else {}), "notes": [remarks]}
    write_text(folder / "experiment" / f"{_name(tuning)}.yaml", f"# @package _global_\n{_text(remarks, whole)}")


def _name(tuning: Tuning) -> str:
    """The name of the experiment."""
    return f"{tuning.name}_tuned".replace("-", "_")


def _text(remarks: str, content: dict[str, Any]) -> str:
    return f"# {remarks}\n{OmegaConf.to_yaml(OmegaConf.create(content))}"


# robot_localization, KF-GINS and our eskf15.

MGAL_PER_MG = 980.665
HOUR_S = 3600.0
UNDECIDED = (0.05, 0.05, 0.06, 0.03, 0.03, 0.06, 0.025, 0.025, 0.04, 0.01, 0.01, 0.02, 0.01, 0.01, 0.015)
"""robot_localization's own process noise, of x y z, roll pitch yaw, their rates, and ax ay az."""

CORRELATION_H = 1.0
"""Correlation time of KF-GINS' biases where our filter has a random walk."""


def other_programs(tuning: Tuning) -> dict[str, str]:
    """Return the files of other programs, by their names: what the setting decides of them, and what does not map."""
    values, spec = _values(tuning), tuning.job.spec
    density, walk = _velocity_density(tuning, values), values.get("filter.accel_walk_mps2_per_sqrt_s")
    noise, rows = _imu_noise(values, density), list(UNDECIDED)
    if density is not None:
        rows[6:9] = [density] * 3
    if walk is not None:
        rows[12:15] = [walk**2] * 3
    own = {key.partition(".")[2]: value for key, value in values.items() if key.startswith("filter.")}
    told = {
        "values": values,
        "density": density,
        "walk": walk,
        "diagonal": np.diag(rows).ravel().tolist() if (density, walk) != (None, None) else [],
        "noise": noise,
        "vrw": noise["vrw"],
        "own": own if spec["filter"]["name"] == "eskf15" else None,
        "gate": _gate(values),
        "adaptation": _adaptation(str(spec["adaptation"]["name"]), _gate(values)),
    }
    names = ("robot_localization.yaml", "kf-gins.yaml", "eskf15.yaml")
    return {name: filled_template(HERE / f"{name}.jinja", {"g": "{:.6g}".format}, **told) for name in names}


def _values(tuning: Tuning) -> dict[str, float]:
    """The numbers of filter, adaptation and r_scale, the tuned ones among them, by name."""
    plain = tuning.space.applied(tuning.job, tuning.setting).spec
    parts: dict[str, dict[str, Any]] = {name: plain[name] for name in ("filter", "adaptation", "r_scale")}
    return {
        f"{part}.{key}": float(value)
        for part, fields in parts.items()
        for key, value in fields.items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }


def _velocity_density(tuning: Tuning, values: dict[str, float]) -> float | None:
    """Density of the velocity's random walk [m2/s3]: sigma_a^2 dt0, or what the filter has in its place."""
    if (sigma := values.get("filter.accel_mps2")) is not None and tuning.interval_s is not None:
        return sigma**2 * tuning.interval_s
    if (walk := values.get("filter.velocity_walk_mps_per_sqrt_s")) is not None:
        return walk**2
    if (walk := values.get("filter.velocity_random_walk_mps_per_sqrt_h")) is not None:
        return walk**2 / HOUR_S
    return None


def _imu_noise(values: dict[str, float], density: float | None) -> dict[str, float | None]:
    """The entries of ``imunoise``; None: the filter says nothing of it."""
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


def _gate(values: dict[str, float]) -> float | None:
    """The Mahalanobis distance beyond which a block is dropped, where the adaptation is such a gate."""
    if (probability := values.get("adaptation.probability")) is None:
        return None
    from scipy.stats import chi2

    return math.sqrt(float(chi2.ppf(probability, 3)))


def _adaptation(name: str, gate: float | None) -> str:
    """Say what becomes of an adaptation; nothing of none."""
    if name == "chi2" and gate:
        distance = f"sqrt(chi2(p, 3)) = {gate:.4g}"
        return f"The adaptation chi2 is a gate, {distance}, in robot_localization; it maps nowhere else."
    if name == "none":
        return ""
    return f"Does not map: the adaptation {name}; without it the tuned noises need not be the best."
