"""The pictures of the page: every trial as a dot, and one fast trial over time."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from tables import Errors, losses_on
from trials import DEFAULTS, DOMAINS, METHODS, all_trials

from jerkbench.evaluation.counted_rows import angle_between
from jerkbench.geometry import vertical_in_body

mpl.use("Agg")
from matplotlib import pyplot as plt

TICKS_DEG = {
    "broad": (0.3, 1, 3, 10),
    "tstick": (0.2, 0.5, 1, 2),
    "kitti": (0.6, 1, 2, 5),
    "kitti_start": (0.1, 0.3, 1),
    "field": (0.03, 0.1, 0.3),
}
TRIAL = "21_undisturbed_fast_combined"


def draw_dots(errors: Errors, path: Path) -> None:
    """Draw the inclination error of each method on each trial, tuned on the other sessions, with the median."""
    figure, panels = plt.subplots(1, len(errors), figsize=(13, 4), sharey=True, squeeze=False, layout="constrained")
    for panel, (domain, own) in zip(panels[0], errors.items(), strict=True):
        losses = losses_on(own)
        for row, name in enumerate(METHODS):
            deg = np.exp(np.median(losses[name], axis=0))
            jitter = np.linspace(-0.25, 0.25, len(deg))
            panel.plot(deg, row + jitter, "o", ms=3, alpha=0.6, color="tab:blue")
            panel.plot([np.median(deg)] * 2, [row - 0.35, row + 0.35], color="black", lw=2)
        panel.set(xscale="log", title=DOMAINS[domain], xlabel="RMSE of the inclination [deg]")
        panel.set_yticks(range(len(METHODS)), METHODS)
        panel.set_xticks(TICKS_DEG[domain], [f"{tick:g}" for tick in TICKS_DEG[domain]], minor=False)
        panel.minorticks_off()
    panels[0, 0].invert_yaxis()
    figure.savefig(path, dpi=110)


def draw_over_time(folder: Path, path: Path) -> None:
    """The error of a fast trial over time, and the specific force's norm below."""
    trial = next(trial for trial in all_trials(folder) if trial.name == TRIAL)
    (recording,) = trial.recordings()
    truth = vertical_in_body(np.nan_to_num(np.asarray(recording.reference.euler_rad)))
    figure, (above, below) = plt.subplots(2, 1, figsize=(9, 5), sharex=True, layout="constrained")
    for name in ("madgwick, default", "mtf, default", "vqf, default"):
        x, _ = DEFAULTS[name].verticals(recording)
        error = np.where(recording.reference.scored, np.degrees(angle_between(x, truth)), np.nan)
        above.plot(recording.clock_s, error, lw=0.7, label=name)
    below.plot(recording.clock_s, np.linalg.norm(recording.inertial.accel_mps2, axis=1), lw=0.4, color="grey")
    above.set(ylabel="error of the inclination [deg]", title=f"BROAD, {TRIAL}")
    above.legend()
    below.set(xlabel="time [s]", ylabel="specific force [m/s2]")
    figure.savefig(path, dpi=110)
