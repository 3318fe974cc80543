"""Methods tuned on one block of real drives and scored on another: of time, or of recordings.

python experiments/real_drives/drives.py FOLDER [TRIALS [METHOD ...]]   runs, and prints the table
python experiments/real_drives/drives.py                                prints the table of what is stored

METHOD is filter+adaptation. Written to results/real_drives/losses.parquet.
"""

import hashlib
import sys
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
import yaml

from jerkbench.errors import PluginError
from jerkbench.hydra_app.words import composed
from jerkbench.jobs.job import Job
from jerkbench.tuning.entrant import Site, tried_settings
from jerkbench.tuning.evaluate import Evaluator, objective_of
from jerkbench.tuning.space import Space, space_of
from jerkbench.tuning.splits import Seeds, by_time

HERE = Path(__file__).parent
STORED = Path("results/real_drives/losses.parquet")
HALVES = ("first", "second")
ERROR = "position_rmse_m"
KEY = ["filter", "adaptation"]


def protocol() -> dict[str, Any]:
    """Return what is compared."""
    values: dict[str, Any] = yaml.safe_load((HERE / "protocol.yaml").read_text(encoding="utf-8"))
    return values


def digest() -> str:
    """Return the first 12 digits of the protocol's SHA-256."""
    return hashlib.sha256((HERE / "protocol.yaml").read_bytes()).hexdigest()[:12]


def methods(asked: Sequence[str]) -> list[tuple[str, ...]]:
    """Return (filter, adaptation) of every method, or of those that are asked for."""
    known = protocol()
    pairs = [*product(known["filters"], known["adaptations"]), *((name, "none") for name in known["inertial"])]
    return [tuple(word.split("+")) for word in asked] or pairs


def job_of(drive: str, method: Sequence[str], folder: Path) -> Job:
    """Return the job of a method on a drive."""
    known = protocol()
    words = [word.replace("FOLDER", str(folder)) for word in known["drives"][drive]]
    model, rule = method
    own = [f"filter={model}", f"adaptation={rule}", f"disturbance={known['disturbance']}"]
    return composed([*words, *own]).job()


def runs(drive: str, method: Sequence[str], folder: Path, trials: int, place: Path) -> Iterator[dict[str, Any]]:
    """Yield the rows of every setting of a method on both halves of a drive: mean log RMSE over the phases."""
    job = job_of(drive, method, folder)
    try:
        space = space_of(job)
    except PluginError:  # it has nothing to tune
        space = Space(())
    settings = tried_settings(trials, space) if space.knobs else ((),)
    evaluator = Evaluator(space, objective_of("rmse"), 2, Site(place))
    cases = by_time([job], Seeds(1, 0, 1))
    for half, (case,) in zip(HALVES, (cases.tune, cases.test), strict=True):
        (several,) = evaluator.rows(settings, [case])
        for trial, rows in enumerate(several[:-1]):  # the last are the plain filter's
            errors = [row[ERROR] if row["status"] == "ok" else np.inf for row in rows]
            for phase, error in enumerate(errors):
                yield {
                    "drive": drive,
                    "half": half,
                    **dict(zip(KEY, method, strict=True)),
                    "trial": trial,
                    "phase": phase,
                    ERROR: error,
                }


def measure(folder: Path, trials: int, asked: Sequence[str]) -> pd.DataFrame:
    """Run every method on every drive; rows of drive, half, filter, adaptation, trial, phase, position_rmse_m."""
    rows: list[dict[str, Any]] = []
    for drive in protocol()["drives"]:
        for method in methods(asked):
            print(f"{drive}: {' + '.join(method)}", file=sys.stderr, flush=True)
            with TemporaryDirectory(prefix="jerkbench-") as place:
                rows += runs(drive, method, folder, trials, Path(place))
    return pd.DataFrame(rows)


def losses(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the mean log RMSE over phases, a lost run as the protocol has it: a column a trial."""
    known = protocol()
    plain = rows[(rows[KEY] == known["plain"]).all(axis=1) & (rows["trial"] == 0)]
    level = plain.groupby(["drive", "half"])[ERROR].median()
    most = known["lost"] * level.reindex(pd.MultiIndex.from_frame(rows[["drive", "half"]])).to_numpy()
    logs = np.log(np.minimum(rows[ERROR].to_numpy(), most))
    return rows.assign(loss=logs).pivot_table(index=[*KEY, "drive", "half"], columns="trial", values="loss")


def scored(table: pd.DataFrame) -> pd.DataFrame:
    """Return the loss of each method on each drive: at its defaults, tuned on the other half, tuned on other drives.

    The mean over halves; what a half is scored with was chosen without it.
    """
    scores = []
    for names, own in table.groupby(KEY):
        for drive, halves in own.groupby("drive"):
            others = own[own.index.get_level_values("drive") != drive]
            means = {half: halves.xs(half, level="half").mean() for half in HALVES}
            crossed = np.mean([means[b][means[a].idxmin()] for a, b in (HALVES, HALVES[::-1])])
            elsewhere = halves.mean()[others.mean().idxmin()] if len(others) else np.nan
            values = {"default": halves.mean()[0], "halves": crossed, "drives": elsewhere}
            scores.append({**dict(zip(KEY, names, strict=True)), "drive": drive, **values})
    return pd.DataFrame(scores)


def ratios(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the ratio of each method to the tuned plain filter, and its error: a row for each method and drive."""
    scores = scored(losses(rows))
    plain = scores[(scores[KEY] == protocol()["plain"]).all(axis=1)].set_index("drive")
    for how in ("halves", "drives"):
        scores[f"{how}_ratio"] = np.exp(scores[how] - scores["drive"].map(plain[how]))
    scores["default_ratio"] = np.exp(scores["default"] - scores["drive"].map(plain["halves"]))
    return scores.assign(rmse_m=np.exp(scores["halves"]))


def markdown(rows: pd.DataFrame) -> str:
    """Return the table, the lowest ratio first; then the inertial filters by themselves."""
    scores, known = ratios(rows), protocol()
    drives = [name for name in known["drives"] if name in set(scores["drive"])]
    wide = scores.pivot_table(
        index=KEY, columns="drive", values=["rmse_m", "halves_ratio", "drives_ratio", "default_ratio"]
    )
    mean = np.exp(np.log(wide).T.groupby(level=0).mean().T)
    order = mean.sort_values("halves_ratio").index
    heads = [
        "method",
        *(f"{drive} [m]" for drive in drives),
        "defaults",
        "tuned on the other half",
        "worst drive",
        "tuned on other drives",
    ]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    apart = [name for name in order if name[0] in known["inertial"]]
    for name in [*(name for name in order if name not in apart), *apart]:
        own = wide.loc[name]
        errors = [f"{own['rmse_m', drive]:.3g}" for drive in drives]
        numbers = [
            mean.loc[name, "default_ratio"],
            mean.loc[name, "halves_ratio"],
            own["halves_ratio"].max(),
            mean.loc[name, "drives_ratio"],
        ]
        lines.append(f"| {' + '.join(name)} | {' | '.join([*errors, *(f'{value:.2f}' for value in numbers)])} |")
    return "\n".join(lines) + "\n"


def sentences(rows: pd.DataFrame) -> list[str]:
    """Return what the rows say, in sentences."""
    scores, known = ratios(rows), protocol()
    wide = scores.pivot_table(index=KEY, columns="drive", values="halves_ratio")
    kinematic = wide[~wide.index.get_level_values("filter").isin(known["inertial"])].drop(index=tuple(known["plain"]))
    plain = wide.xs("none", level="adaptation")
    adapted = kinematic[kinematic.index.get_level_values("adaptation") != "none"]
    same = adapted / plain.reindex(adapted.index.get_level_values("filter")).to_numpy()
    everywhere, harmless = (same < 1).all(axis=1), (same <= 1.03).all(axis=1)
    names = [" + ".join(name) for name in same.index[everywhere]]
    which = f" ({', '.join(names)})" if names else ""
    first = (
        f"Of {len(same)} adaptive methods {int(everywhere.sum())} are ahead of the plain filter of their own model,"
        f" tuned alike, on every drive{which}; {int(harmless.sum())} are nowhere worse by more than 3 %."
    )
    model = known["filters"][-1]
    second = f"Tuned, {model} without any adaptation has {_range(plain.loc[model])} of the tuned baseline's error."
    return [first, second]


def _range(values: pd.Series) -> str:
    return f"{values.min():.2f} to {values.max():.2f}"


if __name__ == "__main__":
    if len(sys.argv) > 1:
        folder, *more = sys.argv[1:]
        rows = measure(Path(folder), int(more[0]) if more else protocol()["trials"], more[1:])
        STORED.parent.mkdir(parents=True, exist_ok=True)
        rows.to_parquet(STORED, index=False)
    stored = pd.read_parquet(STORED)
    print(f"Protocol {digest()}.\n\n{markdown(stored)}")
    print("\n".join(f"- {sentence}" for sentence in sentences(stored)))
