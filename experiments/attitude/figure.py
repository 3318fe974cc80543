"""The pictures of the page: every trial as a dot, and one fast trial over time.

    python experiments/attitude/figure.py [FOLDER]

writes inclination.png beside this file; with FOLDER, which holds broad, over_time.png too.
"""

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from page import KEPT

from jerkbench.audit.attitude.methods import AS_THEY_COME
from jerkbench.audit.attitude.trials import DOMAINS, broad
from jerkbench.audit.attitude.tuned import errors_of, tuned
from jerkbench.evaluation.navigation_errors import angle_between

mpl.use("Agg")
from matplotlib import pyplot as plt

HERE = Path(__file__).parent
TICKS_DEG = {
    "broad": (0.3, 1, 3, 10),
    "tstick": (1, 3, 10, 30, 100),
    "kitti": (0.6, 1, 2, 5),
    "field": (0.03, 0.1, 0.3),
}
TRIAL = "21_undisturbed_fast_combined"


def dots() -> None:
    """Inclination error of each method on each trial, tuned, with the median."""
    errors = errors_of(pd.read_parquet(KEPT))
    figure, panels = plt.subplots(1, len(DOMAINS), figsize=(13, 4), sharey=True, layout="constrained")
    for panel, (domain, title) in zip(panels, DOMAINS.items(), strict=True):
        losses = tuned(errors[domain])
        for row, loss in enumerate(losses.values()):
            deg = np.exp(np.median(loss, axis=0))
            jitter = np.linspace(-0.25, 0.25, len(deg))
            panel.plot(deg, row + jitter, "o", ms=3, alpha=0.6, color="tab:blue")
            panel.plot([np.median(deg)] * 2, [row - 0.35, row + 0.35], color="black", lw=2)
        panel.set(xscale="log", title=title, xlabel="RMSE of the inclination [deg]")
        panel.set_yticks(range(len(losses)), losses.keys())
        panel.set_xticks(TICKS_DEG[domain], [f"{tick:g}" for tick in TICKS_DEG[domain]], minor=False)
        panel.minorticks_off()
    panels[0].invert_yaxis()
    figure.savefig(HERE / "inclination.png", dpi=110)
    print(
        f"Dots of {sum(errors[domain]['vqf'].shape[1] for domain in DOMAINS)} trials: {HERE.name}/inclination.png,"
        " each method tuned without the trial that is shown; the line is the median over the trials."
    )


def over_time(folder: Path) -> None:
    """The error of a fast trial over time, and the specific force's norm below."""
    (trial,) = (trial for trial in broad(folder / "broad") if trial.name == TRIAL)
    recording, truth, counted = trial.pieces()[0]
    figure, (above, below) = plt.subplots(2, 1, figsize=(9, 5), sharex=True, layout="constrained")
    for name in ("madgwick, default", "mtf, default", "vqf, default"):
        x, _ = AS_THEY_COME[name].verticals(recording)
        error = np.where(counted, np.degrees(angle_between(x, truth)), np.nan)
        above.plot(recording.clock_s, error, lw=0.7, label=name)
    below.plot(recording.clock_s, np.linalg.norm(recording.inertial.accel_mps2, axis=1), lw=0.4, color="grey")
    above.set(ylabel="error of the inclination [deg]", title=f"BROAD, {TRIAL}")
    above.legend()
    below.set(xlabel="time [s]", ylabel="specific force [m/s2]")
    figure.savefig(HERE / "over_time.png", dpi=110)


if __name__ == "__main__":
    dots()
    if len(sys.argv) > 1:
        over_time(Path(sys.argv[1]))
