"""Jobs as the command line composes them, and as tests change them."""

from dataclasses import replace
from functools import cache

from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

from jerkbench.hydra_app.configuration import configured_job, register_schemas
from jerkbench.jobs.job import Protocol, build
from jerkbench.presets import config_folder


def composed(*overrides):
    """What Hydra makes of the words of one run."""
    register_schemas()
    with initialize_config_dir(str(config_folder().resolve()), version_base="1.3"):
        return compose("config", list(overrides), return_hydra_config=True)


@cache
def job_of_words(*overrides):
    """The job that the command line makes of its words."""
    config = composed(*overrides)
    bare = {key: value for key, value in config.items() if key != "hydra"}
    plain = OmegaConf.to_container(OmegaConf.create(bare), resolve=True)
    return configured_job(plain, config.hydra.runtime.choices, list(overrides))


def with_data(job, data):
    """The job over data of that identity."""
    scenario = replace(job.scenario)
    vars(scenario)["data"] = data
    return replace(job, scenario=scenario)


def with_method(job, **changed):
    """The job with another filter, adaptation, engine or r_scale."""
    return replace(job, method=replace(job.method, **changed))


def with_scenario(job, **changed):
    """The job over another dataset, with other disturbances or another attitude filter."""
    return replace(job, scenario=replace(job.scenario, **changed))


SHORT_FIELD = {
    "name": "field",
    "duration_s": 8.0,
    "imu_rate_hz": 50.0,
    "reference_rate_hz": 50.0,
    "position_latency_s": 0.0,
}
USUAL = {"dataset": SHORT_FIELD, "attitude": "tilt", "filter": "jerk", "adaptation": "none", "engine": "compiled"}


SPEC = {kind: {"name": name} for kind, name in {**USUAL, "dataset": "field", "filter": "baseline"}.items()}
SPEC |= {"engine": {"name": "filterpy"}, "disturbance": [{"name": "none"}]}
"""The smallest specification: the baseline on the field, with the reference engine."""


def job_with(protocol=None, disturbance="none", **parts):
    """A job with the usual parts, of which some are given by name or as mappings."""
    spec = {**USUAL, **parts, "disturbance": disturbance}
    spec = {kind: {"name": part} if isinstance(part, str) else part for kind, part in spec.items()}
    return build({**spec, "disturbance": [spec["disturbance"]]}, protocol or Protocol())
