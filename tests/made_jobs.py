"""Jobs as tests change them."""

from dataclasses import replace


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
