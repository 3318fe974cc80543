"""Jobs as the command line composes them, and as tests change them."""

from dataclasses import replace
from functools import cache

from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

from jerkbench.hydra_app.configuration import configured_job, register_schemas
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
