"""Real recordings without an IMU: each adaptation against the equally tuned plain filter of its model.

    python experiments/journeys/journeys.py FOLDER                       run all methods, store the rows, fill the page
    python experiments/journeys/journeys.py                              fill the page from the stored rows
    python experiments/journeys/journeys.py FOLDER RESULTS METHOD ...    run some methods (FILTER+ADAPTATION)

FOLDER contains `journeys` and `degraded`. Runs that are stored in RESULTS/runs (results/journeys) are not repeated.
"""

import hashlib
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import left_out
import pandas as pd
import yaml
from left_out import Method, Taken

from jerkbench.arrays import FloatArray
from jerkbench.campaign.runs import CampaignRuns, FaultScenario, MethodSpec
from jerkbench.files import filled
from jerkbench.jobs.job import Protocol
from jerkbench.presets import config_folder

PROTOCOL, PAGE = (Path(__file__).with_name(name) for name in ("protocol.yaml", "README.md"))
RESULTS = Path(__file__).parents[2] / "results" / "journeys"
PLAIN = ("constant_velocity", left_out.PLAIN)
FIRST, UNSHIFTED, GAPS = "as planned", "stamps as recorded", "gaps count"

Errors = Mapping[Method, FloatArray]


@cache
def protocol() -> dict[str, Any]:
    """Return the protocol: the populations with their recordings, and the variants of the evaluation."""
    values: dict[str, Any] = yaml.safe_load(PROTOCOL.read_text(encoding="utf-8"))
    return values


@cache
def experiment() -> dict[str, Any]:
    """Return the experiment: the methods, and the scoring."""
    values: dict[str, Any] = yaml.safe_load((config_folder() / "experiment/journeys.yaml").read_text(encoding="utf-8"))
    return values


def digest() -> str:
    """Return the first 12 digits of the SHA-256 of the protocol and the experiment."""
    return hashlib.sha256(repr((protocol(), experiment())).encode()).hexdigest()[:12]


def taken(population: str) -> Taken:
    """Return the recordings of a population with their trips and groups."""
    groups = protocol()["populations"][population]["groups"]
    flat = [(name, trip, group) for group, trips in groups.items() for trip, names in trips.items() for name in names]
    return Taken(*map(list, zip(*flat, strict=True)))


def scenarios(folder: Path, variant: str) -> dict[str, FaultScenario]:
    """Return the scenario of each recording. For a variant, recordings that it does not change are left out."""
    known, found = protocol(), {}
    changes, scoring = known["variants"][variant], experiment()["disturbance"]["score_moving"]
    for population, about in known["populations"].items():
        for name in taken(population).recording:
            group = name.partition("/")[0]
            shift_s = changes.get("clock_shift_s", known["clock_shift_s"].get(group, 0.0))
            recorded = {"name": "journey", "folder": str(folder / "journeys" / name), "clock_shift_s": shift_s}
            degraded = {"name": name, "folder": str(folder / "degraded" / name)}
            counted = {"name": "score_moving", "rate_hz": about["rate_hz"], **scoring, **changes}
            counted.pop("clock_shift_s", None)
            if variant != UNSHIFTED or group in known["clock_shift_s"]:
                dataset = degraded if name in known["degraded"] else recorded
                found[name] = FaultScenario(population, dataset, name, counted)
    return found


def methods_named(names: Sequence[str] = ()) -> list[MethodSpec]:
    """Return all filters with all adaptations, and the filters for comparison; or only the methods ``names``."""
    models, rules = (experiment()["hydra"]["sweeper"]["params"][key].split(",") for key in ("filter", "adaptation"))
    compared = [MethodSpec(model, {"name": left_out.PLAIN}, {}) for model in protocol()["filters_beside"]]
    every = [*(MethodSpec.named(model, rule) for model in models for rule in rules), *compared]
    return [one for one in every if not names or one.name.replace(" ", "") in names]


def run(folder: Path, results: Path, names: Sequence[str]) -> pd.DataFrame:
    """Run all settings of all methods. The variant in which gaps count runs only the selected settings."""
    methods, runs = methods_named(names), CampaignRuns(results / "runs")
    limits = Protocol(divergence_limit_m=float(experiment()["divergence_limit_m"]))

    def rows(variant: str, only: dict[Method, set[int]] | None = None) -> pd.DataFrame:
        found = left_out.setting_rows(scenarios(folder, variant), methods, limits, runs, only=only)
        return found.assign(variant=variant)

    made = pd.concat([rows(FIRST), rows(UNSHIFTED)], ignore_index=True)
    chosen: dict[Method, set[int]] = {PLAIN: {0}}
    for population in protocol()["populations"]:
        for method, loss in errors(made, population).items():
            best = left_out.settings_elsewhere(loss, taken(population))
            chosen.setdefault(method, set()).update(best.ravel().tolist())
    return pd.concat([made, rows(GAPS, chosen)], ignore_index=True)


def errors(rows: pd.DataFrame, population: str, variant: str = FIRST) -> Errors:
    """Return the log errors (48, n) of all settings of each method, also for recordings that do not change."""
    of, found = taken(population), rows[rows["variant"] == variant]
    rest = rows[(rows["variant"] == FIRST) & ~rows["recording"].isin(set(found["recording"]))]
    complete = pd.concat([found, rest]).astype(dict.fromkeys(left_out.COLUMNS[:3], str))
    return left_out.log_errors(complete, of.recording, PLAIN)


def tuned(rows: pd.DataFrame, population: str, variant: str = FIRST) -> Errors:
    """Return the log errors (16, n) of each method, tuned without the group of the recording."""
    of, found = taken(population), errors(rows, population, variant)
    if variant != GAPS:
        return {method: left_out.tuned_elsewhere(loss, of) for method, loss in found.items()}
    planned, columns = errors(rows, population), range(len(of.recording))
    best = {method: left_out.settings_elsewhere(loss, of) for method, loss in planned.items()}
    return {method: loss[best[method], columns] for method, loss in found.items()}


def sentence(rows: pd.DataFrame, population: str, variant: str = FIRST) -> str:
    """Return the result of the average adaptation as one line."""
    average = left_out.average_method(tuned(rows, population, variant))
    return left_out.ratio_sentence(average, taken(population), f"{population[2:]} trip")


def parts(rows: pd.DataFrame) -> dict[str, str]:
    """Return the parts of the page."""
    populations = list(protocol()["populations"])
    made = {"average": "\n".join(f"- **{name}**: {sentence(rows, name)}" for name in populations)}
    varied = [(UNSHIFTED, "J-UWB"), *((GAPS, name) for name in populations)]
    made["variants"] = "\n".join(
        f"- Variant `{variant}`, {name}: {sentence(rows, name, variant)}" for variant, name in varied
    )
    shown = ("gnss_only", "constant_velocity", "acceleration", "imm")
    for name in populations:
        losses, of = tuned(rows, name), taken(name)
        plain = {model: losses[model, left_out.PLAIN] for model in shown}
        made[f"{name}, errors"] = left_out.error_table(plain, of, "trip")
        made[name] = left_out.ratio_table(losses, of, "trip")
    return made


def main() -> None:
    """Run the methods if a folder is given, and fill the page."""
    arguments = sys.argv[1:]
    results = Path(arguments[1]) if arguments[1:] else RESULTS
    if arguments:
        folder = Path(arguments[0])
        left_out.store(results, run(folder, results, arguments[2:]), scenarios(folder, FIRST), digest())
    rows = pd.read_parquet(results / left_out.ROWS)
    print(f"Protocol {digest()}.", *(f"{name}: {sentence(rows, name)}" for name in protocol()["populations"]), sep="\n")
    if results == RESULTS:
        of_page = parts(rows)
        PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), of_page), encoding="utf-8")
        left_out.answer(RESULTS, "20 real trips without an IMU", "journeys", of_page["average"], "trip")


if __name__ == "__main__":
    main()
