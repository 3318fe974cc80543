"""`jerkbench tune`, from its words to its files."""

import itertools
import json
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from jerkbench.contracts import is_attitude_only
from jerkbench.errors import PluginError, require_known
from jerkbench.files import write_text
from jerkbench.hydra_app.composition import composed
from jerkbench.hydra_app.configuration import cluster_of, study_folder
from jerkbench.hydra_app.overrides import owner, parsed_override
from jerkbench.jobs.executors import LOCAL, Workers, processors
from jerkbench.jobs.inputs import shared_inputs
from jerkbench.jobs.job import Job
from jerkbench.jobs.names import require_sensible
from jerkbench.jobs.progress import Progress
from jerkbench.presets import user_folders
from jerkbench.report import Choice, figures_choice
from jerkbench.report.review import TUNED
from jerkbench.report.writers import passive
from jerkbench.tuning.entrant import Site
from jerkbench.tuning.evaluate import objective_of, trial_table
from jerkbench.tuning.outcome import (
    TUNED_PARTS,
    other_programs,
    preset_words,
    record,
    tuning_page,
    tunings_table,
    write_presets,
)
from jerkbench.tuning.search import Budget, Effort, Tuning, tune
from jerkbench.tuning.space import R_STREAMS, space_of
from jerkbench.tuning.splits import Cases, Seeds, by_families, by_recordings, by_seeds, by_time

# The words behind `jerkbench tune`: the tuning's own, and those of `jerkbench run`, which may have
# several values.

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
    known = ("auto", "seeds", "time", "recordings", "families")
    require_known("split", options.split, known)
    if options.restarts < 1:
        raise PluginError(f"restarts is {options.restarts}; at least one search is needed.")
    return options


def _combinations(words: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Return every combination of the values that are separated by commas."""
    several = []
    for word in words:
        override = parsed_override(word)
        key, sweeps = override.get_key_element(), override.is_sweep_override()
        several.append([f"{key}={value}" for value in override.sweep_string_iterator()] if sweeps else [word])
    return tuple(itertools.product(*several))


def tune_all(words: Sequence[str], *, several: bool) -> None:
    """Tune each method with the same budget; print what came out, and write it.

    Args:
        words: those of the tuning, and of `jerkbench run`.
        several: whether several methods were asked for (-m).

    Raises:
        JerkbenchError: there is nothing to tune, or to tune on; a word is unknown; several methods without -m.
    """
    names_of_options = {f.name for f in fields(TuneOptions)}
    own = [word for word in words if word.partition("=")[0] in names_of_options]
    others = [word for word in words if word not in own]
    groups = (*METHOD_GROUPS, "attitude") if ATTITUDE_ALONE in others else METHOD_GROUPS
    words_of_methods = _combinations([word for word in others if owner(word) in groups])
    if len(words_of_methods) > 1 and not several:
        count = len(words_of_methods)
        raise PluginError(f"There are {count} methods; add -m to tune each of them with the same budget.")
    shared = [word for word in others if owner(word) not in groups]
    options, words_of_scenarios = _options(own), _combinations(shared)
    methods = [[composed([*scenario, *method]) for scenario in words_of_scenarios] for method in words_of_methods]
    config = methods[0][0].plain
    jobs = [[composition.job() for composition in scenarios] for scenarios in methods]
    chosen = cluster_of(config)
    count = config["workers"] or processors()
    workers, threads = (Workers(), count) if chosen == LOCAL else (Workers(chosen, count), 1)
    usual = "inclination" if is_attitude_only(jobs[0][0].method.filter) else "rmse"
    objective = objective_of(usual if options.objective == "auto" else options.objective)
    budget = Budget(options.trials, options.sampler, options.finalists, options.sampler_seed)
    effort = Effort(objective, budget, options.restarts, threads)
    for job in itertools.chain.from_iterable(jobs):
        require_sensible(job)
    drives = [shared_inputs().undisturbed(job.scenario.dataset, job.draws[0]) for job in jobs[0]]
    measured = [name for name in R_STREAMS if any(getattr(drive, name) is not None for drive in drives)]
    spaces = [space_of(scenarios[0], options.knobs, measured) for scenarios in jobs]
    cases = [cases_of(scenarios, options, config["first_seed"]) for scenarios in jobs]
    folder = study_folder(config) / "tune"
    names = _names([scenarios[0] for scenarios in jobs])
    settings = len(names) * budget.trials * effort.restarts
    with workers, Progress(settings, doing="Tuning", unit="settings") as progress:
        advance, site = partial(progress.advance, ()), Site(folder, workers)
        each = zip(names, cases, spaces, strict=True)
        tunings = [tune(name, own, space, effort, site, advance) for name, own, space in each]
    for tuning, method in zip(tunings, words_of_methods, strict=True):
        into = folder / tuning.name
        command = _command(tuning, into / "conf", shared, method, several=len(words_of_scenarios) > 1)
        _write(tuning, into, command, figures=figures_choice(config["figures"]) is not Choice.NONE)
    print(tunings_table(tunings))
    print(f"\nSettings, presets and trials: {folder}")


def cases_of(jobs: Sequence[Job], options: TuneOptions, first_seed: int) -> Cases:
    """Return what is tuned, chosen and tested on."""
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
    return (by_recordings if split == "recordings" else by_families)(jobs, options.held_out, seeds)


def _names(jobs: Sequence[Job]) -> list[str]:
    """A name for each method, fit for a folder: filter and adaptation, with a number where that is not enough.

    An attitude filter alone has its own.
    """
    names = [
        job.spec["attitude"]["name"]
        if is_attitude_only(job.method.filter)
        else f"{job.spec['filter']['name']}-{job.spec['adaptation']['name']}"
        for job in jobs
    ]
    return [f"{name}-{names[:k].count(name) + 1}" if names.count(name) > 1 else name for k, name in enumerate(names)]


def _command(tuning: Tuning, presets: Path, typed: Sequence[str], method: Sequence[str], *, several: bool) -> str:
    """The command that runs what was tuned: its presets, where it was tuned, on seeds that the tuning has not used."""
    chosen = preset_words(tuning, typed="experiment" in map(owner, typed))
    tuned = {f"r_scale.{name}" for name in tuning.space.of_part("r_scale", tuning.setting)}
    covered = {part for part in TUNED_PARTS if tuning.space.of_part(part, tuning.setting)} | tuned
    kept = [word for word in method if not {owner(word), word.partition("=")[0]} & covered]
    folders = [word for folder in (presets, *user_folders()) for word in ("--config-dir", str(folder))]
    cases = [case for part in (tuning.cases.tune, tuning.cases.choose, tuning.cases.test) for case in part]
    unseen = [f"first_seed={max(case.draws[-1] for case in cases) + 1}"] if cases[0].scenario.seeded else []
    shared = [word for word in typed if not (unseen and word.startswith("first_seed="))]
    return shlex.join(["jerkbench", "run", *["-m"] * several, *folders, *shared, *kept, *chosen, *unseen])


def _write(tuning: Tuning, folder: Path, command: str, *, figures: bool) -> None:
    """Write the page, the numbers, the trials, the presets, the files for other programs, and the figures."""
    outcome, effort = tuning.outcome, tuning.effort
    budget = f"trials={len(outcome.trials)}, finalists={effort.budget.finalists}, sampler={effort.budget.sampler}"
    remarks = f"{TUNED}objective={effort.objective.name}, {budget}; {tuning.cases.split}."
    write_presets(tuning, folder / "conf", remarks)
    page = f"{passive(tuning_page(tuning))}\nTake it with: {command}\n"
    write_text(folder / "tuning.md", page)
    write_text(folder / "tuning.json", json.dumps(record(tuning), indent=1) + "\n")
    scenarios = [case.labels.scenario for case in tuning.cases.tune]
    trials = trial_table(outcome.trials, tuning.space.names, scenarios)
    write_text(folder / "trials.csv", trials.to_csv(index=False, lineterminator="\n"))
    for name, text in other_programs(tuning).items() if not is_attitude_only(tuning.job.method.filter) else ():
        write_text(folder / "export" / name, text)
    print(page)
    if figures:
        from jerkbench.report.plots.style import save_figure
        from jerkbench.tuning.outcome import tuning_figure

        save_figure(tuning_figure(tuning), folder / "search.png")
        print(f"Figure: {folder / 'search.png'}\n")
