"""An entry of a suite: the tuning and the runs of a method, its score, and its files.

The score compares the method with a plain filter (without adaptation) that is tuned with the same budget.
"""

import json
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from jerkbench import plugins
from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.campaign.protocol import FROZEN, SuiteProtocol, read_suite, require_recordings
from jerkbench.campaign.runs import POSITION_ERROR, CampaignRuns, MethodSpec, Setting, tried_settings, tunable_space
from jerkbench.campaign.search import log_losses_to
from jerkbench.campaign.stored_files import (
    Test,
    file_hashes,
    is_mapping_of,
    is_text,
    read_file,
    read_json,
    read_table,
    require_part,
)
from jerkbench.contracts import ReadingFile
from jerkbench.errors import JerkbenchError, require_known
from jerkbench.evaluation.intervals import few_intervals
from jerkbench.evaluation.judgement import LEVEL, Verdict
from jerkbench.files import cache_folder, filled_template, read_yaml, write_atomically, write_text
from jerkbench.jobs.key import code_digest, git_commit, plugin_digest, versions
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.study import program_of
from jerkbench.report.writers import passive

ROWS_FILE, SETTINGS, PAGE, ENTRY_FILE = "rows.parquet", "settings.yaml", "entry.md", "manifest.json"
HASHED = (ROWS_FILE, SETTINGS, PAGE)
"""Files whose hashes are stored in the manifest."""
PLAIN, ENTRY = "plain", "entry"
"""Values of the column ``method`` in the rows of an entry: the plain filter, and the method of the entry."""
AS_GIVEN, TUNED_ON_DRIVES = "given", "drives"
"""Values of the column ``tuned_on``: the setting before tuning, and the best setting of the tuning."""
NUMBERS = (POSITION_ERROR, "anees")
"""Names of the metric columns in the rows of an entry."""
ROW_COLUMNS = {
    "method": "text",
    "tuned_on": "text",
    "scenario": "whole numbers",
    "seed": "whole numbers",
    "status": "text",
    "reason": "text",
    **dict.fromkeys((*NUMBERS, "seconds"), "numbers"),
}
"""Columns of the rows of an entry, with the kind of the values in each column."""
IMU_HZ = 100.0
"""Number of filter steps per second of the simulated drives [1/s]."""
NOTICEABLE = 1.03
"""Ratio to the error of the plain filter above which an entry counts as worse on a drive."""

Settings = Mapping[str, Mapping[str, Mapping[str, float]]]
"""Values of parameters by method ("entry" or "plain"), setting ("given" or "drives") and name of the parameter."""


@dataclass(frozen=True)
class Entry:
    """An entry of a suite that was read from its folder.

    Attributes:
        folder: The folder of the entry.
        manifest: The method, the score, and the versions of the software that created the entry.
        rows: The runs of the entry and of the plain filter on the test drives.
        settings: The parameter values of the entry and of the plain filter, before and after tuning.
    """

    folder: Path
    manifest: Mapping[str, Any]
    rows: pd.DataFrame
    settings: Settings

    @property
    def name(self) -> str:
        """Name of the entry on the board."""
        return str(self.manifest["entry"])

    @property
    def method(self) -> MethodSpec:
        """The filter and the adaptation of the entry."""
        return MethodSpec(**self.manifest["method"])

    @property
    def program(self) -> str:
        """The external program (with arguments) that the method runs, or an empty string."""
        return program_of({"filter": self.method.filter})

    def setting(self, method: str, tuned_on: str) -> Setting:
        """Return the parameter values of the entry or of the plain filter, with the given or the tuned setting."""
        return tuple(float(value) for value in self.settings[method][tuned_on].values())


def enter(scale: str, method: MethodSpec, name: str, runs: CampaignRuns, command: str) -> str:
    """Tune and score a method, write its entry to the folder of ``runs``, and return the text of its page.

    Stored runs are not computed again. The runs of the plain filter are cached and shared by all entries.

    Args:
        scale: Name of the suite.
        method: The filter and the adaptation to tune and score.
        name: Name of the method on the board.
        runs: Object that computes the runs and stores their rows in the folder of the entry.
        command: The command line that is stored in the manifest.

    Raises:
        JerkbenchError: The method cannot be created or is not compatible, or the suite differs from the frozen suite.
    """
    protocol, folder = read_suite(scale), runs.folder
    tuned = bool(tunable_space(protocol.job(method)).parameters)
    require_recordings(scale, protocol)
    shared = replace(runs, folder=cache_folder("suite") / f"{protocol.name}-rows")
    levels, plain, of_plain = _scored(protocol.plain_method, protocol, shared, "The plain filter")
    _, settings, of_method = _scored(method, protocol, replace(runs, folder=folder / "runs"), name, levels)
    rows = pd.concat([of_method.assign(method=ENTRY), of_plain.assign(method=PLAIN)], ignore_index=True)
    page = entry_page(name, rows, protocol)
    write_atomically(folder / ROWS_FILE, lambda path: rows[list(ROW_COLUMNS)].to_parquet(path, index=False))
    write_text(folder / SETTINGS, yaml.safe_dump({ENTRY: settings, PLAIN: plain}, sort_keys=False))
    write_text(folder / PAGE, page)
    manifest = {"entry": name, **frozen_part(scale, protocol), "method": asdict(method), "tuned": tuned}
    manifest |= {"command": command, "code": code_digest(), "plugins": plugins_digest(method, protocol)}
    manifest |= {"git_commit": git_commit(), "versions": versions(), "score": score_as_json(rows, protocol)}
    manifest["files"] = file_hashes(folder, HASHED)
    # The manifest is written last, so that an entry with a manifest is complete.
    write_text(folder / ENTRY_FILE, json.dumps(manifest, indent=1) + "\n")
    return page


Levels = Mapping[int, float]
"""The error of the plain filter with its default setting on each drive [m], by seed."""


def _scored(
    method: MethodSpec, protocol: SuiteProtocol, runs: CampaignRuns, doing: str, levels: Levels | None = None
) -> tuple[Levels, dict[str, dict[str, float]], pd.DataFrame]:
    """Tune a method if it has tunable parameters, and return the levels of the drives, the settings and the test rows.

    The level of a drive is the error of the plain filter with its default setting [m]. If ``levels`` is None,
    ``method`` must be the plain filter, and the levels are computed from its runs.
    """

    def run(tried: Sequence[Setting], seeds: range, metrics: int | None = None) -> pd.DataFrame:
        with Progress(len(tried), doing=doing, unit="settings") as bar:
            job = protocol.job(method, metrics)
            return runs.rows_of_settings(job, [(setting, seeds) for setting in tried], NUMBERS, bar)

    space = tunable_space(protocol.job(method))
    tried = tried_settings(protocol.trials, space)
    settings = {AS_GIVEN: tried[0]}
    if space.parameters:
        trials = run(tried, protocol.seeds_to_tune_on, metrics=1)
        levels = levels or levels_of(trials[trials["job_index"] == 0])
        means = losses_of_drives(trials, levels).groupby(trials["job_index"]).mean()
        settings[TUNED_ON_DRIVES] = tried[int(means.sort_values(kind="stable").index[0])]
    rows = run([*settings.values()], protocol.seeds_to_test_on)
    tuned_on = np.array(list(settings))[rows.pop("job_index")]
    rows = rows.rename(columns={"run_s": "seconds"}).assign(tuned_on=tuned_on, scenario=0)
    named = {key: dict(zip(space.names, setting, strict=True)) for key, setting in settings.items()}
    return levels or {}, named, rows


def levels_of(rows: pd.DataFrame) -> dict[int, float]:
    """Return the position error of the plain filter on each drive [m], by the seed of the drive.

    Raises:
        JerkbenchError: The plain filter failed on a drive.
    """
    if (failed := rows.loc[rows["status"] != "ok", "seed"]).size:
        raise JerkbenchError(f"The plain filter failed on seed {failed.min()}; make the fault of this drive milder.")
    return dict(zip(rows["seed"].astype(int), rows[POSITION_ERROR].astype(float), strict=True))


def losses_of_drives(rows: pd.DataFrame, levels: Levels) -> "pd.Series[float]":
    """Return the loss log(error/level) of each run. ``levels`` contains the error of the plain filter on each drive.

    The loss is at most log 100, which is also the loss of a failed run.
    """
    error = rows[POSITION_ERROR].where(rows["status"] == "ok").to_numpy(dtype=np.float64)
    level = np.asarray(rows["seed"].map(dict(levels)), dtype=np.float64)
    return pd.Series(log_losses_to(error, level), index=rows.index)


def frozen_part(scale: str, protocol: SuiteProtocol) -> dict[str, object]:
    """Return the part of the manifest that is the same for all entries of a suite."""
    return {"suite": scale, "protocol": protocol.digest, "data": [FROZEN[scale]["data"]]}


def plugins_digest(method: MethodSpec, protocol: SuiteProtocol) -> str:
    """Return a hash of the plugins of a method that belong to other packages, and of the program that the method runs.

    The hash is an empty string if all plugins are built-in and the method runs no program.

    Raises:
        RecordingError: The program, or a file that the filter reads, is not on this machine.
    """
    parts = protocol.job(method).method
    program = parts.filter.fingerprint() if isinstance(parts.filter, ReadingFile) else ""
    return plugin_digest(type(parts.filter)) + plugin_digest(type(parts.adaptation)) + program


def ratios(rows: pd.DataFrame, *, as_given: bool = False) -> FloatArray:
    """Return the (n,) log ratios of the errors of the entry to the errors of the tuned plain filter on n drives.

    If ``as_given`` is set, the entry has the setting before tuning instead of the tuned setting. A failed run counts as
    100 times the error of the plain filter with its default setting on the same drive.
    """
    levels = levels_of(rows[(rows["method"] == PLAIN) & (rows["tuned_on"] == AS_GIVEN)])
    rows = rows.assign(loss=losses_of_drives(rows, levels))
    counted = _counted(rows, ENTRY, as_given=as_given), _counted(rows, PLAIN)
    entry, plain = (each.set_index("seed")["loss"].sort_index() for each in counted)
    return np.asarray((entry - plain).to_numpy(), dtype=np.float64)


def _counted(rows: pd.DataFrame, method: str, *, as_given: bool = False) -> pd.DataFrame:
    """Return the rows of a method with its tuned setting, or with its given setting if the method was not tuned."""
    runs = rows[rows["method"] == method]
    tuned = runs[runs["tuned_on"] != AS_GIVEN]
    return runs[runs["tuned_on"] == AS_GIVEN] if as_given or tuned.empty else tuned


def drives_by_faults(protocol: SuiteProtocol) -> dict[str, BoolArray]:
    """Return a mask (n,) of the test drives for each number of faults ("0 faults", ...) and for each kind of fault."""
    dataset = plugins.create("dataset", protocol.dataset)
    drawn = [list(dataset.drawn(seed)[2]) for seed in protocol.seeds_to_test_on]
    named = [[f"{len(kinds)} fault{'s' * (len(kinds) != 1)}", *kinds] for kinds in drawn]
    return {
        name: np.array([name in group for group in named]) for name in sorted({n for group in named for n in group})
    }


def score_of(rows: pd.DataFrame, protocol: SuiteProtocol) -> dict[str, Any]:
    """Return the score of an entry.

    Returns:
        The numbers of the score by name. ``n`` is the number of test drives. ``ratio`` is the geometric mean of the
        ratios of the error of the entry to the error of the tuned plain filter. ``low`` and ``high`` are the limits of
        the confidence interval of ``ratio``, which holds simultaneously for all entries of the suite. ``verdict`` is
        the verdict that follows from the confidence interval. ``given`` is the error ratio with the setting before
        tuning. ``nominal`` is the error ratio on drives without a fault. ``worse`` is the fraction of drives on which
        the error is more than 3 % larger than the error of the plain filter. ``worst_kind`` and ``worst_ratio`` are the
        kind of fault with the largest error ratio, and this ratio. ``lost`` is the fraction of failed runs. ``anees``
        is the median ANEES of the runs (expected value: 6), or NaN if the filter estimates no covariance. ``step_ns``
        is the duration of a filter step [ns], which depends on the machine.
    """
    d, runs = ratios(rows), _counted(rows, ENTRY)
    low, high = (float(np.exp(end[0])) for end in few_intervals(d[None], 1 - LEVEL / protocol.entries))
    by_faults = {name: float(np.exp(d[drives].mean())) for name, drives in drives_by_faults(protocol).items()}
    kinds = {name: ratio for name, ratio in by_faults.items() if " " not in name}
    worst = max(kinds, key=lambda name: kinds[name])
    fastest_s = float(rows.loc[rows["method"] == ENTRY, "seconds"].min())
    return {
        "n": len(d),
        "ratio": float(np.exp(d.mean())),
        "low": low,
        "high": high,
        "verdict": ratio_verdict(low, high, protocol.margin),
        "given": float(np.exp(ratios(rows, as_given=True).mean())),
        "nominal": by_faults.get("0 faults", float("nan")),
        "worse": float((d > np.log(NOTICEABLE)).mean()),
        "worst_kind": worst,
        "worst_ratio": kinds[worst],
        "lost": float((runs["status"] != "ok").mean()),
        "anees": float(runs["anees"].median()),
        "step_ns": fastest_s / (protocol.duration_s * IMU_HZ) * 1e9,
    }


def score_as_json(rows: pd.DataFrame, protocol: SuiteProtocol) -> dict[str, Any]:
    """Return the score of an entry, in which None replaces NaN because JSON has no NaN."""
    score = score_of(rows, protocol)
    return {key: None if isinstance(value, float) and np.isnan(value) else value for key, value in score.items()}


def ratio_verdict(low: float, high: float, margin: float) -> str:
    """Return the verdict that follows from the confidence interval of an error ratio.

    The verdicts "better" and "worse" have priority over the verdict "equal".

    >>> ratio_verdict(0.92, 0.98, 0.1), ratio_verdict(0.95, 1.04, 0.1), ratio_verdict(0.8, 1.2, 0.1)
    ('better, by less than 10 %', 'equal', 'undecided')
    """
    small = 1 / (1 + margin) <= low and high <= 1 + margin
    if not (high < 1 or low > 1):
        return str(Verdict.EQUAL if small else Verdict.UNDECIDED)
    verdict = Verdict.BETTER if high < 1 else Verdict.WORSE
    return f"{verdict}, by less than {100 * margin:g} %" if small else str(verdict)


def about_suite(protocol: SuiteProtocol, where: str) -> str:
    """Return the text that explains the numbers on the page of an entry ("page") or on the board ("board")."""
    template = Path(__file__).parent / "templates" / "suite.md.jinja"
    return filled_template(template, p=protocol, plain=protocol.plain_method.name, where=where)


def entry_page(name: str, rows: pd.DataFrame, protocol: SuiteProtocol) -> str:
    """Return the page of an entry: its score in one line, and the error ratios by number and kind of faults."""
    score, d = score_of(rows, protocol), ratios(rows)
    more = f"without a fault {score['nominal']:.3f}; worst kind {score['worst_kind']} {score['worst_ratio']:.2f}"
    tuned = (rows.loc[rows["method"] == ENTRY, "tuned_on"] != AS_GIVEN).any()
    line = passive(
        f"{name} on {protocol.name} (n = {score['n']} drives): {score['ratio']:.3f} of the tuned plain filter"
        f" [{score['low']:.3f}, {score['high']:.3f}], {score['verdict']}; {more}; lost {100 * score['lost']:.1f} %;"
        f" {f'tuned, {protocol.trials} settings' if tuned else 'not tuned'}."
    )
    groups = drives_by_faults(protocol).items()
    lines = "".join(f"| {kind} | {drives.sum()} | {np.exp(d[drives].mean()):.3f} |\n" for kind, drives in groups)
    return f"{line}\n\n{about_suite(protocol, 'page')}\n| drives with | n | ratio |\n|---|---|---|\n{lines}"


def _is_number(value: object) -> bool:
    """Return whether a value is a finite number that fits into a float."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _is_method(value: object) -> bool:
    """Return whether a value is the plain data of a valid `MethodSpec`. Interpolations of OmegaConf are not allowed."""
    return (
        isinstance(value, dict)
        and set(value) == {"filter", "adaptation", "r_scale"}
        and all(isinstance(part, dict) for part in value.values())
        and all(is_text(value[kind].get("name")) for kind in value if kind != "r_scale")
        and is_mapping_of(_is_number)(value["r_scale"])
        and "${" not in json.dumps(value)
    )


def _is_of_score(value: object) -> bool:
    return value is None or is_text(value) or isinstance(value, float) or _is_number(value)


def _are_settings(value: object) -> bool:
    """Return whether the entry and the plain filter each have a given setting and at most one tuned setting."""
    return (
        is_mapping_of(is_mapping_of(is_mapping_of(_is_number)))(value)
        and isinstance(value, dict)
        and set(value) == {ENTRY, PLAIN}
        and all(set(settings) in ({AS_GIVEN}, {AS_GIVEN, TUNED_ON_DRIVES}) for settings in value.values())
    )


FACTS: Mapping[str, tuple[Test, str]] = {
    "entry": (is_text, "the name of the entry"),
    "suite": (is_text, "the name of its suite"),
    "protocol": (is_text, "a digest"),
    "data": (lambda value: isinstance(value, list) and all(map(is_text, value)), "a list of digests"),
    "method": (_is_method, "filter and adaptation with name and plain values, and r_scale with numbers"),
    "tuned": (lambda value: isinstance(value, bool), "true or false"),
    "score": (is_mapping_of(_is_of_score), "numbers and words by their names"),
    "files": (is_mapping_of(is_text), "hashes by the names of the files"),
}
"""Keys of the manifest that are read. Each key has a test of its value and a description of the valid values."""
_SHAPE = f"it must be under 'entry' and 'plain' a number for each parameter of '{AS_GIVEN}' (and '{TUNED_ON_DRIVES}')"
_ORIGIN = "Create the entry with `jerkbench suite run`."


def read_entry(folder: Path) -> Entry:
    """Read an entry of a suite, and check that its files are complete and have valid values.

    Raises:
        JerkbenchError: A file is missing or damaged.
    """
    manifest = read_json(folder / ENTRY_FILE, FACTS, _ORIGIN)
    require_known("suite", manifest["suite"], FROZEN, JerkbenchError)
    settings = read_file(folder / SETTINGS, read_yaml, _ORIGIN)
    require_part(folder / SETTINGS, _are_settings(settings), _SHAPE, _ORIGIN)
    read_file(folder / PAGE, Path.read_bytes, _ORIGIN)
    rows = read_table(folder / ROWS_FILE, ROW_COLUMNS, _ORIGIN)[list(ROW_COLUMNS)]
    errors, times = rows.loc[rows["status"] == "ok", POSITION_ERROR], rows["seconds"]
    for column, fits, expected in (
        (POSITION_ERROR, (errors > 0) & (errors < math.inf), "positive and finite where the status is ok"),
        ("seconds", (times >= 0) & (times < math.inf), "finite and not negative"),
    ):
        require_part(folder / ROWS_FILE, fits.all(), f"column '{column}' must be {expected}", _ORIGIN)
    return Entry(folder, manifest, rows, settings)
