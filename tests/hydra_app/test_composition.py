"""Jobs put together from parts are what Hydra composes one by one."""

import pytest
from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import OmegaConf

from jerkbench import plugins
from jerkbench.filters.kinematic import Bias
from jerkbench.hydra_app.composition import compose_jobs
from jerkbench.hydra_app.configuration import Schema, register_hydra_parts, register_schemas
from jerkbench.hydra_app.sweep_words import where_chosen
from jerkbench.presets import config_folder, preset_names

JOBS = [
    [dataset, disturbance, model, adaptation, noise, "seeds=3", "adaptation.window=2"][
        : 7 if "mtf" in adaptation else 6
    ]
    for dataset in ("dataset=field", "dataset=rtklib")
    for disturbance in ("disturbance=none", "disturbance=[withhold,twelve_outages]")
    for model in ("filter=jerk", "filter=baseline_untuned")
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
    return loader.load_configuration("config", [], run_mode=RunMode.MULTIRUN)


def by_hydra(loader, config, job):
    """What Hydra itself makes of a job: its configuration as plain data, and its choices."""
    composed = loader.load_sweep_config(config, list(job))
    plain = OmegaConf.to_container(composed, resolve=False)
    plain.pop("hydra")
    resolved = OmegaConf.to_container(OmegaConf.create(plain), resolve=True)
    return resolved, {k: v for k, v in composed.hydra.runtime.choices.items() if v is not None}


def of_parts(loader, config, jobs):
    """The same from parts."""
    made = compose_jobs(loader, config, jobs)
    assert [one.overrides for one in made] == [list(job) for job in jobs]
    return [(one.plain, {k: v for k, v in one.choices.items() if v is not None}) for one in made]


@pytest.fixture
def compositions(monkeypatch, loader):
    """What Hydra has composed."""
    calls, compose = [], loader.load_sweep_config
    monkeypatch.setattr(loader, "load_sweep_config", lambda sweep, job: calls.append(job) or compose(sweep, job))
    return calls


def test_parts_give_what_composing_each_job_gives_and_cost_few_compositions(loader, compositions):
    config = base(loader)
    together = of_parts(loader, config, JOBS)

    assert len(JOBS) == 32
    assert len(compositions) == 2  # with a data set that prefers an attitude filter, and without
    for k in range(0, 32, 5):
        assert together[k] == by_hydra(loader, config, JOBS[k]), JOBS[k]


def test_every_plugin_and_preset_is_what_hydra_makes_of_it(loader, compositions):
    """One value of each group after the other, until none has another one."""
    config = base(loader)
    values = {
        group: [*plugins.names(group), *preset_names(group)] if group in plugins.KINDS else preset_names(group)
        for group in ("filter", "adaptation", "noise", "disturbance", "attitude")
    }
    most = max(map(len, values.values()))
    jobs = [[f"{group}={names[k % len(names)]}" for group, names in values.items()] for k in range(most)]
    together = of_parts(loader, config, jobs)

    assert len(compositions) < len(jobs)
    for k in range(0, most, 3):
        assert together[k] == by_hydra(loader, config, jobs[k]), jobs[k]


@pytest.mark.slow
def test_every_data_set_is_what_hydra_makes_of_it_and_none_is_composed_as_a_whole(loader, compositions):
    config = base(loader)
    names = [*plugins.names("dataset"), *preset_names("dataset")]
    jobs = [["experiment=paper", "burn_in_s=3", f"dataset={name}"] for name in names]
    jobs += [
        ["experiment=paper", "burn_in_s=3", "dataset=field_white", f"attitude={name}"] for name in ("tilt", "gyro_only")
    ]
    together = of_parts(loader, config, jobs)

    assert len(compositions) == 3  # data sets that prefer an attitude filter, others, and a chosen one
    assert together == [by_hydra(loader, config, job) for job in jobs]


def test_parameters_of_other_data_sets_are_what_composing_each_gives(loader, compositions):
    config = base(loader)
    jobs = [
        [f"dataset={name}", f"dataset.duration_s={length}", f"seeds={seeds}"]
        for name in ("field", "field_white_ruts")
        for length in ("20", "30.5")
        for seeds in ("2", "3")
    ]

    assert of_parts(loader, config, jobs) == [by_hydra(loader, config, job) for job in jobs]


@pytest.mark.parametrize("names", [("field", "own", "field_white"), ("own", "field", "other")])
def test_a_data_set_that_decides_more_is_composed_as_a_whole(loader, names, tmp_path):
    (tmp_path / "dataset").mkdir()
    for name, seeds in (("own", 7), ("other", 8)):
        (tmp_path / "dataset" / f"{name}.yaml").write_text(
            f"# @package _global_\ndefaults:\n  - field@dataset\n  - _self_\nseeds: {seeds}\n", encoding="utf-8"
        )
    words = [f"hydra.searchpath=[file://{tmp_path}]"]
    config = loader.load_configuration("config", words, run_mode=RunMode.MULTIRUN)
    jobs = [[f"dataset={name}"] for name in names]

    made = of_parts(loader, config, jobs)
    assert made == [by_hydra(loader, config, job) for job in jobs]
    assert [plain["seeds"] for plain, _ in made] == [{"own": 7, "other": 8}.get(name, Schema.seeds) for name in names]


@pytest.mark.slow
def test_an_experiment_that_decides_a_part_decides_it_for_whatever_takes_its_place(loader, tmp_path):
    """What an experiment says of a filter holds for all filters that have such a parameter."""
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "own.yaml").write_text(
        "# @package _global_\nstudy: own\nfilter:\n  accel_mps2: 0.7\n", encoding="utf-8"
    )
    words = [f"hydra.searchpath=[file://{tmp_path}]"]
    config = loader.load_configuration("config", words, run_mode=RunMode.MULTIRUN)
    jobs = [["experiment=own", f"filter={name}"] for name in ("jerk", "baseline", "baseline_untuned")]
    jobs += [["experiment=own", "filter=jerk", "filter.accel_mps2=3"]]

    made = of_parts(loader, config, jobs)
    assert made == [by_hydra(loader, config, job) for job in jobs]
    assert [plain["filter"]["accel_mps2"] for plain, _ in made] == [0.7, 0.7, 0.7, 3]


@pytest.mark.slow
def test_what_an_experiment_says_of_any_group_is_as_hydra_has_it(loader, tmp_path):
    """Of the noise, which has numbers only, and of the attitude filter, which a data set chooses otherwise."""
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "own.yaml").write_text(
        "# @package _global_\ndefaults:\n  - override /attitude: field\n  - override /engine: filterpy\n"
        "noise:\n  accel_mps2: null\n  jerk_mps3_per_sqrt_s: 3\ndisturbance:\n  bias:\n    accel_mps2: 7\n",
        encoding="utf-8",
    )
    words = [f"hydra.searchpath=[file://{tmp_path}]"]
    config = loader.load_configuration("config", words, run_mode=RunMode.MULTIRUN)
    jobs = [
        ["experiment=own", f"noise={noise}", f"disturbance={disturbance}", f"dataset={dataset}"]
        for noise in ("paper", "default")
        for disturbance in ("bias", "[bias,combined]")
        for dataset in ("tokyo_1105", "field")
    ]
    jobs += [
        ["experiment=own", "disturbance=imu_bias", "noise.accel_mps2=0.5", f"attitude={name}"]
        for name in ("tilt", "field")
    ]

    assert of_parts(loader, config, jobs) == [by_hydra(loader, config, job) for job in jobs]


@pytest.mark.slow
@pytest.mark.filterwarnings(r"ignore:\s*'filter/baseline' is validated against ConfigStore schema")
def test_a_file_of_ones_own_stands_for_the_plugin_of_its_name_wherever_that_is_chosen(loader, tmp_path):
    (tmp_path / "filter").mkdir()
    (tmp_path / "filter" / "baseline.yaml").write_text("accel_mps2: 9.0\n", encoding="utf-8")
    words = [f"hydra.searchpath=[file://{tmp_path}]"]
    config = loader.load_configuration("config", words, run_mode=RunMode.MULTIRUN)
    jobs = [
        [f"filter={name}", f"adaptation={rule}"]
        for name in ("baseline", "baseline_untuned", "bias")
        for rule in ("none", "mtf")
    ]

    made = of_parts(loader, config, jobs)
    assert made == [by_hydra(loader, config, job) for job in jobs]
    assert [plain["filter"]["accel_mps2"] for plain, _ in made[::2]] == [9.0, 0.02, Bias.accel_mps2]


def test_disturbances_of_which_two_set_the_same_one_are_what_hydra_makes_of_them(loader):
    config = base(loader)
    lists = ("[combined,gnss_outage]", "[twelve_outages,outage_20_40]", "[gnss_outage,bias]", "[bias,bias]")
    jobs = [[f"disturbance={names}"] for names in lists]

    assert of_parts(loader, config, jobs) == [by_hydra(loader, config, job) for job in jobs]


@pytest.mark.parametrize("word", ["filter=blank", "noise=blank", "dataset=nope"])
def test_what_stands_for_any_choice_cannot_be_chosen_and_is_not_offered(loader, word):
    with pytest.raises(HydraException) as raised:
        compose_jobs(loader, base(loader), [["adaptation=mtf", word], ["adaptation=none", word]])
    assert "\tblank" not in str(raised.value)


def test_an_experiment_that_takes_a_choice_away_takes_any_away(loader, tmp_path):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "own.yaml").write_text("# @package _global_\nfilter: null\n", encoding="utf-8")
    words = [f"hydra.searchpath=[file://{tmp_path}]"]
    config = loader.load_configuration("config", words, run_mode=RunMode.MULTIRUN)

    made = compose_jobs(
        loader, config, [["experiment=own", f"filter={name}", "noise=paper"] for name in ("jerk", "bias")]
    )
    assert [one.plain["filter"] for one in made] == [None, None]


def test_what_an_experiment_says_that_a_plugin_does_not_know_is_refused(loader, tmp_path):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "own.yaml").write_text(
        "# @package _global_\nadaptation:\n  window: 7\n", encoding="utf-8"
    )
    words = [f"hydra.searchpath=[file://{tmp_path}]"]
    config = loader.load_configuration("config", words, run_mode=RunMode.MULTIRUN)
    with pytest.raises(HydraException):
        compose_jobs(loader, config, [["experiment=own", f"adaptation={name}"] for name in ("mtf", "none")])


def test_several_experiments_are_composed_each_by_its_parts(loader, compositions):
    rules = ("none", "mtf", "huber", "scalar_r")
    jobs = [[f"experiment={name}", f"adaptation={rule}"] for rule in rules for name in ("paper", "drive")]
    jobs += [["experiment=drive", "dataset.folder=anywhere"]]
    together = of_parts(loader, base(loader), jobs)

    assert len(compositions) == 3  # paper, drive, drive without a word on the adaptation
    assert together[::4] == [by_hydra(loader, base(loader), job) for job in jobs[::4]]
    assert [plain["study"] for plain, _ in together] == ["paper", "drive"] * 4 + ["drive"]


def test_what_refers_to_another_part_is_resolved_in_each_job(loader):
    jobs = [
        [f"filter={name}", f"adaptation={rule}", "notes=['${filter.name} ${adaptation.name}']"]
        for name in ("jerk", "bias")
        for rule in ("none", "mtf")
    ]
    made = compose_jobs(loader, base(loader), jobs)

    assert [one.plain["notes"] for one in made] == [["jerk none"], ["jerk mtf"], ["bias none"], ["bias mtf"]]


def test_values_of_a_parameter_take_one_composition_and_are_what_composing_each_gives(loader, compositions):
    config = base(loader)
    jobs = [
        [f"noise.accel_mps2={accel}", f"dataset.duration_s={length}", f"burn_in_s={burn}", "filter=jerk"]
        for accel in ("0.1", "0.2", "null")
        for length in ("20", "30.5")
        for burn in ("0", "7")
    ]
    made = of_parts(loader, config, jobs)

    assert len(compositions) == 1
    assert made[::4] == [by_hydra(loader, config, job) for job in jobs[::4]]


def test_a_value_of_a_grid_is_read_once(loader):
    config = base(loader)
    jobs = [
        ["filter=jerk", f"filter.accel_mps2={accel}", f"filter.jerk_mps3_per_sqrt_s={jerk}"]
        for accel in ("0.1", "0.2", "0.3")
        for jerk in ("1", "2", "3")
    ]
    plugins._field.cache_clear()
    made = of_parts(loader, config, jobs)

    assert plugins._field.cache_info().misses == 3  # 1, 2 and 3 for a float; a float is as its field has it
    assert made == [by_hydra(loader, config, job) for job in jobs]


def test_of_two_values_of_one_field_the_last_counts(loader):
    config, job = base(loader), ["filter=jerk", "filter.accel_mps2=0.1", "filter.accel_mps2=0.2"]
    assert of_parts(loader, config, [job]) == [by_hydra(loader, config, job)]


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

    assert where_chosen(loader, config, jobs) == [["disturbance=none"], jobs[2]]


def test_parameters_of_a_disturbance_that_no_job_chooses_stay(loader):
    jobs = [[f"disturbance={name}", OUTAGE] for name in ("none", "bias")]

    assert where_chosen(loader, base(loader), jobs) == jobs


@pytest.mark.slow
def test_a_preset_of_ones_own_that_decides_more_than_its_group_is_composed_as_a_whole(loader, tmp_path):
    (tmp_path / "filter").mkdir()
    (tmp_path / "filter" / "mine.yaml").write_text(
        "# @package _global_\ndefaults:\n  - jerk@filter\n  - _self_\nseeds: 7\n", encoding="utf-8"
    )
    words = [f"hydra.searchpath=[file://{tmp_path}]"]
    config = loader.load_configuration("config", words, run_mode=RunMode.MULTIRUN)
    jobs = [[f"filter={name}", f"adaptation={rule}"] for rule in ("none", "mtf") for name in ("jerk", "mine")]

    made = of_parts(loader, config, jobs)
    assert made == [by_hydra(loader, config, job) for job in jobs]
    assert [plain["seeds"] for plain, _ in made] == [Schema.seeds, 7] * 2
