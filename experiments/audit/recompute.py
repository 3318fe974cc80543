"""Recompute the numbers of the README from the committed rows, with pandas and SciPy only.

    python experiments/audit/recompute.py

The script does not import jerkbench. It implements the formulas of `docs/statistics.md` and of the page of the journeys
again and prints each recomputed number beside the number in the README. The exit code is 1 if one of them differs.
"""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from scipy import stats

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
METHOD = ["filter", "adaptation"]
FAILED_COSTS = 100.0
"""A failed run counts as this many times the error of the plain filter on the same drive."""
MIN_DRIVES = 5
"""Kinds of fault with fewer drives are not judged."""
SKEWNESS_REMOVED = 0.6
"""Fraction of the skewness that Hall's transformation removes."""


class Audit:
    """Log errors of the methods of an audit: (methods, tunings, drives).

    Attributes:
        protocol: The protocol of the audit.
        methods: (filter, adaptation) of each adaptive filter.
        y: Log ratio of the error of each method to the error of the plain filter of the same model.
        faults: For each kind of fault, a mask of the drives that have it. "no fault" is one of them.
    """

    def __init__(self, folder: Path) -> None:
        """Read the rows of ``folder``."""
        self.protocol = json.loads((folder / "protocol.json").read_text(encoding="utf-8"))
        drives = pd.read_parquet(folder / "drives.parquet").set_index("seed")
        rows = pd.read_parquet(folder / "judged.parquet").astype(dict.fromkeys(METHOD, str))
        rows = rows[(rows["tried"] == self.protocol["trials"]) & rows["filter"].isin(self.protocol["filters"])]
        failed = np.log(FAILED_COSTS) + rows["seed"].map(drives["level"])
        rows = rows.assign(loss=rows["log_error"].astype(float).fillna(failed))
        losses = {
            name: group.pivot_table(index="tuning", columns="seed", values="loss")
            for name, group in rows.groupby(METHOD)
        }
        filters, adaptations = self.protocol["filters"], self.protocol["adaptations"]
        self.methods = [(model, adaptation) for model in filters for adaptation in adaptations]
        plain = self.protocol["plain"]
        self.y = np.array([(losses[name] - losses[name[0], plain]).to_numpy() for name in self.methods])
        judged = drives.loc[losses[self.methods[0]].columns]
        self.faults = {
            kind: judged[f"drawn.fault.{kind}"].notna().to_numpy() for kind, *_ in self.protocol["laws"]["faults"]
        }
        self.faults = {"no fault": ~np.any(list(self.faults.values()), axis=0), **self.faults}

    @property
    def literature(self) -> np.ndarray:
        """A mask of the methods whose adaptation was published, exactly or in a simplified form."""
        return np.array([self.protocol["adaptations"][name] != "own" for _, name in self.methods])

    def average(self, drives: np.ndarray | None = None) -> tuple[float, float, float]:
        """Return the ratio of the average method of the literature and its interval (three families of hypotheses)."""
        y = self.y[self.literature].mean(axis=0)[None]
        mean, low, high = intervals(y if drives is None else y[:, :, drives], 0.05 / 3)
        return float(np.exp(mean[0])), float(np.exp(low[0])), float(np.exp(high[0]))

    def better_and_worse(self) -> dict[str, tuple[int, int]]:
        """Return the number of methods that are significantly better and worse under each kind of fault."""
        judged = {kind: mask for kind, mask in self.faults.items() if mask.sum() >= MIN_DRIVES}
        level, counts = 0.05 / (len(self.methods) * len(judged)), {}
        for kind, mask in judged.items():
            _, low, high = intervals(self.y[:, :, mask], level)
            counts[kind] = int((high < 0).sum()), int((low > 0).sum())
        return counts


def intervals(y: np.ndarray, level: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the mean of log ratios (methods, tunings, drives) and its interval over random tunings and random drives.

    Two-way analysis of variance without interaction; Satterthwaite's degrees of freedom; Hall's correction of skewness.
    """
    tunings, drives = y.shape[1:]
    mean = y.mean(axis=(1, 2))
    a, b = y.mean(axis=2) - mean[:, None], y.mean(axis=1) - mean[:, None]
    rest = y - mean[:, None, None] - a[:, :, None] - b[:, None, :]
    # Equal weights 1/D: S2 = 1/D and c = D/(D - 1), up to the factor that removes the bias of the weighted variance.
    S2, S3, S4 = 1 / drives, 1 / drives**2, 1 / drives**3
    c = S2 / (S2 - 2 * S3 + S2**2)
    V_drives = c * (b**2).sum(axis=1) / drives**2
    variance = ((a**2).sum(axis=1) - c * (rest**2).sum(axis=(1, 2)) / drives**2) / (tunings - 1)
    V_tunings = np.maximum(variance, variance.mean()) / tunings
    V = V_drives + V_tunings
    third = c * (b**3).sum(axis=1) / drives**3 + (a**3).sum(axis=1) / (tunings * (tunings - 1) * (tunings - 2))
    dof = V**2 / (V_drives**2 / (S2**2 / S4 - 1) + V_tunings**2 / (tunings - 1))
    q, error = stats.t.ppf(1 - level / 2, dof), np.sqrt(V)
    bend = SKEWNESS_REMOVED * third / error**3
    low, high = (mean - _hall_inverse(end, bend) * error for end in (q, -q))
    return mean, np.fmin(low, mean - q * error), np.fmax(high, mean + q * error)


def _hall_inverse(x: np.ndarray, bend: np.ndarray) -> np.ndarray:
    straight = x - bend / 6
    return np.where(np.abs(bend) > 1e-6, 3 * (np.cbrt(1 + bend * straight) - 1) / bend, straight)


def journeys(population: str) -> tuple[float, float, float, int]:
    """Return the median ratio of the average adaptation on real recordings, its exact interval, and their number.

    Each method is tuned 16 times, each time with 24 of its 48 settings, on all groups of recordings except the group
    that is judged. The value of a journey is the median over its recordings and the tunings. The interval of the median
    has the order statistics of the sign test.
    """
    protocol = yaml.safe_load((ROOT / "experiments/journeys/protocol.yaml").read_text(encoding="utf-8"))
    kinds = json.loads((RESULTS / "audit-full/protocol.json").read_text(encoding="utf-8"))["adaptations"]
    where = [
        (recording, journey, group)
        for group, rides in protocol["populations"][population]["groups"].items()
        for journey, recordings in rides.items()
        for recording in recordings
    ]
    recordings, journey, group = map(np.array, zip(*where, strict=True))
    rows = pd.read_parquet(RESULTS / "journeys/errors.parquet")
    rows = rows[(rows["variant"] == "as planned") & rows["recording"].isin(recordings)]
    rows = rows.astype(dict.fromkeys([*METHOD, "recording"], str))
    error = rows.assign(error_m=rows["error_m"].astype(float).fillna(np.inf)).pivot_table(
        index=[*METHOD, "setting"], columns="recording", values="error_m"
    )[recordings]
    failed = FAILED_COSTS * error.loc["constant_velocity", "none", 0]
    log_error = np.log(error.where(np.isfinite(error), failed, axis=1))
    seen = [np.sort(np.random.default_rng(r).choice(48, 24, replace=False)) for r in range(16)]

    def tuned(loss: np.ndarray) -> np.ndarray:
        best = np.zeros((len(seen), len(recordings)), dtype=int)
        for left_out in dict.fromkeys(group) if len(loss) > 1 else ():
            others = [loss[:, journey == name].mean(axis=1) for name in dict.fromkeys(journey[group != left_out])]
            mean = np.mean(others, axis=0)
            for r, settings in enumerate(seen):
                best[r, group == left_out] = settings[mean[settings].argmin()]
        return loss[best, np.arange(len(recordings))]

    losses = {name: tuned(table.to_numpy(dtype=float)) for name, table in log_error.groupby(METHOD)}
    ratios = [loss - losses[name[0], "none"] for name, loss in losses.items() if kinds.get(name[1], "own") != "own"]
    average = np.mean(ratios, axis=0)
    values = np.sort([np.median(average[:, journey == name]) for name in dict.fromkeys(journey)])
    n = len(values)
    k = int(stats.binom.ppf(0.025, n, 0.5))  # the largest k with P(X < k) <= 2.5 %
    return float(np.exp(np.median(values))), float(np.exp(values[k - 1])), float(np.exp(values[n - k])), n


def main() -> int:
    """Print the numbers; return 1 if one of them differs from the README."""
    block = re.search(
        r"<!-- audit -->\n(.*?)<!-- /audit -->", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL
    )
    if not block:
        sys.exit("README.md has no block between <!-- audit --> and <!-- /audit -->.")
    text = " ".join(block[1].split())
    audit = Audit(RESULTS / "audit-full")
    counts = audit.better_and_worse()
    average, outliers = audit.average(), audit.average(audit.faults["outliers"])
    without = audit.average(~audit.faults["outliers"])
    *real, number = journeys("J-GNSS")
    found = {
        r"(\d+) adaptive and all": len(audit.methods),
        r"on (\d+) new simulated drives": audit.y.shape[2],
        r"drives with outliers, (\d+) adaptive": counts["outliers"][0],
        r"of the same model, and (\d+) are worse": counts["outliers"][1],
        r"drives without a fault, (\w+) adaptive filter is better": counts["no fault"][0] or "no",
        r"is better, and (\d+) are worse": counts["no fault"][1],
        r"multiplies the error by (\S+) \(": f"{outliers[0]:.2f}",
        r"\(95 % interval (\S+ to [\d.]+)\) with outliers": "{1:.2f} to {2:.2f}".format(*outliers),
        r"\) with outliers, by (\S+) \(": f"{without[0]:.2f}",
        r"with outliers, by \S+ \((\S+ to [\d.]+)\) without outliers": "{1:.2f} to {2:.2f}".format(*without),
        r"without outliers, and by (\S+) \(": f"{average[0]:.2f}",
        r"\((\S+ to [\d.]+)\) overall": "{1:.2f} to {2:.2f}".format(*average),
        r"On (\d+) real GNSS trips": number,
        r"GNSS trips, the median is (\S+) \(": f"{real[0]:.2f}",
        r"the median is \S+ \((\S+ to [\d.]+)\)": "{1:.2f} to {2:.2f}".format(*real),
    }
    differ = 0
    for pattern, value in found.items():
        published = re.search(pattern, text)
        same = published is not None and published[1] == str(value)
        differ += not same
        quoted = published[1] if published else "not found"
        print(f"{'' if same else 'DIFFERS  '}README: {quoted}   recomputed: {value}   ({pattern})")
    print("\nMethods that are significantly better and worse, by kind of fault, in the two audits:")
    second = Audit(RESULTS / "audit-second").better_and_worse()
    for kind, (better, worse) in counts.items():
        again = second.get(kind, ("-", "-"))
        print(f"{kind:26s} better {better:3d} {again[0]:3d}   worse {worse:3d} {again[1]:3d}")
    return int(differ > 0)


if __name__ == "__main__":
    sys.exit(main())
