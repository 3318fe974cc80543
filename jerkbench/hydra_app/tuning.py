"""`jerkbench tune`, from its words to its files."""

import itertools
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from jerkbench.campaign.outcome import TUNED_PARTS, preset_words, tunings_table, write_figure, write_tuning
from jerkbench.campaign.runs import CampaignRuns
from jerkbench.campaign.search import Budget, Evaluator, Tuning, objective_of, tune
from jerkbench.campaign.space import R_STREAMS, space_of
from jerkbench.campaign.split import Cases, Seeds, by_label, by_seeds, by_time
from jerkbench.contracts import is_attitude_only
from jerkbench.errors import PluginError, require_known
from jerkbench.hydra_app.app import prepared_app
from jerkbench.hydra_app.composition import composed
from jerkbench.hydra_app.configuration import cluster_of, study_folder
from jerkbench.hydra_app.overrides import owner, parsed_override
from jerkbench.jobs.executors import LOCAL, Workers, processors
from jerkbench.jobs.inputs import shared_inputs
from jerkbench.jobs.job import Job
from jerkbench.jobs.names import require_sensible
from jerkbench.jobs.progress import Progress
from jerkbench.presets import take_folders, user_folders
from jerkbench.report import Choice, figures_choice

METHOD_GROUPS = ("filter", "adaptation", "noise", "engine", "r_scale")
"""Groups of which several values are several methods; several of the others are scenarios of one tuning."""

ATTITUDE_ALONE = "filter=attitude_only"
"""With this word the attitude filter is the method."""


@dataclass
class TuneOptions:
    """The options of `jerkbench tune` beside those of `jerkbench run`.

    Attributes:
        trials: settings that are tried, the one before the search among them.
        sampler: sobol, tpe or cma_es.
        sampler_seed: another one is another scramble.
        objective: rmse, likelihood (of the innovations), which needs no reference, or inclination, of an attitude
            filter alone; auto: this one there, else rmse.
        split: auto (seeds, or time where nothing is random), seeds, time, recordings or families.
        share: with split=time, the share of the time to tune on.
        held_out: with split=recordings or families, names of the data sets or disturbances to test on.
        tune_seeds: number of seeds to tune on.
        choose_seeds: number of seeds to choose among the finalists on.
        test_seeds: number of seeds to test on.
        finalists: how many of the best are tried again on the seeds to choose on.
        restarts: searches; the first one counts, the others show how much is luck.
        knobs: names of the parameters to change; empty: all that have a range.
    """

    trials: int = 64
    sampler: str = "sobol"
    sampler_seed: int = 0
    objective: str = "auto"
    split: str = "auto"
    share: float = 0.5
    held_out: list[str] = field(default_factory=list)
    tune_seeds: int = 16
    choose_seeds: int = 16
    test_seeds: int = 40
    finalists: int = 8
    restarts: int = 1
    knobs: list[str] = field(default_factory=list)


def _options(words: Sequence[str]) -> TuneOptions:
    try:
        merged = OmegaConf.merge(OmegaConf.structured(TuneOptions), OmegaConf.from_dotlist(list(words)))
        options: TuneOptions = OmegaConf.to_object(merged)  # type: ignore[assignment]  # it is of that class
    except OmegaConfBaseException as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise PluginError(f"{error.full_key}: {reason}; `jerkbench tune --help` says what it takes.") from error
    require_known("split", options.split, ("auto", "seeds", "time", "recordings", "families"))
    return options


def _combinations(words: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Return every combination of the values that are separated by commas."""
    several = []
    for word in words:
        override = parsed_override(word)
        key, sweeps = override.get_key_element(), override.is_sweep_override()
        several.append([f"{key}={value}" for value in override.sweep_string_iterator()] if sweeps else [word])
    return tuple(itertools.product(*several))


def tune_all(words: Sequence[str], *, several: bool, compare: bool = False) -> None:
    """Tune each method with the same budget, print the results, and write them.

    Args:
        words: Options of the tuning and arguments of `jerkbench run`.
        several: Whether several methods are allowed (-m).
        compare: Whether to run the tuned methods on seeds that the tuning has not used, and print their table.

    Raises:
        JerkbenchError: There is nothing to tune, or to tune on; an argument is unknown; several methods without -m.
    """
    names_of_options = {f.name for f in fields(TuneOptions)}
    options = _options([word for word in words if word.partition("=")[0] in names_of_options])
    others = [word for word in words if word.partition("=")[0] not in names_of_options]
    groups = (*METHOD_GROUPS, "attitude") if ATTITUDE_ALONE in others else METHOD_GROUPS
    methods = _combinations([word for word in others if owner(word) in groups])
    shared = [word for word in others if owner(word) not in groups]
    scenarios = _combinations(shared)
    if len(methods) > 1 and not several:
        raise PluginError(f"There are {len(methods)} methods; add -m to tune each of them with the same budget.")
    compositions = [[composed([*scenario, *method]) for scenario in scenarios] for method in methods]
    config = compositions[0][0].plain
    jobs = [[composition.job() for composition in of_method] for of_method in compositions]
    for job in itertools.chain.from_iterable(jobs):
        require_sensible(job)
    cluster, count = cluster_of(config), config["workers"] or processors()
    workers, threads = (Workers(), count) if cluster == LOCAL else (Workers(cluster, count), 1)
    folder = study_folder(config) / "tune"
    runs = CampaignRuns(folder, workers)
    usual = "inclination" if is_attitude_only(jobs[0][0].method.filter) else "rmse"
    objective = objective_of(usual if options.objective == "auto" else options.objective)
    budget = Budget(options.trials, options.sampler, options.finalists, options.sampler_seed, options.restarts)
    drives = [shared_inputs().undisturbed(job.scenario.dataset, job.draws[0]) for job in jobs[0]]
    measured = [name for name in R_STREAMS if any(getattr(drive, name) is not None for drive in drives)]
    evaluators = [Evaluator(space_of(own[0], options.knobs, measured), objective, runs, threads) for own in jobs]
    cases = [cases_of(own, options, config["first_seed"]) for own in jobs]
    names = _names([own[0] for own in jobs])
    settings = len(names) * budget.trials * budget.restarts
    with workers, Progress(settings, doing="Tuning", unit="settings") as progress:
        advance = partial(progress.advance, ())
        tunings = [tune(*own, budget, advance) for own in zip(names, cases, evaluators, strict=True)]
    for tuning, method in zip(tunings, methods, strict=True):
        presets = folder / tuning.name / "conf"
        command = _command(tuning, presets, shared, method, several=len(scenarios) > 1)
        print(write_tuning(tuning, folder / tuning.name, command))
        if figures_choice(config["figures"]) is not Choice.NONE:
            print(f"Figure: {write_figure(tuning, folder / tuning.name)}\n")
    print(tunings_table(tunings))
    print(f"\nSettings, presets and trials: {folder}")
    if compare:
        prepared_app(take_folders(_comparison(tunings, methods, shared, options, folder)))()


def _comparison(
    tunings: Sequence[Tuning],
    methods: Sequence[Sequence[str]],
    typed: Sequence[str],
    options: TuneOptions,
    folder: Path,
) -> list[str]:
    """The arguments of `jerkbench run` that run all tuned methods on the same scenarios, on unused seeds.

    Raises:
        PluginError: The presets do not contain all that was typed, so one command cannot run all methods.
    """
    each = zip(tunings, methods, strict=True)
    kept = [{word for word in _not_tuned(*own) if owner(word) != word.partition("=")[0]} for own in each]
    if "experiment" in map(owner, typed) or any(own != kept[0] for own in kept):
        raise PluginError("--compare needs methods without experiment=, and the same other parameters for all of them.")
    folders = [*(folder / tuning.name / "conf" for tuning in tunings), *user_folders()]
    experiments = ",".join(word.partition("=")[2] for tuning in tunings for word in preset_words(tuning, typed=False))
    first_seed = tunings[0].cases.next_seed
    seeds = [f"first_seed={first_seed}", f"seeds={options.test_seeds}"] if first_seed else []
    shared = [word for word in typed if not word.startswith(("first_seed=", "seeds="))]
    chosen = ["-m", *(word for path in folders for word in ("--config-dir", str(path)))]
    return [*chosen, *shared, *sorted(kept[0]), f"experiment={experiments}", *seeds]


def cases_of(jobs: Sequence[Job], options: TuneOptions, first_seed: int) -> Cases:
    """Return the cases to tune, to choose and to test on."""
    seeds = Seeds(options.tune_seeds, options.choose_seeds, options.test_seeds, first_seed)
    split = options.split
    if split == "auto":
        split = "seeds" if all(job.scenario.seeded for job in jobs) else "time"
    if split in ("recordings", "families") and not options.held_out:
        raise PluginError(f"split={split} needs the names to test on: held_out=[...]")
    if split == "seeds":
        return by_seeds(jobs, seeds)
    if split == "time":
        return by_time(jobs, seeds, options.share)
    return by_label(jobs, "dataset" if split == "recordings" else "disturbance", options.held_out, seeds)


def _names(jobs: Sequence[Job]) -> list[str]:
    """The name of the folder of each method: filter and adaptation, or the attitude filter; with a number if needed."""
    names = [
        job.spec["attitude"]["name"]
        if is_attitude_only(job.method.filter)
        else f"{job.spec['filter']['name']}-{job.spec['adaptation']['name']}"
        for job in jobs
    ]
    return [f"{name}-{names[:k].count(name) + 1}" if names.count(name) > 1 else name for k, name in enumerate(names)]


def _command(tuning: Tuning, presets: Path, typed: Sequence[str], method: Sequence[str], *, several: bool) -> str:
    """The command that runs the tuned method on the same scenarios, with seeds that the tuning has not used."""
    chosen = preset_words(tuning, typed="experiment" in map(owner, typed))
    folders = [word for folder in (presets, *user_folders()) for word in ("--config-dir", str(folder))]
    unseen = [f"first_seed={tuning.cases.next_seed}"] if tuning.cases.next_seed else []
    shared = [word for word in typed if not (unseen and word.startswith("first_seed="))]
    return shlex.join(
        ["jerkbench", "run", *["-m"] * several, *folders, *shared, *_not_tuned(tuning, method), *chosen, *unseen]
    )


def _not_tuned(tuning: Tuning, method: Sequence[str]) -> list[str]:
    """The arguments of a method that the presets of its tuning do not contain."""
    tuned = {f"r_scale.{name}" for name in tuning.space.of_part("r_scale", tuning.setting)}
    covered = {part for part in TUNED_PARTS if tuning.space.of_part(part, tuning.setting)} | tuned
    return [word for word in method if not {owner(word), word.partition("=")[0]} & covered]
