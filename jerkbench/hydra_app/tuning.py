"""`jerkbench tune`, from its words to its files."""

import json
import shlex
from collections.abc import Sequence
from pathlib import Path

from jerkbench.cells.cell import Cell
from jerkbench.cells.refusal import refusal
from jerkbench.clusters.cluster import Cluster
from jerkbench.errors import PluginError
from jerkbench.execution.processors import processors
from jerkbench.execution.progress import Progress
from jerkbench.files import write_text
from jerkbench.hydra_app.chosen_cluster import cluster_of
from jerkbench.hydra_app.composition import owner
from jerkbench.hydra_app.configuration import study_folder
from jerkbench.hydra_app.tuning_words import TuneOptions, TuneWords
from jerkbench.hydra_app.words import composed
from jerkbench.results.study_figures.choice import Choice, figures_choice
from jerkbench.sweep.sweep import LOCAL
from jerkbench.tuning.cases import Cases
from jerkbench.tuning.foreign import EXPORTS
from jerkbench.tuning.objectives import objective_of
from jerkbench.tuning.outcome import Effort, Tuning, tune
from jerkbench.tuning.presets import PARTS, preset_words, write_presets
from jerkbench.tuning.search import Budget
from jerkbench.tuning.space import Space, space_of
from jerkbench.tuning.splits import Seeds, by_families, by_recordings, by_seeds, by_time
from jerkbench.tuning.summary import record, summary, table
from jerkbench.tuning.trials import trial_table


def tune_all(words: TuneWords) -> None:
    """Tune each method with the same budget; print what came out, and write it.

    Raises:
        JerkbenchError: there is nothing to tune, or to tune on; a word is unknown.
    """
    options = words.options
    methods = [[composed([*scenario, *method]) for scenario in words.scenarios] for method in words.methods]
    config = methods[0][0].config
    cells = [[composition.cell() for composition in scenarios] for scenarios in methods]
    chosen = cluster_of(config)
    effort = _effort(options, config.workers, None if chosen == LOCAL else chosen)
    efforts = [effort for _ in cells]
    spaces = [space_of(scenarios[0], options.knobs) for scenarios in cells]
    for scenarios in cells:
        _require_sense(scenarios)
    cases = [cases_of(scenarios, options, config.first_seed) for scenarios in cells]
    folder = study_folder(config) / "tune"
    names = _names([scenarios[0] for scenarios in cells])
    tunings = _tuned(names, cases, spaces, efforts, folder)
    for tuning, method in zip(tunings, words.methods, strict=True):
        own = folder / tuning.name
        command = _command(tuning, own / "conf", words, method)
        _write(tuning, own, command, figures=figures_choice(config.figures) is not Choice.NONE)
    print(table(tunings))
    print(f"\nSettings, presets and trials: {folder}")


def cases_of(cells: Sequence[Cell], options: TuneOptions, first_seed: int) -> Cases:
    """Return what is tuned, chosen and tested on."""
    seeds = Seeds(options.tune_seeds, options.choose_seeds, options.test_seeds, first_seed)
    split = options.split
    if split == "auto":
        split = "seeds" if all(cell.seeded for cell in cells) else "time"
    if split in ("recordings", "families") and not options.held_out:
        raise PluginError(f"split={split} needs the names to test on: held_out=[...]")
    if split == "seeds":
        return by_seeds(cells, seeds)
    if split == "time":
        return by_time(cells, seeds, options.share)
    return (by_recordings if split == "recordings" else by_families)(cells, options.held_out, seeds)


def _effort(options: TuneOptions, workers: int, cluster: Cluster | None) -> Effort:
    budget = Budget(options.trials, options.sampler, options.finalists, options.sampler_seed)
    objective, knobs = objective_of(options.objective), tuple(options.knobs)
    return Effort(objective, budget, options.restarts, knobs, workers or processors(), cluster)


def _require_sense(cells: Sequence[Cell]) -> None:
    for cell in cells:
        if reason := refusal(cell):
            raise PluginError(f"This combination makes no sense: {reason}.")


def _tuned(
    names: Sequence[str], cases: Sequence[Cases], spaces: Sequence[Space], efforts: Sequence[Effort], folder: Path
) -> list[Tuning]:
    tunings = []
    count = sum(effort.budget.trials * effort.restarts for effort in efforts)
    with Progress(count, doing="Tuning", unit="settings") as progress:

        def advance(settings: int) -> None:
            for _ in range(settings):
                progress.advance()

        for name, own, space, effort in zip(names, cases, spaces, efforts, strict=True):
            tunings.append(tune(name, own, space, effort, folder / name, advance))
    return tunings


def _names(cells: Sequence[Cell]) -> list[str]:
    """A name for each method, fit for a folder: filter and adaptation, with a number where that is not enough."""
    names = [f"{cell.spec['filter']['name']}-{cell.spec['adaptation']['name']}" for cell in cells]
    return [f"{name}-{names[:k].count(name) + 1}" if names.count(name) > 1 else name for k, name in enumerate(names)]


def _command(tuning: Tuning, presets: Path, words: TuneWords, method: Sequence[str]) -> str:
    """The command that runs what was tuned: its presets, on the data sets and under the faults of the tuning."""
    chosen = preset_words(tuning, typed="experiment" in map(owner, words.shared))
    tuned = {f"r_scale.{name}" for name in tuning.space.of_part("r_scale", tuning.setting)}
    covered = {part for part in PARTS if tuning.space.of_part(part, tuning.setting)} | tuned
    kept = [word for word in method if not {owner(word), word.partition("=")[0]} & covered]
    several = ["-m"] if len(words.scenarios) > 1 else []
    return shlex.join(["jerkbench", "run", *several, "--config-dir", str(presets), *words.shared, *kept, *chosen])


def _write(tuning: Tuning, folder: Path, command: str, *, figures: bool) -> None:
    """Write the page, the numbers, the trials, the presets, the files for other programs, and the figures."""
    outcome, objective = tuning.outcome, tuning.effort.objective.name
    remarks = f"Tuned by jerkbench: {objective}, {len(outcome.trials)} settings, {tuning.cases.split}."
    write_presets(tuning, folder / "conf", remarks)
    page = f"{summary(tuning)}\nTake it with: {command}\n"
    write_text(folder / "tuning.md", page)
    write_text(folder / "tuning.json", json.dumps(record(tuning), indent=1) + "\n")
    scenarios = [case.scenario for case in tuning.cases.tune]
    trials = trial_table(outcome.trials, tuning.space.names, scenarios)
    write_text(folder / "trials.csv", trials.to_csv(index=False))
    for name, export in EXPORTS.items():
        write_text(folder / "export" / name, export(tuning))
    print(page)
    if figures:
        from jerkbench.report.plots.figures import save_figure
        from jerkbench.tuning.figures import tuning_figure

        save_figure(tuning_figure(tuning), folder / "search.png")
        print(f"Figure: {folder / 'search.png'}\n")
