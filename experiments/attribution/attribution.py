"""What the gain of jerk and MTF over a naive baseline is made of: model, adaptation, tuning of Q and of R, attitude.

python experiments/attribution/attribution.py [RESULTS [WORKERS]]

RESULTS is the folder of all results (default: results). What is stored there is not run again. Written to
RESULTS/audit-attribution: README.md, the shares, the value of every corner, a figure. Where RESULTS/audit-full is, its
page takes the section along (`jerkbench audit --stored`).
"""

import json
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from math import factorial
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from shapley import (
    ADAPTATION,
    ATTITUDE,
    FACTORS,
    MODEL,
    Corner,
    Q,
    R,
    Share,
    family_table,
    of_families,
    share_frame,
    share_table,
    shares,
)

from jerkbench.arrays import FloatArray
from jerkbench.audit.methods import AuditMethod, by_method
from jerkbench.audit.page import SECTIONS
from jerkbench.audit.protocol import AuditProtocol, read_protocol
from jerkbench.audit.stages import Stages
from jerkbench.campaigns.protocol import HALVES, FaultScenario
from jerkbench.campaigns.search import best_trials, levels_of, losses, mean_losses, seen
from jerkbench.campaigns.site import Site
from jerkbench.files import write_text
from jerkbench.jobs.cluster import Cluster, Local, Workers, processors
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.presets import preset
from jerkbench.report.plots.style import MEASURED, OKABE_ITO, save_figure, style_axes
from jerkbench.tuning.samplers import sampler_of
from jerkbench.tuning.space import Setting, Space

GAIN, LOSS = OKABE_ITO[2], OKABE_ITO[1]

TEXT = """\
## What the gain is made of

{naive}, whose sigma_a is the accelerometer's own noise and whose tilt is that of the gyro alone, against {whole},
tuned, with the tilt filter: {sentence}

{table}
Shapley's shares: what a factor adds, mean over the {orders} orders in which five can be added, so that no order is
preferred; they multiply to the whole. *added first*: to the naive filter alone; *added last*: to all the others. Where
these differ, factors act together. *tuning of Q* is of the filter's parameters, *tuning of R* of `r_scale` and of the
adaptation's own. Each corner is tuned by itself with {trials} settings on one half of the faults and scored on the
other, {seeds} seeds a scenario; a lost run counts a hundredfold error. Intervals are over families and seeds. Command
`python experiments/attribution/attribution.py`, protocol `{digest}`.

![Waterfall from the naive to the tuned filter](waterfall.png)

By family of faults each factor multiplies the RMSE by:

{families}"""

ATTITUDES = {False: "gyro_only", True: None}
"""Off: the gyro alone after the alignment; on: what belongs to the field, the tilt filter."""

TUNED_PARTS = {Q: ("filter",), R: ("r_scale", "adaptation")}
"""Whose parameters belong to which tuning: an adaptation's are those of R."""

SUBSETS: tuple[Corner, ...] = tuple(frozenset(names) for names in ((), (Q,), (R,), (Q, R)))
"""What may be tuned."""

CORNERS = "corners"
"""The stage of the runs that score."""

Chosen = Mapping[tuple[AuditMethod, Corner, str], Setting]
"""The setting of a method by what was tuned of it, and on which half."""


def naive() -> Mapping[str, float]:
    """Return the process noise that nobody tuned, by the name of a knob: the accelerometer's own."""
    noise = preset("noise", "untuned")
    return {f"filter.{name}": float(value) for name, value in noise.items() if isinstance(value, (int, float))}


def naive_space(space: Space, start: Mapping[str, float]) -> Space:
    """Return the knobs beginning from the naive values."""
    return Space(tuple(replace(knob, start=start.get(knob.name, knob.start)) for knob in space.knobs))


def subset_settings(space: Space, subset: Corner, trials: int) -> tuple[Setting, ...]:
    """Return the settings that are tried where only the knobs of ``subset`` are tuned; the others keep their start."""
    parts = {part for name in subset for part in TUNED_PARTS[name]}
    varied = [k for k, knob in enumerate(space.knobs) if knob.part in parts]
    if not varied or trials < 2:
        return (space.start,)
    shares = sampler_of("sobol", len(varied), 0).ask(trials - 1)
    return (space.start, *(_varied(space, dict(zip(varied, point, strict=True))) for point in shares.tolist()))


def _varied(space: Space, shares: Mapping[int, float]) -> Setting:
    return tuple(knob.value(shares[k]) if k in shares else knob.start for k, knob in enumerate(space.knobs))


def methods_of(protocol: AuditProtocol) -> dict[Corner, AuditMethod]:
    """Return the method where model and adaptation are off and on: the first and the last of the protocol's."""
    models = {False: protocol.filters[0], True: protocol.filters[-1]}
    rules = {False: protocol.plain, True: protocol.compared[-1]}
    return {
        frozenset(name for name, on in ((MODEL, jerk), (ADAPTATION, mtf)) if on): AuditMethod(models[jerk], rules[mtf])
        for jerk, mtf in product((False, True), repeat=2)
    }


@dataclass(frozen=True)
class Scored:
    """The runs of one attitude.

    Attributes:
        rows: of the test; ``trial`` is the place of a setting among those of `trial_keys`.
        trial_keys: (subset, half that it was tuned on) of each trial, by scenario.
    """

    rows: pd.DataFrame
    trial_keys: Sequence[Sequence[tuple[Corner, str]]]


class AttributionRuns:
    """The runs with one attitude, which go on where they were stopped."""

    def __init__(self, protocol: AuditProtocol, spaces: Mapping[AuditMethod, Space], stages: Stages) -> None:
        """Prepare to search the ``spaces``, which begin from the naive values."""
        self._protocol, self._spaces, self._stages = protocol, spaces, stages

    def scored(self) -> Scored:
        """Tune, and score what came out on the half that it was not tuned on."""
        chosen = self._tuned()
        trial_keys = [_keys_of(scenario) for scenario in self._stages.scenarios]
        settings = [
            {method: tuple(chosen[method, *key] for key in keys) for method in self._spaces} for keys in trial_keys
        ]
        return Scored(self._stages.run(CORNERS, self._protocol.seeds_to_test_on, settings), trial_keys)

    def _tuned(self) -> Chosen:
        tried = {
            (method, subset): subset_settings(space, subset, self._protocol.trials)
            for (method, space), subset in product(self._spaces.items(), SUBSETS)
        }
        union = {method: _union([tried[method, subset] for subset in SUBSETS]) for method in self._spaces}
        rows = self._stages.run("tune", self._protocol.seeds_to_tune_on, [union] * len(self._stages.scenarios))
        rows["loss"] = losses(rows, levels_of(rows, self._protocol.plain))
        grouped = by_method(rows)
        return {
            (method, subset, half): self._best(grouped[method], union[method], own, half)
            for ((method, subset), own), half in product(tried.items(), HALVES)
        }

    def _best(self, rows: pd.DataFrame, union: Sequence[Setting], own: Sequence[Setting], half: str) -> Setting:
        trials = [union.index(setting) for setting in own]
        means = mean_losses(rows[rows["trial"].isin(trials)], seen(half, self._stages.scenarios))
        return union[best_trials(means, 1)[0]]


def _union(several: Sequence[Sequence[Setting]]) -> tuple[Setting, ...]:
    return tuple(dict.fromkeys(setting for settings in several for setting in settings))


def _keys_of(scenario: FaultScenario) -> list[tuple[Corner, str]]:
    """What is scored in a scenario: each subset, tuned on the half or the halves that the scenario is not of."""
    halves = [half for half in HALVES if half != scenario.half]
    return [(subset, half) for subset in SUBSETS for half in halves]


def corner_values(scored: Mapping[bool, Scored], protocol: AuditProtocol) -> dict[Corner, FloatArray]:
    """Return (S, n) the loss at every corner; of a scenario of both halves the mean of both settings.

    Args:
        scored: of the attitude off and on.
        protocol: of the study.
    """
    levels = levels_of(scored[True].rows, protocol.plain)
    values = {}
    for on, own in scored.items():
        attitude = frozenset({ATTITUDE} if on else ())
        rows = by_method(own.rows.assign(loss=losses(own.rows, levels)))
        for corner, method in methods_of(protocol).items():
            cube = rows[method].pivot_table(index=["scenario", "trial"], columns="seed", values="loss")
            for subset in SUBSETS:
                values[corner | attitude | subset] = _of_subset(cube, own.trial_keys, subset)
    return values


def _of_subset(cube: pd.DataFrame, trial_keys: Sequence[Sequence[tuple[Corner, str]]], subset: Corner) -> FloatArray:
    wanted = [[(number, k) for k, key in enumerate(keys) if key[0] == subset] for number, keys in enumerate(trial_keys)]
    return np.array([cube.loc[places].to_numpy().mean(axis=0) for places in wanted])


@dataclass(frozen=True)
class Attribution:
    """What an attribution found.

    Attributes:
        corners: (F, n) mean loss of each family and seed, at each corner.
        families: their names.
        shares: of each factor, the largest gain first, and the whole.
    """

    corners: Mapping[Corner, FloatArray]
    families: tuple[str, ...]
    shares: list[Share]


def run_attribution(protocol: AuditProtocol, folder: Path, cluster: Cluster, workers: int) -> Attribution:
    """Run what is not stored in ``folder`` yet, and write the shares.

    Args:
        protocol: what is compared.
        folder: of the attribution.
        cluster: what runs it.
        workers: number of processes, where the cluster starts them.

    Raises:
        JerkbenchError: a run failed.
        OSError: nothing can be written.
    """
    known, start = protocol.scenarios, naive()
    methods = methods_of(protocol).values()
    spaces = {method: naive_space(method.space(known[0]), start) for method in methods}
    with Workers(cluster, workers) as own:
        site = Site(folder / "runs", own)
        stages = {on: Stages(known, site, name) for on, name in ATTITUDES.items()}
        scored = {on: AttributionRuns(protocol, spaces, of).scored() for on, of in stages.items()}
    values = corner_values(scored, protocol)
    families = [scenario.family for scenario in known]
    attribution = Attribution(
        {corner: of_families(own, families) for corner, own in values.items()},
        tuple(dict.fromkeys(families)),
        shares(values, families),
    )
    _write(attribution, protocol, folder, site.makers())
    return attribution


def corner_frame(attribution: Attribution) -> pd.DataFrame:
    """Return the mean loss of every corner and family, one a row: what the shares can be computed from again."""
    return pd.DataFrame(
        [
            {**{factor: factor in corner for factor in FACTORS}, "family": family, "log_rmse": float(np.mean(own))}
            for corner, values in attribution.corners.items()
            for family, own in zip(attribution.families, values, strict=True)
        ]
    )


def _write(attribution: Attribution, protocol: AuditProtocol, folder: Path, makers: list[str]) -> None:
    ends = [method.name for method in methods_of(protocol).values()]
    by_family = family_table(attribution.corners, attribution.families)
    texts = {
        "protocol.json": json.dumps({"digest": protocol.digest, **asdict(protocol)}, indent=1),
        "corners.csv": corner_frame(attribution).to_csv(index=False),
        "shares.csv": share_frame(attribution.shares).to_csv(index=False),
        "README.md": attribution_page(attribution.shares, by_family, protocol),
        "manifest.json": json.dumps({**_provenance(protocol), "rows_computed_by": makers}, indent=1),
    }
    for name, text in texts.items():
        write_text(folder / name, text)
    save_figure(waterfall(attribution.shares, f"naive {ends[0]}", f"tuned {ends[-1]}"), folder / "waterfall.png")


def _provenance(protocol: AuditProtocol) -> dict[str, object]:
    return {"protocol": protocol.digest, "code": code_digest(), "git_commit": git_commit(), "versions": versions()}


def waterfall(rows: Sequence[Share], start: str, end: str) -> Figure:
    """Draw what each factor multiplies the RMSE by.

    Args:
        rows: shares in order, the whole last.
        start: what the naive filter is called.
        end: what the whole is called.
    """
    *factors, whole = rows
    steps = np.log([row.ratio.ratio for row in factors])
    ends = np.exp(np.concatenate([[0.0], np.cumsum(steps)]))
    figure = Figure(figsize=(7.0, 0.42 * (len(rows) + 1) + 0.8), layout="constrained")
    axes = figure.add_subplot()
    places = np.arange(len(rows) + 1)[::-1]
    for place, before, after in zip(places[1:-1], ends, ends[1:], strict=False):
        axes.barh(place, after - before, left=before, color=GAIN if after < before else LOSS, height=0.6)
        axes.vlines(after, place - 1.0, place, color=MEASURED, linewidth=0.8)
    axes.plot([1.0, whole.ratio.ratio], [places[0], places[-1]], "o", color=OKABE_ITO[0])
    axes.set_xscale("log")
    style_axes(axes)
    axes.set_yticks(places, [start, *(f"{row.factor}, {row.ratio.ratio:.2f}" for row in factors), end])
    axes.set_xlabel(f"Position RMSE / {start}")
    return figure


def attribution_page(shares: Sequence[Share], families: str, protocol: AuditProtocol) -> str:
    """Return the section as Markdown.

    Args:
        shares: of each factor, and the whole.
        families: a table by family.
        protocol: of the study.
    """
    naive, *_, whole = methods_of(protocol).values()
    return TEXT.format(
        naive=naive.name,
        whole=whole.name,
        sentence=sentence(shares),
        table=share_table(shares),
        families=families,
        orders=factorial(len(FACTORS)),
        trials=protocol.trials,
        seeds=protocol.test_seeds,
        digest=protocol.digest,
    )


def sentence(shares: Sequence[Share]) -> str:
    """Return the shares in one sentence."""
    *factors, whole = shares
    parts = ", ".join(f"{row.factor} {100 * row.share:.0f} %" for row in factors)
    interval = f"95 % {whole.ratio.low:.3f} to {whole.ratio.high:.3f}"
    return f"the RMSE is multiplied by {whole.ratio.ratio:.3f} ({interval}). Of the logarithm of that gain: {parts}."


def attribution_protocol() -> AuditProtocol:
    """Return the faults and halves of the audit, with fewer settings and seeds: each of 32 corners is tuned."""
    return replace(
        read_protocol("full"),
        filters=("baseline", "jerk"),  # off and on
        adaptations=("mtf",),  # on
        trials=16,
        restarts=1,
        tune_seeds=2,
        choose_seeds=8,
        test_seeds=8,
        finalists=4,
        apart=(),
    )


def take_along(folder: Path, audit: Path) -> None:
    """Give the page of an audit the section and the figure."""
    (audit / SECTIONS).mkdir(parents=True, exist_ok=True)
    shutil.copyfile(folder / "README.md", audit / SECTIONS / "2_attribution.md")
    shutil.copyfile(folder / "waterfall.png", audit / "waterfall.png")


def main(results: str = "results", workers: str = "0") -> None:
    """Run it, print its section, and let the audit take it along."""
    folder = Path(results) / "audit-attribution"
    run_attribution(attribution_protocol(), folder, Local(), int(workers) or processors())
    print((folder / "README.md").read_text(encoding="utf-8"))
    if (audit := folder.with_name("audit-full")).is_dir():
        take_along(folder, audit)


if __name__ == "__main__":
    main(*sys.argv[1:])
