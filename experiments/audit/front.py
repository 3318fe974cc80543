"""The audit on one screen, for the README: its answer and five lines of its table, from committed results.

python experiments/audit/front.py            prints it
python experiments/audit/front.py README.md  puts it between <!-- audit --> and <!-- /audit -->
"""

import json
import re
import sys
from pathlib import Path
from typing import Any

import pandas as pd

RESULTS = Path(__file__).parents[2] / "results"
PAPER = ("jerk", "mtf")
"""The paper's method, which always has a line."""
LINES = 5

BLOCK = re.compile(r"(?<=<!-- audit -->\n).*?(?=<!-- /audit -->)", flags=re.DOTALL)

HEADS = ("method", "at its defaults", "tuned, scored on other faults [95 %]", "worst scenario", "nothing wrong")


def front() -> str:
    """Return the block as Markdown."""
    verdicts = pd.read_csv(RESULTS / "audit-full" / "verdicts.csv").sort_values("tuned", kind="stable")
    protocol = json.loads((RESULTS / "audit-full" / "protocol.json").read_text(encoding="utf-8"))
    rows = [list(HEADS), ["---"] * len(HEADS), *(_line(row) for _, row in _chosen(verdicts).iterrows())]
    table = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    words = "Ratio of each adaptation to the tuned plain filter of each model"
    figure = f'<img src="experiments/audit/models.png" alt="{words}" width="480">'
    return f"{_answer(verdicts, protocol)}\n\n{table}\n{_suite()}\n{_gain()}\n\n{figure}\n"


def _answer(verdicts: pd.DataFrame, protocol: dict[str, Any]) -> str:
    counts = verdicts["verdict"].value_counts()
    better = verdicts[verdicts["verdict"] == "better"]
    harmless = int((better["worst_ratio"] <= 1 + protocol["margin"]).sum())
    dear = int((verdicts["nominal"] > 1 + protocol["margin"]).sum())
    words = ", ".join(f"{counts[word]} {word}" for word in ("better", "equal", "worse", "undecided") if word in counts)
    n, adaptations, models = len(verdicts), verdicts["adaptation"].nunique(), verdicts["filter"].nunique()
    faults = len(protocol["families"]) - 1
    kind = f"; {harmless} of these harm nowhere by more than 3 %" if len(better) else ""
    return (
        "**Of the published adaptive filters, how many beat an equally tuned plain Kalman filter?**\n"
        f"{len(better)} of {n} ({adaptations} adaptations on {models} models) are shown to, for all at once{kind}."
        f" Verdicts: {words}.\n"
        f"Each was tuned with the same budget on half of {faults} families of faults and scored on the other half, as"
        " the plain filter was;\n"
        f"{dear} of {n} cost more than 3 % where nothing is wrong. Ratios of the position RMSE to the tuned plain"
        " filter of the same\n"
        "model, below 1 is better; all methods and how sure it is: [experiments/audit](experiments/audit/README.md)."
    )


def _chosen(verdicts: pd.DataFrame) -> pd.DataFrame:
    """The lowest ratios, and the paper's method in the last line if it is not among them."""
    paper = (verdicts["filter"] == PAPER[0]) & (verdicts["adaptation"] == PAPER[1])
    best = verdicts.head(LINES)
    return best if paper.loc[best.index].any() else pd.concat([verdicts.head(LINES - 1), verdicts[paper]])


def _line(row: pd.Series) -> list[str]:
    return [
        f"{row['filter']} + {row['adaptation']}",
        f"{row['default']:.2f}",
        f"{row['tuned']:.2f} [{row['low']:.2f}, {row['high']:.2f}]",
        f"{row['worst_ratio']:.2f} ({row['worst']})",
        f"{row['nominal']:.2f}",
    ]


def _suite() -> str:
    paths = (RESULTS / "suite-v1").glob("*/manifest.json")
    manifests = [json.loads(path.read_text(encoding="utf-8")) for path in paths]
    entries = sorted((m["score"]["ratio"], m["entry"], m["score"]) for m in manifests)
    told = [
        f"{name} {ratio:.3f} [{score['low']:.3f}, {score['high']:.3f}]"
        for ratio, name, score in entries
        if score["verdict"] == "better"
    ]
    return (
        f"In the frozen suite `jerkbench-v1` ([board](results/suite-v1/board.md), {len(entries)} entries), against the"
        " tuned baseline,\n"
        f"better are {', '.join(told)}; no other is."
    )


def _gain() -> str:
    shares = pd.read_csv(RESULTS / "audit-attribution" / "shares.csv").set_index("factor")
    whole, rule = shares.loc["the whole"], shares.loc["adaptation"]
    rest = shares.drop(index=["the whole", "adaptation"])
    others = ", ".join(f"{name} {ratio:.2f}" for name, ratio in rest["ratio"].items())
    return (
        f"From a naive baseline to tuned jerk with MTF the RMSE is multiplied by {whole['ratio']:.2f}"
        f" [{whole['low']:.2f}, {whole['high']:.2f}]. Shapley's shares:\n"
        f"{others}, adaptation {rule['ratio']:.2f} (on the naive baseline alone {rule['alone']:.0f}, on all the rest"
        f" {rule['last']:.2f})."
    )


if __name__ == "__main__":
    text = front()
    for path in map(Path, sys.argv[1:]):
        path.write_text(BLOCK.sub(lambda _: text, path.read_text(encoding="utf-8")), encoding="utf-8")
    print(text)
