"""The finding of the audit in the README, and its picture, from committed results.

python experiments/audit/front.py            prints the block
python experiments/audit/front.py README.md  writes it between <!-- audit --> and <!-- /audit -->, draws by_fault.png,
                                             and copies page and pictures from results/audit-full if they are there
"""

import re
import shutil
import sys
import textwrap
from pathlib import Path

from matplotlib.figure import Figure
from recompute import Audit

from jerkbench.report.plots.style import OKABE_ITO, save_figure

HERE = Path(__file__).parent
RESULTS = HERE.parents[1] / "results"
AUDIT = RESULTS / "audit-full"
PAGE = ("README.md", "answer.png", "kinds.png")
PICTURE = HERE / "by_fault.png"
FAULTS = {
    "no fault": "no fault",
    "outliers": "outliers",
    "multipath_single_axis": "multipath on one axis",
    "heavy_tailed": "heavy-tailed noise",
    "replayed_gnss": "replayed receiver errors",
    "false_fix": "false fixes",
    "rtk_float_overconfident": "overconfident RTK float",
    "stated_covariance": "wrong reported covariance",
    "wheel_slip": "wheel slip",
    "ruts": "ruts",
    "imu_bias": "IMU bias",
    "imu_vibration": "IMU vibration",
    "gnss_outage": "GNSS outage",
    "noise_step": "step of the noise level",
}
"""The kinds of fault, in the order of the picture, with their names there."""

BLOCK = re.compile(r"(?<=<!-- audit -->\n).*?(?=<!-- /audit -->)", flags=re.DOTALL)
REAL_GNSS = re.compile(r"- \*\*J-GNSS\*\*: .*? (\d+) GNSS trips is (\S+) \[(\S+), (\S+)\].*?: \*\*(\w+)\*\*")


def front(audit: Audit) -> str:
    """Return the block as Markdown.

    Raises:
        SystemExit: The results have changed, so that the first sentence is no longer true.
    """
    counts, methods = audit.better_and_worse(), len(audit.methods)
    average, outliers = audit.average(), audit.average(audit.faults["outliers"])
    without = audit.average(~audit.faults["outliers"])
    found = REAL_GNSS.search((RESULTS / "journeys" / "answer.md").read_text(encoding="utf-8"))
    if not found or found[5] != "worse" or average[2] >= 1.0 or without[1] < 0.995 or counts["no fault"][0]:
        sys.exit(f"The results have changed ({average}, {without}, {counts['no fault']}, {found}): rewrite the text.")
    trips, ratio, low, high, _ = found.groups()
    finding = f"""\
**Adaptation helps against outliers, rarely otherwise.** {methods} adaptive and all plain filters were tuned
equally, and tested on {audit.y.shape[2]} new simulated drives. On drives with outliers,
{counts["outliers"][0]} adaptive filters are significantly better than the plain filter of the same model, and
{counts["outliers"][1]} are worse. On drives without a fault, no adaptive filter is better, and
{counts["no fault"][1]} are worse. On average, adaptation multiplies the error by {outliers[0]:.2f} (95 % interval
{outliers[1]:.2f} to {outliers[2]:.2f}) with outliers, by {without[0]:.2f} ({without[1]:.2f} to {without[2]:.2f})
without outliers, and by {average[0]:.2f} ({average[1]:.2f} to {average[2]:.2f}) overall. On {trips} real GNSS
trips, the median is {ratio} ({low} to {high})."""
    limits = "[The audit](experiments/audit/README.md) describes the method, the ranking and the limits."
    caption = (
        "Number of adaptive filters that are significantly better or worse than the plain filter, by kind of fault"
    )
    figure = f'<img src="experiments/audit/{PICTURE.name}" alt="{caption}" width="720">'
    return "\n\n".join([textwrap.fill(finding, 140), figure, limits]) + "\n"


def picture(first: Audit, second: Audit) -> Figure:
    """Draw how many methods are significantly better and worse under each kind of fault, in two audits."""
    figure = Figure(figsize=(7.2, 4.6), dpi=150, layout="constrained")
    axes = figure.subplots()
    blue, orange = OKABE_ITO[0], OKABE_ITO[1]
    for audit, offset, height, alpha in ((first, -0.14, 0.46, 1.0), (second, 0.25, 0.22, 0.45)):
        for row, (better, worse) in enumerate(audit.better_and_worse().get(kind, (0, 0)) for kind in FAULTS):
            axes.barh(row + offset, better, height, color=blue, alpha=alpha, linewidth=0)
            axes.barh(row + offset, -worse, height, color=orange, alpha=alpha, linewidth=0)
            if audit is first and better:
                axes.text(better + 1, row, f"{better}", va="center", fontsize=8)
            if audit is first and worse:
                axes.text(-worse - 1, row, f"{worse}", va="center", ha="right", fontsize=8)
            if audit is first and not better and not worse:
                none = "0" if any(second.better_and_worse().get([*FAULTS][row], ())) else "no significant difference"
                axes.text(1.5, row, none, va="center", fontsize=7, color="0.45")
    axes.axvline(0, color="black", linewidth=1)
    axes.set_yticks(range(len(FAULTS)), FAULTS.values(), fontsize=8.5)
    axes.set_ylim(len(FAULTS) - 0.4, -0.9)
    axes.set_xlim(-45, 108)
    axes.set_xticks([])
    axes.spines[:].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.text(-2, -0.75, "worse", color=orange, ha="right", fontsize=9, weight="bold")
    axes.text(2, -0.75, "better", color=blue, fontsize=9, weight="bold")
    question = f"Of {len(first.methods)} adaptive filters, how many are significantly better or worse than\n"
    figure.suptitle(question + "the plain Kalman filter that was tuned equally?", fontsize=10, x=0.02, ha="left")
    figure.supxlabel("thin bars: a second audit with other drives and other tunings", fontsize=7.5, color="0.35")
    return figure


if __name__ == "__main__":
    for page in filter(Path.exists, (AUDIT / name for name in PAGE)):
        shutil.copyfile(page, HERE / page.name)
    audit = Audit(AUDIT)
    text = front(audit)
    for path in map(Path, sys.argv[1:]):
        path.write_text(BLOCK.sub(lambda _: text, path.read_text(encoding="utf-8")), encoding="utf-8")
        save_figure(picture(audit, Audit(RESULTS / "audit-second")), PICTURE)
    print(text)
