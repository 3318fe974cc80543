"""Jobs put together from parts are what Hydra composes one by one."""

import pytest
from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException

from jerkbench.hydra_app import composition
from jerkbench.hydra_app.composition import compose_jobs
from jerkbench.hydra_app.configuration import register_schemas
from jerkbench.hydra_app.hydra_parts import register_hydra_parts
from jerkbench.hydra_app.swept_disturbances import only_of_chosen
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
    register_hydra_parts()
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
    assert paper.plain["seeds"] == 20


def test_what_refers_to_another_part_is_resolved_in_each_job(loader):
    jobs = [
        [f"filter={name}", f"adaptation={rule}", "notes=['${filter.name} ${adaptation.name}']"]
        for name in ("jerk", "bias")
        for rule in ("none", "mtf")
    ]
    made = compose_jobs(loader, base(loader), jobs)

    assert [one.plain["notes"] for one in made] == [["jerk none"], ["jerk mtf"], ["bias none"], ["bias mtf"]]


def test_values_of_a_parameter_take_one_composition_and_are_what_composing_each_gives(loader, monkeypatch):
    config = base(loader)
    jobs = [
        [f"noise.accel_mps2={accel}", f"dataset.duration_s={length}", f"burn_in_s={burn}", "filter=jerk"]
        for accel in ("0.1", "0.2", "null")
        for length in ("20", "30.5")
        for burn in ("0", "7")
    ]
    alone = [composition._resolved(composition._compose(loader, config, job)) for job in jobs]
    calls = []
    original = composition._compose
    monkeypatch.setattr(composition, "_compose", lambda *words: calls.append(words) or original(*words))

    assert [one.plain for one in compose_jobs(loader, config, jobs)] == [one.plain for one in alone]
    assert len(calls) <= 2


def test_a_value_of_the_wrong_type_is_refused_wherever_it_stands(loader):
    jobs = [["noise.accel_mps2=0.1"], ["noise.accel_mps2=much"]]
    with pytest.raises(HydraException):
        compose_jobs(loader, base(loader), jobs)


OUTAGE = "disturbance.gnss_outage.windows_s=[[5,6]]"


def test_parameters_of_disturbances_go_to_the_jobs_that_choose_them(loader):
    config = base(loader)
    jobs = [
        ["disturbance=none", OUTAGE, "disturbance.gnss_outage.heading=true"],
        ["disturbance=none", OUTAGE, "disturbance.gnss_outage.heading=false"],
        ["disturbance=twelve_outages", OUTAGE, "disturbance.gnss_outage.heading=true"],
    ]

    assert only_of_chosen(loader, config, jobs) == [["disturbance=none"], jobs[2]]


def test_parameters_of_a_disturbance_that_no_job_chooses_stay(loader):
    jobs = [[f"disturbance={name}", OUTAGE] for name in ("none", "bias")]

    assert only_of_chosen(loader, base(loader), jobs) == jobs
