"""The jobs of a sweep are the jobs that Hydra gives when it composes each of them, and need few compositions."""

import json

import pytest
from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.types import RunMode
from omegaconf import OmegaConf

from jerkbench import plugins
from jerkbench.errors import PluginError
from jerkbench.hydra_app.composition import compose_jobs
from jerkbench.hydra_app.configuration import configured_job, register_schemas
from jerkbench.presets import config_folder, preset_files, search_path_overrides, take_folders
from made_jobs import job_of_words


@pytest.fixture
def loader():
    register_schemas()
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        yield GlobalHydra.instance().config_loader()


@pytest.fixture
def compositions(monkeypatch, loader):
    """What Hydra has composed."""
    calls, compose = [], loader.load_sweep_config
    monkeypatch.setattr(loader, "load_sweep_config", lambda sweep, job: calls.append(job) or compose(sweep, job))
    return calls


@pytest.fixture
def folder(tmp_path):
    """Return a function that writes presets into a --config-dir."""

    def write(files):
        for name, text in files.items():
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).write_text(text, encoding="utf-8")
        take_folders(["--config-dir", str(tmp_path)])

    yield write
    take_folders([])


def base(loader):
    return loader.load_configuration("config", search_path_overrides(), run_mode=RunMode.MULTIRUN)


def identity(job):
    """All that a job is made of, and its labels."""
    return json.dumps([job.spec, job.protocol.limits, list(job.draws), job.labels])


def by_hydra(loader, sweep, words):
    composed = loader.load_sweep_config(sweep, list(words))
    choices = dict(composed.hydra.runtime.choices)
    bare = OmegaConf.masked_copy(composed, [key for key in composed if key != "hydra"])
    return identity(configured_job(OmegaConf.to_container(bare, resolve=True), choices, list(words)))


def together(loader, jobs):
    return [identity(one.job()) for one in compose_jobs(loader, base(loader), jobs)]


def each_by_hydra(loader, jobs):
    sweep = base(loader)
    return [by_hydra(loader, sweep, job) for job in jobs]


def grid(**values):
    """Every combination of words: a dictionary of keys with their values."""
    jobs = [[]]
    for key, several in values.items():
        jobs = [[*job, f"{key.replace('__', '.')}={value}"] for job in jobs for value in several]
    return jobs


GRIDS = {
    "groups": (
        grid(
            dataset=["field", "rtklib"],
            disturbance=["none", "[withhold,twelve_outages]"],
            filter=["jerk", "baseline_untuned"],
            adaptation=["mtf", "none"],
            noise__accel_mps2=["0.3", "null"],
            seeds=["3"],
        ),
        1,
    ),
    "values": (
        grid(
            filter=["jerk"],
            noise__accel_mps2=["0.1", "2", "null"],
            dataset__duration_s=["20", "30.5"],
            burn_in_s=[0, 7],
        ),
        2,  # options are left to Hydra
    ),
    "options": (grid(seeds=[2, 3], metrics=["[all]", "[position_rmse]"], r_scale__position=[1, 2]), 4),
    "disturbances": (
        grid(
            disturbance=[
                "[combined,gnss_outage]",
                "[twelve_outages,outage_20_40]",
                "[gnss_outage,imu_bias]",
                "combined",
            ],
            disturbance__gnss_outage__heading=["true", "false"],
        )[:2],
        1,
    ),
    "experiments": (grid(experiment=["paper", "field_combined"], adaptation=["none", "mtf", "huber"]), 2),
    "references": (
        grid(
            filter=["jerk", "bias"],
            adaptation=["none", "mtf"],
            burn_in_s=["${seeds}"],
            dataset__duration_s=["2${seeds}"],
        ),
        1,
    ),
    "packages": (grid(**{"+disturbance@disturbance.second": ["gnss_outage"], "filter": ["jerk", "bias"]}), 1),
    "old names": (grid(disturbance=["bias"], noise=["naive", "own"], dataset=["field_v1_ruts"]), 1),
}


@pytest.mark.parametrize("name", GRIDS)
def test_jobs_are_those_of_hydra_and_need_few_compositions(loader, compositions, name):
    jobs, most = GRIDS[name]
    made = together(loader, jobs)

    assert len(compositions) == most
    some = [*range(0, len(jobs) - 1, 5), len(jobs) - 1]
    assert [made[k] for k in some] == each_by_hydra(loader, [jobs[k] for k in some])


def test_every_plugin_and_preset_gives_the_job_of_hydra(loader, compositions):
    values = {
        group: [*(plugins.names(group) if group in plugins.KINDS else ()), *preset_files(group)]
        for group in ("filter", "adaptation", "noise", "disturbance", "attitude")
    }
    needy = {"command", "trajectory", "attitude_command", "replayed_gnss"}  # they need a program or a file
    values = {group: [name for name in names if name not in needy] for group, names in values.items()}
    most = max(map(len, values.values()))
    jobs = [[f"{group}={names[k % len(names)]}" for group, names in values.items()] for k in range(most)]
    made = together(loader, jobs)

    assert len(compositions) == 1
    assert made[::4] == each_by_hydra(loader, jobs[::4])


@pytest.mark.slow
def test_every_data_set_brings_the_attitude_filter_that_it_prefers(loader):
    names = [*plugins.names("dataset"), *preset_files("dataset")]
    jobs = [["burn_in_s=3", f"dataset={name}"] for name in names]
    sweep = base(loader)

    for one, job in zip(compose_jobs(loader, sweep, jobs), jobs, strict=True):
        config = loader.load_sweep_config(sweep, job)
        for group in ("dataset", "attitude"):
            assert one.plain[group] == OmegaConf.to_container(config[group])


G = "# @package _global_\n"
PRESETS = {
    "values of any filter": (
        {"experiment/mine.yaml": f"{G}filter:\n  accel_mps2: 0.7\n"},
        [
            *grid(experiment=["mine"], filter=["jerk", "baseline_untuned"]),
            ["experiment=mine", "filter=jerk", "filter.accel_mps2=3"],
        ],
    ),
    "an attitude filter": (
        {
            "experiment/mine.yaml": f"{G}defaults:\n  - override /attitude: field\n  - override /engine: filterpy\n"
            "noise:\n  accel_mps2: null\n  jerk_mps3_per_sqrt_s: 3\ndisturbance:\n  imu_bias:\n    accel_mps2: 7\n"
        },
        [
            *grid(
                experiment=["mine"],
                noise=["paper", "default"],
                disturbance=["imu_bias", "[imu_bias,combined]"],
                dataset=["tokyo_1105", "field"],
            ),
            ["experiment=mine", "disturbance=imu_bias", "noise.accel_mps2=0.5", "attitude=tilt"],
        ],
    ),
    "more than its group": (
        {
            "dataset/mine.yaml": f"{G}defaults:\n  - field@dataset\n  - _self_\nseeds: 7\n",
            "filter/mine.yaml": f"{G}defaults:\n  - jerk@filter\n  - _self_\nburn_in_s: 7\n",
        },
        grid(dataset=["mine", "field"], filter=["mine", "jerk"], adaptation=["mtf"]),
    ),
    "a preset of a preset": (
        {
            "filter/mine.yaml": "defaults: [baseline_untuned, _self_]\naccel_mps2: 0.3\n",
            "disturbance/mine.yaml": "# @package disturbance\ndefaults: [imu_bias, dropout, _self_]\n"
            "imu_bias: {accel_mps2: 2}\n",
        },
        grid(filter=["mine", "jerk"], disturbance=["mine", "[mine,gnss_outage]", "none"]),
    ),
    "lists in the defaults": (
        {
            "experiment/mine.yaml": f"{G}defaults:\n  - override /disturbance: [imu_bias, combined]\n"
            "notes: ['${filter.name}']\n"
        },
        [
            *grid(experiment=["mine"], filter=["jerk", "bias"], disturbance__imu_bias__accel_mps2=[1]),
            ["experiment=mine", "disturbance=none"],
        ],
    ),
}


@pytest.mark.parametrize("name", PRESETS)
def test_presets_of_the_user_mean_what_hydra_makes_of_them(loader, folder, name):
    files, jobs = PRESETS[name]
    folder(files)

    assert together(loader, jobs) == each_by_hydra(loader, jobs)


@pytest.mark.filterwarnings(r"ignore:\s*'filter/baseline' is validated against ConfigStore schema")
def test_a_file_with_the_name_of_a_plugin_replaces_it_wherever_it_is_chosen(loader, folder):
    folder({"filter/baseline.yaml": "accel_mps2: 9.0\n"})
    jobs = grid(filter=["baseline", "baseline_untuned", "bias"], adaptation=["none"])

    assert together(loader, jobs) == each_by_hydra(loader, jobs)


def test_an_experiment_may_not_take_a_choice_away(loader, folder):
    folder({"experiment/mine.yaml": f"{G}filter: null\n"})
    with pytest.raises(PluginError, match="Exactly one filter must be chosen"):
        together(loader, [["experiment=mine", "filter=jerk"]])


@pytest.mark.parametrize("name", ["baseline", "baseline_untuned"])
def test_addressed_parameters_go_to_the_jobs_that_choose_their_plugin_or_preset(loader, name):
    jobs = grid(
        disturbance=["none", "gnss_outage"],
        disturbance__gnss_outage__heading=["true", "false"],
        filter=["baseline_untuned", "jerk"],
        **{f"filter.{name}.accel_mps2": ["0.5"]},
    )
    fitted = [one.overrides for one in compose_jobs(loader, base(loader), jobs)]

    assert fitted == [
        *(
            ["disturbance=none", "filter=baseline_untuned", "filter.accel_mps2=0.5"],
            ["disturbance=none", "filter=jerk"],
        ),
        *(
            ["disturbance=gnss_outage", f"disturbance.gnss_outage.heading={heading}", *method]
            for heading in ("true", "false")
            for method in (["filter=baseline_untuned", "filter.accel_mps2=0.5"], ["filter=jerk"])
        ),
    ]


def test_topics_are_in_the_label_of_a_data_set_and_files_are_not():
    bag = ["dataset=rosbag", "dataset.file=some/drive.bag"]
    labels = [job_of_words(*bag, *more).labels.dataset for more in ([], ["dataset.heading_topic=/imu/data"])]

    assert labels == ["rosbag", "rosbag(heading_topic=/imu/data)"]
