"""A study's folder: its rows, tables and manifest, made from the cells that are there, as often as one likes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa

from jerkbench import plugins
from jerkbench.errors import JerkbenchError
from jerkbench.files import write_atomically
from jerkbench.jobs.conditions import Conditions, conditions, current, told_apart, with_one_name
from jerkbench.jobs.labels import Labels, contradiction
from jerkbench.jobs.manifest import read_manifest, stretches, write_manifest
from jerkbench.jobs.parts import HEAD_COLUMNS, Stored, frame
from jerkbench.jobs.store import Store, damaged
from jerkbench.notices import plain
from jerkbench.parameters import provenance_of
from jerkbench.report.columns import FACTORS, GNSS_ONLY, SCENARIO_FACTORS, WHY
from jerkbench.report.comparisons import SPENDS
from jerkbench.report.writers import inert

if TYPE_CHECKING:
    from jerkbench.report.table_model import Table


@dataclass(frozen=True, eq=False)
class Study:
    """The results of a study.

    Attributes:
        folder: where they are.
        rows: one row a cell and seed, in the order of the sweeps.
        notes: sentences that belong under its tables.
        keys: key of the cell of each row.
        code: the commits that its cells come from, in a few words.
        conditions: what each cell was measured under, by key.
        damaged: keys of the cells that cannot be read.
        unlike: sentences about the labels of which not all cells were measured under the same conditions.
    """

    folder: Path
    rows: pd.DataFrame
    notes: tuple[str, ...]
    keys: pd.Series
    code: str = ""
    conditions: Mapping[str, Conditions] = field(default_factory=dict)
    damaged: tuple[str, ...] = ()
    unlike: tuple[str, ...] = ()

    @classmethod
    def open(cls, folder: Path | str) -> "Study":
        """Read the study in ``folder``.

        Raises:
            JerkbenchError: there is no cell.
        """
        return load_study(Path(folder))

    def __repr__(self) -> str:
        """Return its folder and its size, and what was lost."""
        lost = int((self.rows["status"] != "ok").sum())
        return f"Study({str(self.folder)!r}, {self.combinations} combinations, {len(self.rows)} runs, {lost} lost)"

    def _repr_html_(self) -> str:
        """Return its main table, as a notebook shows it."""
        from jerkbench.report.summary import main_metric, summarise

        return str(summarise(self.rows, main_metric(self.rows), notes=self.notes)._repr_html_())

    @property
    def combinations(self) -> int:
        """Return the number of combinations; shards of one count once."""
        return len(self.rows[[*Labels._fields]].drop_duplicates())

    @property
    def labels(self) -> dict[str, dict[str, str]]:
        """Return the labels of each cell by its key, as the tables have them."""
        first = ~self.keys.duplicated()
        records = self.rows.loc[first.to_numpy(), [*Labels._fields]].to_dict("records")
        return dict(zip(self.keys[first], records, strict=True))

    def only(self, keys: Iterable[str]) -> "Study":
        """The same study with the cells ``keys`` alone."""
        chosen = self.keys.isin(list(keys)).to_numpy()
        rows, keys_of_rows = self.rows[chosen].reset_index(drop=True), self.keys[chosen].reset_index(drop=True)
        return replace(self, rows=rows, keys=keys_of_rows)


def load_study(folder: Path, seeds: Mapping[str, Sequence[int]] | None = None) -> Study:
    """Read the cells of a study; of several with the same name, one of the last run, else the newest.

    Cells that were not measured under the same conditions (data, protocol, engine) get names that say so.

    Args:
        folder: the study's.
        seeds: of cells that are taken before others of the same name, as those of the last run are without; of the
            others the manifest says which seeds are shown.

    Raises:
        JerkbenchError: there is no cell.
    """
    manifest = read_manifest(folder)
    named = {key: stretches(own) for key, own in (seeds or {}).items()}
    every, broken = Store(folder).read(shown={**manifest.get("seeds", {}), **named})
    if not every:
        held = f"no results but {len(broken)} damaged files" if broken else "no results"
        raise JerkbenchError(f"{folder} holds {held}; `jerkbench run` writes them there (cells/*.parquet).")
    order = {key: place for place, key in enumerate(dict.fromkeys([*manifest.get("cells", []), *named]))}
    chosen = current(with_one_name(every), order, set(named or manifest.get("last", [])))
    cells, keys = [cell.metadata for cell in chosen], [cell.key for cell in chosen]
    known = conditions(cells)
    labels, unlike = told_apart(cells, known)
    rows, counts = _rows(chosen, labels)
    spent = [level for key in keys if (level := manifest.get("levels", {}).get(key)) is not None]
    rows.attrs.update({SPENDS: min(spent)} if spent else {})
    notes = [
        *unlike,
        *study_notes(keys, cells, manifest),
        *remarks_on(cells, len(every) - len(chosen), sum(cell.others for cell in every), broken),
        *not_as_published(cells),
        *worse_than_fixes(rows, cells),
    ]
    by_key = dict(zip(keys, known, strict=True))
    of_rows = pd.Series(np.repeat(np.array(keys, dtype=object), counts))
    return Study(folder, rows, tuple(notes), of_rows, code_of(cells), by_key, tuple(broken), tuple(unlike))


def _rows(cells: Sequence[Stored], labels: Sequence[Mapping[str, str]]) -> tuple[pd.DataFrame, list[int]]:
    """The rows of some cells, in this order and with these labels, and the number of rows of each."""
    columns = dict.fromkeys([*HEAD_COLUMNS, *chain(*{id(cell.columns): cell.columns for cell in cells}.values())])
    places = pa.array(np.concatenate([cell.runs for cell in cells]))  # all were read together
    rows = frame(cells[0].whole.take(places), columns)
    counts = [len(cell.runs) for cell in cells]
    for name in Labels._fields:
        rows[name] = pd.Series(np.repeat(np.array([own[name] for own in labels], dtype=object), counts), dtype="str")
    return rows, counts


def concluded(
    folder: Path,
    seeds: Mapping[str, Sequence[int]],
    notes: Sequence[str],
    command: Sequence[str],
    level: float | None = None,
) -> tuple[Study, "Table"]:
    """Write manifest, rows and tables of a study after a command; returns it, and the first of the tables.

    The arguments are those of `write_manifest`.
    """
    write_manifest(folder, seeds, notes, command, level)
    study = load_study(folder)
    return study, write_study(study)


def write_study(study: Study) -> "Table":
    """Write rows.csv and the tables; returns the first of these."""
    from jerkbench.report.summary import write_tables

    write_atomically(study.folder / "rows.csv", lambda path: write_rows_csv(study.rows, path))
    return write_tables(study.rows, study.folder, study.notes)


def write_rows_csv(rows: pd.DataFrame, path: Path) -> None:
    """Write a header and one line a row; what is missing is empty, and no text is a formula or steers a terminal."""

    def neutral(value: Any) -> Any:  # noqa: ANN401 - a text, or what stands for none
        return plain(inert(value)) if isinstance(value, str) else value

    texts = {str(name): rows[name] for name in rows if not pd.api.types.is_numeric_dtype(rows[name])}
    written = {name: own.map({value: neutral(value) for value in own.unique()}) for name, own in texts.items()}
    rows.assign(**written).rename(columns=neutral).to_csv(path, index=False, lineterminator="\n")


# The sentences below a study's tables: notes on its cells, their code, and remarks about what is left out.

ERROR_COLUMN = "position_rmse_m"

WORSE_RATIO = 1.1
"""A method whose median error is so many times that of the fixes alone is told."""

MOST_TOLD = 3
"""Scenarios, methods of each, and wrong labels, that are told."""

CellMetadata = Mapping[str, Any]
"""What is known of a cell."""


def study_notes(keys: Sequence[str], cells: Sequence[CellMetadata], manifest: dict[str, Any]) -> list[str]:
    """Return the notes of the configuration, and then of the recordings, about the cells that are shown."""
    configured = [note for key in keys for note in manifest.get("notes", {}).get(key, [])]
    return list(dict.fromkeys([*configured, *(note for cell in cells for note in cell["notes"])]))


def code_of(cells: Sequence[CellMetadata]) -> str:
    """The commit, or how many there are; without one the beginning of the code's hash."""
    named = {cell["commit"] or f"code {cell['code'][:12]}" for cell in cells}
    return f"{len(named)} versions of the code" if len(named) > 1 else f"commit {named.pop()}"


def remarks_on(cells: Sequence[CellMetadata], outdated: int, unseen: int, broken: list[str]) -> list[str]:
    """Return remarks about the cells that are shown, and about what is left out.

    Args:
        cells: the metadata of those that are shown.
        outdated: how many others there are of the same labels.
        unseen: how many of their runs have seeds that are not shown.
        broken: names of damaged files.
    """
    remarks = []
    codes = {(cell["code"], tuple(sorted(cell["versions"].items()))) for cell in cells}
    if len(codes) > 1:
        remarks.append(f"These results come from {len(codes)} versions of the code or its libraries.")
    if len(kinds := {kind for cell in cells if (kind := cell.get("processor"))}) > 1:
        named = ", ".join(sorted({kind.partition(":")[0] for kind in kinds}))
        remarks.append(f"These results come from {len(kinds)} kinds of processors ({named}): last bits may differ.")
    if outdated:
        which = "1 result of the same name" if outdated == 1 else f"{outdated} results of the same names"
        remarks.append(f"{which} with other settings, code or data {'is' if outdated == 1 else 'are'} left out.")
    if unseen:
        which = "1 stored run is" if unseen == 1 else f"{unseen} stored runs are"
        remarks.append(f"{which} left out: the last command asked for other seeds.")
    if wrong := list(dict.fromkeys(filter(None, (contradiction(cell["labels"], cell["spec"]) for cell in cells)))):
        told = "; ".join(map(plain, wrong[:MOST_TOLD]))
        remarks.append(f"Labels name another plugin than ran: {told}.")
    if broken:
        remarks.append(f"{damaged(broken)} left out: {', '.join(map(plain, broken))}.")
    return remarks


def not_as_published(cells: Sequence[CellMetadata]) -> list[str]:
    """Return which of the methods are simplified or nobody's but ours; what competes with nobody is left out."""
    told: dict[str, list[str]] = {"simplified": [], "own": []}
    for kind, name in sorted({(kind, str(cell["spec"][kind]["name"])) for cell in cells for kind in WHY}):
        known = provenance_of(plugins.get(kind, name)) if name in plugins.names(kind) else None
        if known and known.kind in told and name not in WHY[kind]:
            told[known.kind].append(name)
    named = "; ".join(f"{kind}: {', '.join(names)}" for kind, names in told.items() if names)
    return [f"Not as published: {named}. `jerkbench show` says what differs."] if named else []


def worse_than_fixes(rows: "pd.DataFrame", cells: Sequence[CellMetadata]) -> list[str]:
    """Return which methods lose to the fixes carried on without an IMU, the likely causes, and what to try.

    Args:
        rows: of the study.
        cells: the metadata of each cell.
    """
    if ERROR_COLUMN not in rows.columns or not (rows["filter"] == GNSS_ONLY).any():
        return []
    run = rows[rows["status"] != "failed"]
    errors = run[ERROR_COLUMN].where(run["status"] == "ok", float("inf"))
    medians: Any = errors.groupby([run[key].astype(str) for key in FACTORS]).median()
    losing = {}
    for scenario, methods in medians.groupby(level=[*SCENARIO_FACTORS]):
        floor = methods[methods.index.get_level_values("filter") == GNSS_ONLY].min()
        if len(worse := methods[methods > WORSE_RATIO * floor].sort_values(ascending=False, kind="stable")):
            losing[scenario] = _losers(scenario, worse, floor)
    if not losing:
        return []
    left = len(losing) - MOST_TOLD
    more = [f"Methods lose to {GNSS_ONLY} in {left} more scenarios."] * (left > 0)
    return [*list(losing.values())[:MOST_TOLD], *_advice(cells, {scenario[-1] for scenario in losing}), *more]


def _losers(scenario: tuple[str, ...], worse: "pd.Series[float]", floor: float) -> str:
    named = []
    for labels, error_m in zip(worse.index.tolist(), worse.tolist(), strict=True):
        method = "+".join(name for name in labels[len(SCENARIO_FACTORS) :] if name not in ("none", "default"))
        named.append(f"{method} ({f'{error_m:.3g} m' if error_m < float('inf') else 'lost'})")
    more = f" and {len(named) - MOST_TOLD} more" if len(named) > MOST_TOLD else ""
    where, worst = ", ".join(scenario), ", ".join(named[:MOST_TOLD])
    return f"Worse than {GNSS_ONLY} ({floor:.3g} m), which has no IMU, in {where}: {worst}{more}."


def _advice(cells: Sequence[CellMetadata], attitudes: set[str]) -> list[str]:
    """Return likely causes, and what to try, of recorded data; of simulated ones the faults are known."""
    recorded = [cell for cell in cells if cell["data"]]
    if not recorded:
        return []
    causes = ["gaps of the IMU", "its axes or stamps", "an acceleration noise of the filter that is too small"]
    moving = any(cell["spec"].get("dataset", {}).get("static_start_s") == 0.0 for cell in recorded)
    if moving and attitudes - {"reference"}:
        causes.insert(0, "a tilt that is wrong by degrees (static_start_s=0: it starts level, without a rest)")
    reference = "" if attitudes == {"reference"} else " attitude=reference, which tells whether the tilt is at fault;"
    tried = f"`jerkbench data inspect`;{reference} filter=eskf15; a larger filter.accel_mps2, or `jerkbench tune`"
    return [f"Likely causes: {'; '.join(causes)}. Try {tried}."]
