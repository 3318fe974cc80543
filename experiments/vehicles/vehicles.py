"""Semi-real vehicles: real cars with a MEMS IMU and the errors of real receivers, every adaptation tuned alike.

    python experiments/vehicles/vehicles.py FOLDER                       run all of it, keep the rows, fill the page
    python experiments/vehicles/vehicles.py                              fill the page from the rows that are kept
    python experiments/vehicles/vehicles.py FOLDER RESULTS METHOD ...    some methods (FILTER+ADAPTATION), elsewhere

FOLDER holds `kitti`, `journeys` and `degraded`. A run that is stored in RESULTS/runs (results/vehicles) is not done
again.
"""

import hashlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from jerkbench import plugins
from jerkbench.arrays import FloatArray
from jerkbench.campaign.runs import CampaignRuns, FaultScenario, MethodSpec
from jerkbench.files import filled
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.names import choose
from jerkbench.presets import config_folder
from jerkbench.simulation.traces import Trace, trace_of, write_trace

HERE = Path(__file__).parent
sys.path.append(str(HERE.parent / "journeys"))
import journeys  # noqa: E402 - the folder beside
import left_out  # noqa: E402
from left_out import Method, Taken  # noqa: E402

PAGE, RESULTS = HERE / "README.md", HERE.parents[1] / "results" / "vehicles"
PLAIN = ("baseline", left_out.PLAIN)
MODELS = ("baseline", "jerk")
BESIDE = ("gnss_only", "acceleration", "bias", "eskf15")
"""Without adaptation: what the errors look like."""
UNSOUND = ("2011_09_30_drive_0028", "2011_09_26_drive_0093")
"""Drives whose places have steps."""
EXPERIMENT: dict[str, Any] = yaml.safe_load((config_folder() / "experiment/vehicles.yaml").read_text(encoding="utf-8"))


def traces(folder: Path, results: Path) -> dict[str, tuple[Path, Trace]]:
    """Make the trace of each journey, of its first receiver, and its file; the shortest first."""
    of, made = journeys.taken("J-GNSS"), {}
    first = {ride: name for name, ride in reversed(list(zip(of.recording, of.replicate, strict=True)))}
    scenarios = journeys.scenarios(folder, journeys.FIRST)
    for ride in of.replicates:
        recording = plugins.create("dataset", choose("dataset", scenarios[first[ride]].dataset).plain).load(0)
        trace, path = trace_of(recording), results / "traces" / f"{ride}.parquet"
        write_trace(trace, path)
        made[ride] = (path, trace)
    return dict(sorted(made.items(), key=lambda item: item[1][1].period_s))


def start_s(trace: Trace, duration_s: float, half: int) -> float:
    """Return where the most fixes are in the first (0) or second half of a trace: without a reference it has gaps."""
    last = max(trace.period_s - duration_s, 0.0) / 2
    starts = np.arange(half * last, (half + 1) * last + 0.1, 1.0)
    fixes = np.searchsorted(trace.t_s, starts + duration_s) - np.searchsorted(trace.t_s, starts)
    return round(float(starts[fixes.argmax()]), 1)


def scenarios(folder: Path, results: Path) -> dict[str, FaultScenario]:
    """Return two drives for each trace, short ones with short traces, so that no trace begins anew."""
    index = pd.read_csv(folder / "kitti" / "index.csv").sort_values(["dur_s", "drive"], kind="stable")
    drives = index[~index["drive"].isin(UNSOUND)]
    made = traces(folder, results)
    found = {}
    for k, (drive, duration_s) in enumerate(zip(drives["drive"], drives["dur_s"], strict=True)):
        ride, (path, trace) = list(made.items())[k // 2]
        file = f"{drive}.parquet"
        files = dict.fromkeys(("imu_file", "position_file", "reference_file"), file)
        dataset = {"name": "kitti_drive", **EXPERIMENT["dataset"], **files, "folder": str(folder / "kitti")}
        replayed = {"trace": str(path), "start_s": start_s(trace, duration_s, k % 2)}
        disturbance = {"name": "mems_car", "replayed_gnss": replayed}
        found[f"{ride}, {drive}"] = FaultScenario("V", dataset, f"{ride} {drive}", disturbance)
    return found


def methods_named(names: Sequence[str]) -> list[MethodSpec]:
    """Return both filters with every adaptation, and what is shown beside; or those that are named."""
    rules = EXPERIMENT["hydra"]["sweeper"]["params"]["adaptation"].split(",")
    pairs = [(model, rule) for model in MODELS for rule in rules] + [(model, left_out.PLAIN) for model in BESIDE]
    return [MethodSpec.named(*pair) for pair in pairs if not names or "+".join(pair) in names]


def run(folder: Path, results: Path, names: Sequence[str]) -> None:
    """Run every setting of every method on every drive, and keep the rows."""
    limits = Protocol(divergence_limit_m=float(EXPERIMENT["divergence_limit_m"]))
    known = scenarios(folder, results)
    seeds = {name: number for number, name in enumerate(known)}
    rows = left_out.setting_rows(known, methods_named(names), limits, CampaignRuns(results / "runs"), seeds)
    left_out.store(results, rows, known, digest())


def digest() -> str:
    """Return the first 12 digits of the SHA-256 of the experiment, and of the journeys' protocol."""
    return hashlib.sha256(repr((EXPERIMENT, journeys.digest())).encode()).hexdigest()[:12]


def taken(rows: pd.DataFrame) -> Taken:
    """Return the drives with the journey and the group of their traces."""
    of = journeys.taken("J-GNSS")
    groups = dict(zip(of.replicate, of.group, strict=True))
    names = sorted(set(rows["recording"]), key=lambda name: (of.replicates.index(name.split(", ")[0]), name))
    rides = [name.split(", ")[0] for name in names]
    return Taken(names, rides, [groups[ride] for ride in rides])


def tuned(rows: pd.DataFrame, model: str = "") -> dict[Method, FloatArray]:
    """Return (16, n) the log error of each method (of one model), tuned without the group of the trace."""
    of = taken(rows)
    errors = left_out.log_errors(rows.astype(dict.fromkeys(left_out.COLUMNS[:3], str)), of.recording, PLAIN)
    chosen = {method: loss for method, loss in errors.items() if model in ("", method[0])}
    return {method: left_out.tuned_elsewhere(loss, of) for method, loss in chosen.items()}


def sentence(rows: pd.DataFrame, model: str) -> str:
    """Say what the average adaptation is worth with a model."""
    return left_out.ratio_sentence(left_out.average_method(tuned(rows, model)), taken(rows), "trace")


def parts(rows: pd.DataFrame) -> dict[str, str]:
    """Return the parts of the page."""
    losses = {name: tuned(rows)[name, left_out.PLAIN] for name in ("gnss_only", "baseline", "jerk", *BESIDE[1:])}
    return {
        "average": "\n".join(f"- **Filter `{model}`**: {sentence(rows, model)}" for model in MODELS),
        "traces": left_out.error_table(losses, taken(rows), "trace"),
        **{model: left_out.ratio_table(tuned(rows, model), taken(rows), "trace") for model in MODELS},
    }


def main() -> None:
    """Run, if there is a folder, and fill the page."""
    words = sys.argv[1:]
    results = Path(words[1]) if words[1:] else RESULTS
    if words:
        run(Path(words[0]), results, words[2:])
    rows = pd.read_parquet(results / left_out.ROWS)
    models = [model for model in MODELS if model in set(rows["filter"])]
    print(f"Protocol {digest()}.", *(f"{model}: {sentence(rows, model)}" for model in models), sep="\n")
    if results == RESULTS:
        of_page = parts(rows)
        PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), of_page), encoding="utf-8")
        left_out.answer(
            RESULTS,
            "Real drives of cars, to which the GNSS errors of 13 recorded traces were added (partly simulated)",
            "vehicles",
            of_page["average"],
            "trace",
        )


if __name__ == "__main__":
    main()
