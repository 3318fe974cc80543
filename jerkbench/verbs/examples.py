"""The examples that `--help` of each verb prints, besides those that a longer text there has."""

from collections.abc import Mapping, Sequence
from textwrap import fill

VERB_EXAMPLES: Mapping[str, Sequence[str]] = {
    "list": ("jerkbench list adaptation", "jerkbench list metric --format json"),
    "show": ("jerkbench show adaptation mtf", "jerkbench show filter jerk --format json"),
    "table": (
        "jerkbench table results/first --baseline adaptation=none",
        "jerkbench table results/first --metric velocity_rmse_mps --rows disturbance --columns filter --format md",
        "jerkbench table results/first --findings --all",
    ),
    "figures": (
        "jerkbench figures results/first --scenarios none --methods baseline,jerk+mtf",
        "jerkbench figures results/first --scenarios 0 --pdf --out paper",
    ),
    "report": (
        "jerkbench report results/first --figures none",
        "jerkbench report results/first --scenarios 1 --out first.html",
    ),
    "rerun": ("jerkbench rerun results/first 1", "jerkbench rerun results/first 12"),
    "export": (
        "jerkbench export results/first 1 --tum trajectories",
        "jerkbench export results/first 5 --updates updates.csv",
    ),
    "pack": ("jerkbench pack results/first", "jerkbench pack results/first/cells"),
    "cite": ("jerkbench cite", "jerkbench cite results/first"),
    "new": ("jerkbench new adaptation my_rule", "jerkbench new filter my_model --out packages/my_model"),
    "check": ("jerkbench check my_rule", "jerkbench check packages/my_model --format junit"),
    "data convert": (
        "jerkbench data convert field drive.bag --set duration_s=30",
        "jerkbench data convert drive.bag drive.csv --coordinates ned",
    ),
    "data inspect": (
        "jerkbench data inspect drive.bag --figure overview.png",
        "jerkbench data inspect field --set duration_s=30 --seed 1",
    ),
    "data receiver": (
        "jerkbench data receiver drive.bag --figure receiver.png",
        "jerkbench data receiver field --set duration_s=60 --seed 1",
    ),
    "data salvage": (
        "jerkbench data salvage cut.bag whole.bag",
        "jerkbench data salvage drive.bag.active saved.bag",
    ),
    "data fetch": ("jerkbench data fetch", "jerkbench data fetch broad"),
    "data trace": (
        "jerkbench data trace field errors.parquet --set duration_s=30",
        "jerkbench data trace field biased.parquet --set duration_s=30 --offset keep",
    ),
    "data cache": ("jerkbench data cache", "jerkbench data cache --clear"),
    "suite verify": (
        "jerkbench suite verify results/suite-tiny/jerk-none",
        "jerkbench suite verify results/suite-tiny/jerk-none --rows 2",
    ),
    "suite board": (
        "jerkbench suite board results/suite-tiny",
        "jerkbench suite board results/suite-tiny --rows 1",
    ),
}
"""By the words of the verb."""


def epilog_of(verb: str, text: str) -> str:
    """Return what `--help` of a verb ends with: its text, and its examples."""
    words = text.strip("\n") if "\n" in text else fill(text, 116)
    return "\n\n".join(filter(None, (words, "\n".join(f"  {line}" for line in VERB_EXAMPLES.get(verb, ())))))
