"""The audit on one screen, for the README: its answer and five lines of its table, from committed results.

python experiments/audit/front.py            prints it
python experiments/audit/front.py README.md  puts it between <!-- audit --> and <!-- /audit -->
"""

import json
import re
import sys
from pathlib import Path

import pandas as pd

RESULTS = Path(__file__).parents[2] / "results"
PAPER = ("jerk", "mtf")
"""The paper's method, which always has a line."""
LINES = 4

BLOCK = re.compile(r"(?<=<!-- audit -->\n).*?(?=<!-- /audit -->)", flags=re.DOTALL)

HEADS = ("method", "untuned", "tuned [95 %, for this method alone]", "three searches", "worst scenario", "no fault")


def front() -> str:
    """Return the block as Markdown."""
    audit = RESULTS / "audit-full"
    verdicts = pd.read_csv(audit / "verdicts.csv").sort_values("tuned", kind="stable")
    families = pd.read_csv(audit / "families.csv")
    rows = [list(HEADS), ["---"] * len(HEADS), *(_line(row) for _, row in _chosen(verdicts).iterrows())]
    table = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    words = "Ratio of each adaptation to the tuned plain filter of each model"
    figure = f'<img src="experiments/audit/models.png" alt="{words}" width="480">'
    return f"{_answer(verdicts, families)}\n\n{table}\n{_suite()}\n{figure}\n"


def _answer(verdicts: pd.DataFrame, families: pd.DataFrame) -> str:
    n, adaptations, models = len(verdicts), verdicts["adaptation"].nunique(), verdicts["filter"].nunique()
    of_family = {name: own["verdict"].value_counts() for name, own in families.groupby("family")}
    outliers, multipath = (int(of_family[name].get("better", 0)) for name in ("outliers", "multipath"))
    steps, nothing = (int(of_family[name].get("worse", 0)) for name in ("noise_step", "none"))
    counts = verdicts["verdict"].value_counts()
    shown = n - int(counts.get("undecided", 0))
    alone = int((verdicts["high"] < 1.0).sum())
    return (
        "It depends on the fault. An adaptation changes R, Q or the covariance while the filter runs. We compared"
        f" {n} methods\n({adaptations} adaptations on {models} motion models), each with the same filter without"
        " adaptation, tuned with the same effort:\n\n"
        f"1. **Against the fault that it suits, adapting pays.** Under outliers {outliers} of {n} methods are better,"
        f" under multipath {multipath}.\n"
        f"2. **Elsewhere it costs.** When the noise changes in steps, {steps} are worse. Without a fault, {nothing} are"
        " worse.\n"
        f"3. **On average over all faults, {shown} of {n} are shown to be better or worse.** The gain differs so much"
        " between faults\n"
        "   that an average stays uncertain."
        f" Taken alone, {alone} methods would count as better; tested together, none does.\n\n"
        "All drives are simulated; one kind of fault replays real receivers. The rows of four are void"
        " ([why, and all others](experiments/audit/README.md)).\nRatio of the position RMSE to the same filter without"
        " adaptation, on faults that were not used for tuning, of the three\nlowest and the paper's method:"
    )


def _chosen(verdicts: pd.DataFrame) -> pd.DataFrame:
    """The lowest ratios, and the paper's method in the last line if it is not among them."""
    paper = (verdicts["filter"] == PAPER[0]) & (verdicts["adaptation"] == PAPER[1])
    best = verdicts.head(LINES)
    return best if paper.loc[best.index].any() else pd.concat([verdicts.head(LINES - 1), verdicts[paper]])


def _line(row: pd.Series) -> list[str]:
    noise, fault = str(row["worst"]).split(", ")
    return [
        f"{row['filter']} + {row['adaptation']}",
        f"{row['default']:.2f}",
        f"{row['tuned']:.2f} [{row['low']:.2f}, {row['high']:.2f}]",
        f"{row['restart_low']:.2f} to {row['restart_high']:.2f}",
        f"{row['worst_ratio']:.1f} ({fault.replace('_', ' ')}, {noise} noise)",
        f"{row['nominal']:.2f}",
    ]


def _suite() -> str:
    paths = (RESULTS / "suite-v1").glob("*/manifest.json")
    manifests = [json.loads(path.read_text(encoding="utf-8")) for path in paths]
    entries = sorted((m["score"]["ratio"], m["entry"], m["score"]) for m in manifests)
    told = [
        f"{name.removesuffix(' + none')} {ratio:.2f} [{score['low']:.2f}, {score['high']:.3f}]"
        for ratio, name, score in entries
        if score["verdict"] == "better"
    ]
    return (
        "The suite `jerkbench-v1` is a fixed test set with a [leaderboard](results/suite-v1/board.md). Of its"
        f" {len(entries)} entries,\n{len(told)} beat the tuned baseline: {' and '.join(told)}."
    )


if __name__ == "__main__":
    text = front()
    for path in map(Path, sys.argv[1:]):
        path.write_text(BLOCK.sub(lambda _: text, path.read_text(encoding="utf-8")), encoding="utf-8")
    print(text)
