"""The audit's page and the README's first screen, from committed results.

python experiments/audit/front.py            prints the block of the first screen
python experiments/audit/front.py README.md  puts it between <!-- audit --> and <!-- /audit -->, and takes page and
                                             pictures along from results/audit-full, where they are
"""

import csv
import json
import re
import shutil
import sys
from pathlib import Path

HERE = Path(__file__).parent
RESULTS = HERE.parents[1] / "results"
AUDIT = RESULTS / "audit-full"
PAGE = ("README.md", "answer.png", "kinds.png")
SENTENCES = 3
"""Number of sentences at the top of the page, which the first screen has, too."""

BLOCK = re.compile(r"(?<=<!-- audit -->\n).*?(?=<!-- /audit -->)", flags=re.DOTALL)


def front() -> str:
    """Return the block as Markdown."""
    told = json.loads((AUDIT / "answer.json").read_text(encoding="utf-8"))
    models = ", ".join(told["filters"])
    head = (
        f"An adaptation changes R, Q or the covariance while the filter runs. We combined {told['adaptations']}"
        f" adaptations\nwith {len(told['filters'])} models ({models}). These {told['methods']} methods and the plain"
        f" filters were tuned\nwith the same effort, in {told['tunings']} independent searches. We judged them on"
        f" {told['drives']} other simulated drives,\n{100 * told['faulty']:.0f} % of them with a fault:\n"
    )
    page = (HERE / PAGE[0]).read_text(encoding="utf-8")
    sentences = "".join(f"{sentence}\n" for sentence in re.findall(r"^\d\. .*$", page, flags=re.MULTILINE)[:SENTENCES])
    words = "Error of each adaptation under each kind of fault, relative to the plain filter of its model"
    figure = f'<img src="experiments/audit/answer.png" alt="{words}" width="780">\n\n'
    figure += "A row is an adaptation, averaged over the models. Bold: shown to be better, worse, or equal"
    figure += " within 10 % (the grey band).\nA drive may have several faults, and counts under each. "
    second = (AUDIT / "second.md").read_text(encoding="utf-8").partition(". ")[0]
    more = f"{second}. [The audit](experiments/audit/README.md) says\nwhat to take when, what it costs, how sure it is."
    return f"{head}\n{sentences}\n{_journeys()}\n\n{figure}{more} {_suite()}\n"


FOUND = re.compile(r"- \*\*(?:J-)?(\w+)\*\*: (\S+ \[.*?\]) of .*? of (\d+) .*?: \*\*(\w+)\*\*")
SAID = {"GNSS": "worse", "UWB": "undecided", "baseline": "worse", "jerk": "worse"}
"""The verdicts that the sentences of the block are written for."""


def _journeys() -> str:
    """Say what the average adaptation did on real journeys, and over real cars."""
    rides, cars = (
        FOUND.findall((RESULTS / name / "answer.md").read_text(encoding="utf-8")) for name in ("journeys", "vehicles")
    )
    verdicts = {name: word for name, _, _, word in (*rides, *cars)}
    if verdicts != SAID:
        raise SystemExit(f"The real recordings say {verdicts}, but the block is written for {SAID}: write it anew.")
    on_rides = " and ".join(f"{ratio} ({name}, {n} journeys)" for name, ratio, n, _ in rides)
    on_cars = " and ".join(f"{ratio} with `{name}`" for name, ratio, *_ in cars)
    return (
        "**With recorded GNSS errors the average adaptation is slightly worse; with UWB it is undecided**. On"
        " [real journeys](experiments/journeys/README.md)\nwithout an IMU it has "
        f"{on_rides} of the error. Semi-real, over the\nmotion of real cars with {cars[0][2]} recorded"
        f" [traces of GNSS errors](experiments/vehicles/README.md), it has {on_cars}.\n"
        "Most methods change little there, and a few ruin some drives. In the simulation, the model brings as much as"
        " an\nadaptation, so compare models first. For isolated outliers, try a robust R: `student_t_r`, `huber_r` or"
        " `ssmkf_r`.\nUntuned, these [lock out](experiments/replayed/README.md) under some real errors."
    )


def _suite() -> str:
    paths = sorted((RESULTS / "suite-v2").glob("*/manifest.json"))
    manifests = [json.loads(path.read_text(encoding="utf-8")) for path in paths]
    entries = sorted((m["score"]["ratio"], m["entry"], m["score"]) for m in manifests)
    better = [own for own in entries if own[2]["verdict"] == "better"]
    plain = sum(name.endswith("+ none") for _, name, _ in better)
    with (AUDIT / "methods.csv").open(encoding="utf-8") as file:
        ours = {f"{row['filter']} + {row['adaptation']}" for row in csv.DictReader(file) if row["is"] == "own"}
    told = [
        f"{name}{' (our own variant)' * (name in ours)} {ratio:.2f} [{score['low']:.2f}, {score['high']:.2f}]"
        for ratio, name, score in better
    ]
    return (
        "The suite `jerkbench-v2` is a fixed test set with a [leaderboard](results/suite-v2/board.md).\nOf its"
        f" {len(entries)} entries, {len(told)} beat the tuned baseline, {plain} of them without adaptation."
        f" The first two are {' and '.join(told[:2])}. Each has one tuning, whose luck is not in the interval."
    )


if __name__ == "__main__":
    for page in filter(Path.exists, (AUDIT / name for name in PAGE)):
        shutil.copyfile(page, HERE / page.name)
    text = front()
    for path in map(Path, sys.argv[1:]):
        path.write_text(BLOCK.sub(lambda _: text, path.read_text(encoding="utf-8")), encoding="utf-8")
    print(text)
