"""The command `jerkbench tune`, which parses the arguments, tunes the methods and writes the results."""

import itertools
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path

import numpy as np
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from jerkbench.campaign.outcome import TUNED_PARTS, preset_overrides, tunings_table, write_tuning
from jerkbench.campaign.runs import R_STREAMS, CampaignRuns, space_of
from jerkbench.campaign.search import Budget, Evaluator, Tuning, objective_of, tune
from jerkbench.campaign.split import Cases, Seeds, by_label, by_seeds, by_time
from jerkbench.contracts import is_attitude_only
from jerkbench.errors import PluginError, require_known
from jerkbench.hydra_app.app import prepared_app
from jerkbench.hydra_app.composition import composed
from jerkbench.hydra_app.configuration import cluster_of, study_folder
from jerkbench.hydra_app.overrides import owner, parsed_override
from jerkbench.jobs.executors import LOCAL, Workers, processors
from jerkbench.jobs.job import Job
from jerkbench.jobs.names import require_sensible
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.rows import shared_inputs
from jerkbench.presets import take_folders, user_folders
from jerkbench.recording import Recording

Arguments = Sequence[str]
"""Arguments of a command."""

METHOD_GROUPS = ("filter", "adaptation", "noise", "engine", "r_scale")
"""Several values of these groups define several methods. Several values of other groups define the scenarios."""


@dataclass
class TuneOptions:
    """The options of `jerkbench tune`, in addition to the options of `jerkbench run`.

    Attributes:
        trials: Number of settings that a search evaluates, including the setting before the search.
        sampler: Name of the sampler: sobol, tpe or cma_es.
        sampler_seed: Seed of the sampler. For sobol, the seed determines the scrambling.
        objective: Name of the objective: rmse, likelihood (of the innovations, without a reference), inclination (error
            of an attitude filter) or auto. The value auto selects inclination if the method is an attitude filter,
            likelihood if the log has no reference, and rmse otherwise.
        split: Split of the runs: seeds, time, recordings, families or auto. The value auto selects seeds, or time if a
            scenario is not random.
        share: With split=time, the fraction of the time that is used for tuning.
        held_out: With split=recordings or families, the names of the data sets or disturbances that are used only for
            the test.
        tune_seeds: Number of seeds for tuning.
        choose_seeds: Number of seeds for the validation of the finalists.
        test_seeds: Number of seeds for the test.
        finalists: Number of the best settings that are evaluated again on the validation seeds.
        knobs: Names of the parameters to tune. If ``knobs`` is empty, all parameters with a range are tuned.
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
    knobs: list[str] = field(default_factory=list)


def _options(overrides: Sequence[str]) -> TuneOptions:
    try:
        merged = OmegaConf.merge(OmegaConf.structured(TuneOptions), OmegaConf.from_dotlist(list(overrides)))
        options: TuneOptions = OmegaConf.to_object(merged)  # type: ignore[assignment]  # it is a TuneOptions
    except OmegaConfBaseException as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise PluginError(f"{error.full_key}: {reason}; `jerkbench tune --help` lists the options.") from error
    require_known("split", options.split, ("auto", "seeds", "time", "recordings", "families"))
    return options


def _combinations(overrides: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Return all combinations of the values that are separated by commas in the overrides."""
    several = []
    for argument in overrides:
        override = parsed_override(argument)
        key, sweeps = override.get_key_element(), override.is_sweep_override()
        several.append([f"{key}={value}" for value in override.sweep_string_iterator()] if sweeps else [argument])
    return tuple(itertools.product(*several))


def tune_all(overrides: Sequence[str], *, several: bool, compare: bool = False) -> None:
    """Tune each method with the same budget, print the results, and write them.

    Args:
        overrides: Options of the tuning and arguments of `jerkbench run`.
        several: Whether several methods are allowed (-m).
        compare: Whether to run the tuned methods on unused seeds afterwards, and to print their table.

    Raises:
        JerkbenchError: A method has no tunable parameter, no runs remain for the tuning, an argument is unknown, or
            several methods are given without -m.
    """
    names_of_options = {f.name for f in fields(TuneOptions)}
    options = _options([override for override in overrides if override.partition("=")[0] in names_of_options])
    others = [override for override in overrides if override.partition("=")[0] not in names_of_options]
    # with filter=attitude_only, the method to tune is the attitude filter
    groups = (*METHOD_GROUPS, "attitude") if "filter=attitude_only" in others else METHOD_GROUPS
    methods = _combinations([override for override in others if owner(override) in groups])
    shared = [override for override in others if owner(override) not in groups]
    scenarios = _combinations(shared)
    if len(methods) > 1 and not several:
        raise PluginError(f"There are {len(methods)} methods; add -m to tune each method with the same budget.")
    compositions = [[composed([*scenario, *method]) for scenario in scenarios] for method in methods]
    config = compositions[0][0].plain
    jobs = [[composition.job() for composition in of_method] for of_method in compositions]
    for job in itertools.chain.from_iterable(jobs):
        require_sensible(job)
    if compare and "experiment" in map(owner, shared):
        raise PluginError("--compare accepts no experiment=NAME; give dataset=... and disturbance=...")
    cluster, count = cluster_of(config), config["workers"] or processors()
    workers, threads = (Workers(), count) if cluster == LOCAL else (Workers(cluster, count), 1)
    folder = study_folder(config) / "tune"
    drives = [shared_inputs().recording(job.scenario, job.draws[0]) for job in jobs[0]]
    only_attitude = is_attitude_only(jobs[0][0].method.filter)
    no_reference = not only_attitude and any(map(_without_reference, drives))
    default = "inclination" if only_attitude else "likelihood" if no_reference else "rmse"
    if no_reference and (options.objective == "rmse" or (compare and "disturbance" in map(owner, shared))):
        raise PluginError("The log has no reference; use disturbance=withhold or objective=likelihood.")
    objective = objective_of(default if options.objective == "auto" else options.objective)
    budget = Budget(options.trials, options.sampler, options.finalists, options.sampler_seed)
    measured = [name for name in R_STREAMS if any(getattr(drive, name) is not None for drive in drives)]
    runs, spaces = CampaignRuns(folder, workers), [space_of(first, options.knobs, measured) for first, *_ in jobs]
    evaluators = [Evaluator(space, objective, runs, threads) for space in spaces]
    cases = [cases_of(of_method, options, config["first_seed"]) for of_method in jobs]
    names = _names([of_method[0] for of_method in jobs])
    unseen = [f"first_seed={first}", f"seeds={options.test_seeds}"] if (first := cases[0].next_seed) else []
    burn_in_s = max([jobs[0][0].protocol.burn_in_s, *(options.share * drive.duration_s for drive in drives)])
    unseen += [f"burn_in_s={burn_in_s:.6g}"] if _split_of(options, jobs[0]) == "time" else []
    unseen += ["disturbance=withhold"] * (no_reference and {"disturbance", "experiment"}.isdisjoint(map(owner, shared)))
    unused = _unused_runs(options, jobs[0], drives, unseen, withhold=no_reference) if compare else []
    with workers, Progress(len(names) * budget.trials, doing="Tuning", unit="settings") as progress:
        tune_one = partial(tune, budget=budget, advance=partial(progress.advance, ()))
        tunings = [tune_one(*method) for method in zip(names, cases, evaluators, strict=True)]
    for tuning, method in zip(tunings, methods, strict=True):
        command = _command(tuning, folder / tuning.name / "conf", shared, method, unseen, several=len(scenarios) > 1)
        print(write_tuning(tuning, folder / tuning.name, command))
    print(tunings_table(tunings), f"\nSettings, presets and trials: {folder}", sep="\n")
    if compare:
        print(f"\nComparison on data that the tuning has not used: {' '.join(unused)}")
        prepared_app(take_folders(_comparison(tunings, methods, shared, unused, folder)))()


def _without_reference(recording: Recording) -> bool:
    """Return whether the recording has no reference positions, or only the fixes that the filters use."""
    fixes, reference_m = recording.position, recording.reference.enu_m
    return reference_m is None or (fixes is not None and np.array_equal(reference_m, fixes.enu_m, equal_nan=True))


def _unused_runs(
    options: TuneOptions, jobs: Sequence[Job], drives: Sequence[Recording], unseen: Arguments, *, withhold: bool
) -> list[str]:
    """Return the arguments that restrict a comparison to runs, recordings or times that the tuning has not used.

    If ``withhold`` is True, some fixes are withheld for the comparison, because the log has no other reference.
    """
    split, arguments = _split_of(options, jobs), [*unseen]
    if split in HELD_OUT:
        names = [f"[{name.replace('+', ',')}]" if "+" in name else name for name in options.held_out]
        arguments.append(f"{HELD_OUT[split]}={','.join(names)}")
    if split == "time" and options.share * max(d.duration_s for d in drives) > min(d.duration_s for d in drives):
        raise PluginError("--compare with split=time needs recordings of similar lengths; compare each recording.")
    if withhold:
        print("The log has no reference: the comparison withholds three of four fixes, and uses them as the reference.")
    return arguments


def _comparison(
    tunings: Sequence[Tuning], methods: Sequence[Arguments], typed: Arguments, unused: Arguments, folder: Path
) -> list[str]:
    """Return the arguments with which `jerkbench run` runs all tuned methods on ``unused`` runs of the same scenarios.

    Each method also runs with its setting before the search.

    Raises:
        PluginError: The methods have different parameters that were not tuned, so that one command cannot run all
            methods.
    """
    each = zip(tunings, methods, strict=True)
    untuned = [
        {argument for argument in _not_tuned(*pair) if owner(argument) != argument.partition("=")[0]} for pair in each
    ]
    if any(others != untuned[0] for others in untuned):
        raise PluginError("--compare needs equal values of all untuned parameters.")
    folders = [*(folder / tuning.name / "conf" for tuning in tunings), *user_folders()]
    presets = [preset for tuning in tunings for preset in preset_overrides(tuning, typed=False)]
    tuned = [preset.partition("=")[2] for preset in presets]
    experiments = ",".join(f"{name.removesuffix('tuned')}untuned,{name}" for name in tuned)
    replaced = {argument.partition("=")[0] for argument in unused} | {"seeds"}
    shared = [override for override in typed if override.partition("=")[0] not in replaced]
    run_options = ["-m", *(argument for path in folders for argument in ("--config-dir", str(path)))]
    return [*run_options, *shared, *sorted(untuned[0]), f"experiment={experiments}", *unused]


HELD_OUT = {"recordings": "dataset", "families": "disturbance"}
"""The groups whose held-out names define the test, for each value of the option ``split``."""


def _split_of(options: TuneOptions, jobs: Sequence[Job]) -> str:
    if options.split != "auto":
        return options.split
    return "seeds" if all(job.scenario.seeded for job in jobs) else "time"


def cases_of(jobs: Sequence[Job], options: TuneOptions, first_seed: int) -> Cases:
    """Return the cases for tuning, for the validation of the finalists, and for the test."""
    seeds = Seeds(options.tune_seeds, options.choose_seeds, options.test_seeds, first_seed)
    split = _split_of(options, jobs)
    if split in HELD_OUT and not options.held_out:
        raise PluginError(f"split={split} needs the names of the {split} for the test; give held_out=[NAME,...].")
    if split == "seeds":
        return by_seeds(jobs, seeds)
    if split == "time":
        return by_time(jobs, seeds, options.share)
    return by_label(jobs, HELD_OUT[split], options.held_out, seeds)


def _names(jobs: Sequence[Job]) -> list[str]:
    """Return a unique name for each method: the filter and the adaptation, or the attitude filter."""
    names = [
        job.spec["attitude"]["name"]
        if is_attitude_only(job.method.filter)
        else f"{job.spec['filter']['name']}-{job.spec['adaptation']['name']}"
        for job in jobs
    ]
    return [f"{name}-{names[:k].count(name) + 1}" if names.count(name) > 1 else name for k, name in enumerate(names)]


def _command(
    tuning: Tuning, presets: Path, typed: Arguments, method: Arguments, unseen: Arguments, *, several: bool
) -> str:
    """Return the command that runs the tuned method on the same scenarios with unused seeds or times."""
    preset_choice = preset_overrides(tuning, typed="experiment" in map(owner, typed))
    folders = [argument for folder in (presets, *user_folders()) for argument in ("--config-dir", str(folder))]
    replaced = {argument.partition("=")[0] for argument in unseen}
    shared = [argument for argument in typed if argument.partition("=")[0] not in replaced]
    return shlex.join(
        ["jerkbench", "run", *["-m"] * several, *folders, *shared, *_not_tuned(tuning, method), *preset_choice, *unseen]
    )


def _not_tuned(tuning: Tuning, method: Sequence[str]) -> list[str]:
    """Return the arguments in ``method`` that set no tuned parameter."""
    tuned = {f"r_scale.{name}" for name in tuning.space.of_part("r_scale", tuning.setting)}
    covered = {part for part in TUNED_PARTS if tuning.space.of_part(part, tuning.setting)} | tuned
    return [override for override in method if not {owner(override), override.partition("=")[0]} & covered]
