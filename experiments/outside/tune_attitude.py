"""Tune an attitude filter inside ``baseline`` with the budget of suite v2: python tune_attitude.py vqf|madgwick|mahony.

The suite itself tunes filters and adaptations, and uses the attitude filter of the data set. This script tries 32
settings of an attitude filter (the default and points of a Sobol sequence) on the 60 tuning drives of the suite. The
Kalman filter has the tuned setting of the plain filter, which does not change.
"""

import argparse
import dataclasses
import tempfile
from pathlib import Path

import yaml

from jerkbench.campaign.entry import NUMBERS, levels_of, losses_of_drives
from jerkbench.campaign.protocol import SuiteProtocol, read_suite
from jerkbench.campaign.runs import CampaignRuns, Space, TunableParameter, tried_settings
from jerkbench.jobs.job import Job, Protocol
from jerkbench.jobs.names import job_of_parts
from jerkbench.jobs.progress import Progress
from jerkbench.parameters import ranges_of, type_of

SETTINGS = Path(__file__).parents[2] / "results/suite-v2/baseline-none/settings.yaml"


def job_with(attitude: dict[str, str] | None, values: dict[str, float], protocol: SuiteProtocol) -> Job:
    """Return the job of the plain filter with the values of settings.yaml and an attitude filter."""
    parts = {"filter": {"name": "baseline", "accel_mps2": values["filter.accel_mps2"]}, "adaptation": {"name": "none"}}
    parts |= {"dataset": dict(protocol.dataset), "engine": "compiled", "attitude": attitude}
    scale = {stream: values[f"r_scale.{stream}"] for stream in ("position", "velocity")}
    limits = Protocol(burn_in_s=protocol.burn_in_s, divergence_limit_m=protocol.divergence_limit_m)
    return job_of_parts(parts, [{"name": "none"}], None, limits, protocol.metrics, scale)


def main(name: str) -> None:
    """Print the loss of all settings, and the best setting."""
    protocol, plain = read_suite("v2"), yaml.safe_load(SETTINGS.read_text(encoding="utf-8"))["plain"]
    seeds = protocol.seeds_to_tune_on
    with tempfile.TemporaryDirectory() as folder:
        runs = CampaignRuns(Path(folder))
        default = dataclasses.replace(job_with(None, plain["given"], protocol), draws=seeds)
        levels = levels_of(runs.rows([default], NUMBERS, Progress(0)))
        job = job_with({"name": name}, plain["drives"], protocol)
        attitude, kind = job.scenario.attitude, type(job.scenario.attitude)
        ranges = ranges_of(kind).items()
        space = Space(
            tuple(TunableParameter("attitude", n, r, float(getattr(attitude, n)), type_of(kind, n)) for n, r in ranges)
        )
        tried = tried_settings(protocol.trials, space)
        jobs = [dataclasses.replace(space.applied(job, setting), draws=seeds) for setting in tried]
        rows = runs.rows(jobs, NUMBERS, Progress(0))
    means = losses_of_drives(rows, levels).groupby(rows["job_index"]).mean()
    for index, loss in means.sort_values(kind="stable").items():
        print(f"{loss:.4f}", dict(zip(space.names, tried[index], strict=True)))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("attitude")
    main(parser.parse_args().attitude)
