"""Compare the entries of outside programs with the same model in jerkbench: python compare.py [v2|v2-tiny].

For each entry in results/suite-v2 (or results/suite-v2-tiny), the filter of jerkbench with the same equations runs with
the same setting on the same drives. The script prints the geometric mean of the error ratio with Student's 95 %
interval, and the median and the largest ratio of a drive.
"""

import argparse
import dataclasses
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats
from tune_attitude import job_with

from jerkbench.campaign.entry import NUMBERS
from jerkbench.campaign.protocol import SuiteProtocol, read_suite
from jerkbench.campaign.runs import CampaignRuns, MethodSpec
from jerkbench.jobs.job import Job
from jerkbench.jobs.progress import Progress

RESULTS = Path(__file__).parents[2] / "results"
FIXES_ONLY = {
    "angle_random_walk_deg_per_sqrt_h": 2.979,
    "velocity_random_walk_mps_per_sqrt_h": 1.772,
    "gyro_instability_deg_per_h": 0.3196,
    "accel_instability_mg": 0.0304,
    "use_velocity": False,
    "use_heading": False,
}
WITH_VELOCITY = {
    "angle_random_walk_deg_per_sqrt_h": 0.8316,
    "velocity_random_walk_mps_per_sqrt_h": 0.3737,
    "gyro_instability_deg_per_h": 12.33,
    "accel_instability_mg": 3.488,
    "use_heading": False,
}
PLAIN = {"filter.accel_mps2": 1.371, "r_scale.position": 1.671, "r_scale.velocity": 2.281}
VQF = {"tau_acc_s": 198.2, "rest_bias": False, "motion_bias": True, "bias_forgetting_s": 9792.0}
FILTERS = {
    "KF-GINS": (FIXES_ONLY, {"position": 8.967}),
    "GTSAM-iSAM2": (WITH_VELOCITY, {"position": 0.4231, "velocity": 0.8859}),
    "python-ins": (WITH_VELOCITY, {"position": 0.4231, "velocity": 0.8859}),
}
ATTITUDES = {
    "VQF-baseline": {"name": "vqf", **VQF},
    "ahrs-Madgwick-baseline": {"name": "madgwick", "gain_per_s": 0.000686},
}


def jobs(protocol: SuiteProtocol) -> dict[str, dict[str, Job]]:
    """Return the variants of the filter of jerkbench for each entry."""
    found: dict[str, dict[str, Job]] = {}
    for name, (values, scale) in FILTERS.items():
        variants = {"eskf15": {}, "eskf15, no bias from rest": {"gyro_bias_from_rest": False}}
        found[name] = {
            label: protocol.job(MethodSpec({"name": "eskf15", **values, **more}, {"name": "none"}, scale))
            for label, more in variants.items()
        }
    for name, attitude in ATTITUDES.items():
        found[name] = {f"attitude={attitude['name']}": job_with(attitude, PLAIN, protocol)}
        found[name]["attitude=field"] = job_with(None, PLAIN, protocol)
    return found


def main(scale: str) -> None:
    """Print a line for each entry and variant."""
    protocol = read_suite(scale)
    for name, variants in jobs(protocol).items():
        path = RESULTS / f"suite-{scale}" / name / "rows.parquet"
        if not path.is_file():
            continue
        rows = pd.read_parquet(path).query("method == 'entry'").set_index("seed")["position_rmse_m"]
        for label, job in variants.items():
            with tempfile.TemporaryDirectory() as folder:
                jobs_ = [dataclasses.replace(job, draws=protocol.seeds_to_test_on)]
                ours = CampaignRuns(Path(folder)).rows(jobs_, NUMBERS, Progress(0)).set_index("seed")
            d = np.log(rows / ours["position_rmse_m"]).dropna()
            low, high = np.exp(stats.t.interval(0.95, len(d) - 1, d.mean(), stats.sem(d)))
            worst = np.exp(d.loc[d.abs().idxmax()])
            text = (
                f"{np.exp(d.mean()):.4f} [{low:.4f}, {high:.4f}], median {np.exp(d.median()):.4f}, extreme {worst:.3f}"
            )
            print(f"{name} / {label} ({len(d)} drives): {text} (seed {d.abs().idxmax()})")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("scale", nargs="?", default="v2")
    main(parser.parse_args().scale)
