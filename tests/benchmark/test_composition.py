"""Jobs put together from parts are what Hydra composes one by one."""

import pytest
from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra

from jerkbench.benchmark import composition
from jerkbench.benchmark.app import _register_hydra_parts
from jerkbench.benchmark.composition import compose_jobs
from jerkbench.benchmark.configuration import register_schemas
from jerkbench.presets import config_folder

JOBS = [
    [dataset, disturbance, model, adaptation, noise, "seeds=3", "adaptation.window=2"][
        : 7 if "mtf" in adaptation else 6
    ]
    for dataset in ("dataset=field", "dataset=rtklib")
    for disturbance in ("disturbance=none", "disturbance=[withhold,twelve_outages]")
    for model in ("filter=jerk", "filter=baseline_naive")
    for adaptation in ("adaptation=mtf", "adaptation=none")
    for noise in ("noise.accel_mps2=0.3", "noise.accel_mps2=null")
]


@pytest.fixture
def loader():
    register_schemas()
    _register_hydra_parts()
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        yield GlobalHydra.instance().config_loader()


def base(loader):
    from hydra.types import RunMode

    return loader.load_configuration("config", [], run_mode=RunMode.MULTIRUN)


def test_parts_give_what_composing_each_job_gives_and_cost_one_composition_for_each_value(loader, monkeypatch):
    config = base(loader)
    chosen = range(0, 32, 5)
    one_by_one = [composition._resolved(composition._compose(loader, config, JOBS[k])) for k in chosen]
    calls = []
    original = composition._compose
    monkeypatch.setattr(composition, "_compose", lambda *words: calls.append(words) or original(*words))
    together = compose_jobs(loader, config, JOBS)

    assert len(JOBS) == 32
    assert len(calls) <= 12  # two values of five factors, and one for each group that no job mentions
    for k, alone in zip(chosen, one_by_one, strict=True):
        job, part = JOBS[k], together[k]
        assert alone.plain == part.plain, job
        assert {k: v for k, v in alone.choices.items() if v is not None} == {
            k: v for k, v in part.choices.items() if v is not None
        }, job
        assert sorted(alone.overrides) == sorted(part.overrides)


def test_several_experiments_are_composed_one_by_one(loader):
    jobs = [["experiment=paper"], ["experiment=drive", "dataset.folder=anywhere"]]
    paper, drive = compose_jobs(loader, base(loader), jobs)

    assert (paper.plain["dataset"]["name"], drive.plain["dataset"]["name"]) == ("field", "rtklib")
    assert (paper.plain["study"], drive.plain["study"]) == ("paper", "drive")


def test_what_refers_to_another_part_is_resolved_in_each_job(loader):
    jobs = [
        [f"filter={name}", f"adaptation={rule}", "notes=['${filter.name} ${adaptation.name}']"]
        for name in ("jerk", "bias")
        for rule in ("none", "mtf")
    ]
    made = compose_jobs(loader, base(loader), jobs)

    assert [one.plain["notes"] for one in made] == [["jerk none"], ["jerk mtf"], ["bias none"], ["bias mtf"]]
