"""Presets: as plain data, as Hydra composes them, and those of a folder of the user."""

import pytest
from omegaconf import OmegaConf

from commands import SHORT, verb
from jerkbench import plugins, presets
from jerkbench.errors import PluginError
from jerkbench.presets import preset, preset_files
from made_jobs import composed, job_of_words


def completed(kind, part):
    """A part with the defaults of its plugin, as Hydra shows it."""
    return OmegaConf.to_container(OmegaConf.merge(OmegaConf.structured(plugins.schema(kind, part["name"])), part))


KINDS = ("dataset", "disturbance", "attitude", "filter", "adaptation", "noise", "engine")


SHIPPED = {kind: names for kind in KINDS if (names := list(preset_files(kind)))}
TOGETHER = [
    {kind: names[k % len(names)] for kind, names in SHIPPED.items()} for k in range(max(map(len, SHIPPED.values())))
]
"""A preset of each kind for each composition by Hydra, which takes a third of a second."""


@pytest.mark.parametrize("names", TOGETHER, ids=lambda names: names["dataset"])
def test_every_preset_that_is_shipped_is_what_hydra_makes_of_it(names):
    made = composed(*(f"{kind}={name}" for kind, name in names.items()))
    for kind, name in names.items():
        require_the_same(kind, preset(kind, name), OmegaConf.to_container(made[kind], resolve=True))


def require_the_same(kind, part, wanted):
    if kind == "noise":
        assert part == {key: value for key, value in wanted.items() if value is not None}
    elif kind == "disturbance":
        assert list(part) == list(wanted)
        assert {key: completed(kind, one) for key, one in part.items()} == wanted
    else:
        assert completed(kind, part) == wanted


def test_the_papers_noise_is_its_filters_own_and_the_same_sigma_a_for_both():
    noise = preset("noise", "paper")
    jerk, bias = (plugins.create("filter", {"name": name}) for name in ("jerk", "bias"))

    assert noise["accel_mps2"] == jerk.accel_mps2 == bias.accel_mps2
    for model, names in (
        (jerk, ("jerk_mps3_per_sqrt_s", "initial_jerk_mps3")),
        (bias, ("bias_mps2_per_sqrt_s", "initial_bias_mps2")),
    ):
        assert {name: noise[name] for name in names} == {name: getattr(model, name) for name in names}


@pytest.fixture
def conf(tmp_path, monkeypatch):
    """A folder of presets of one's own; returns a function that writes one."""
    monkeypatch.setattr(presets, "config_folder", lambda: tmp_path)

    def write(kind, name, text):
        (tmp_path / kind).mkdir(exist_ok=True)
        (tmp_path / kind / f"{name}.yaml").write_text(text)

    return write


def test_presets_of_presets_are_merged_in_their_order(conf):
    conf("filter", "first", "defaults: [jerk]\naccel_mps2: 1.0\njerk_mps3_per_sqrt_s: 2.0\n")
    conf("filter", "second", "defaults: [first, _self_]\naccel_mps2: 3.0\n")
    assert preset("filter", "second") == {"name": "jerk", "accel_mps2": 3.0, "jerk_mps3_per_sqrt_s": 2.0}
    conf("filter", "first", "defaults: [jerk]\naccel_mps2: 1.0\n")
    conf("filter", "under", "defaults: [_self_, first]\naccel_mps2: 3.0\n")
    assert preset("filter", "under")["accel_mps2"] == 1.0
    conf("disturbance", "one", "defaults: [bias, gnss_outage]\nbias: {accel_mps2: 1.0, gyro_radps: 2.0}\n")
    conf("disturbance", "two", "defaults: [one]\nbias: {gyro_radps: 3.0}\n")
    assert preset("disturbance", "two") == {
        "imu_bias": {"name": "imu_bias", "accel_mps2": 1.0, "gyro_radps": 3.0},
        "gnss_outage": {"name": "gnss_outage"},
    }
    conf("dataset", "mine", "defaults:\n  - field\n  - override /attitude: real\n")
    with pytest.raises(PluginError, match="override /attitude"):
        preset("dataset", "mine")


def test_a_preset_reads_an_environment_variable_only_on_request(conf, monkeypatch):
    conf("filter", "mine", "defaults: [jerk]\naccel_mps2: ${oc.env:SECRET}\n")
    monkeypatch.setenv("SECRET", "0.5")

    with pytest.raises(PluginError, match="JERKBENCH_ENV=SECRET"):
        preset("filter", "mine")

    monkeypatch.setenv("JERKBENCH_ENV", "SECRET")
    assert preset("filter", "mine")["accel_mps2"] == "0.5"


def test_everything_at_once_as_the_page_says_and_put_together_by_hand():
    one = job_of_words("experiment=field_combined")
    dataset, (bias, multipath, rtk_float, outage) = one.scenario.dataset, one.scenario.disturbances
    assert one.labels.dataset == "field_combined"
    assert (dataset.ruts, dataset.vibration_mps2, dataset.impacts_per_s, dataset.roughness) == (True, 1.0, 0.1, 2.0)
    assert (bias.accel_mps2, bias.gyro_radps) == (0.05, 0.001)
    assert multipath.bursts == 4
    assert [sum(end - begin for begin, end in one.windows_s) for one in (rtk_float, outage)] == [15, 8]
    by_hand = job_of_words("dataset=field_combined", "disturbance=combined")
    assert by_hand.scenario.disturbances == job_of_words("experiment=field_combined").scenario.disturbances
    assert job_of_words("disturbance=combined", "disturbance.rtk_float.time_s=5.0").scenario.disturbances[2].time_s == 5


def test_the_sweep_of_outages_has_a_seed_for_each_phase():
    one = job_of_words("experiment=outage_sweep", "disturbance.outage_sweep.length_s=30")
    assert one.scenario.disturbances[0].length_s == 30
    assert len(one.draws) == one.scenario.disturbances[0].replicates()
    assert one.labels.disturbance == "outage_sweep(length_s=30)"


def test_two_of_the_same_disturbance_under_keys_of_their_own():
    words = ["disturbance=imu_bias", "+disturbance@disturbance.second=imu_bias", "disturbance.second.stream=second"]
    first, second = job_of_words(*words).scenario.disturbances
    assert (first.stream, second.stream) == ("", "second")


QUICK = ["seeds=1", "figures=false", "workers=1"]


@pytest.fixture
def own(tmp_path):
    drive = "# A short drive of my own.\ndefaults: [field, _self_]\nduration_s: 14\n"
    for kind, name, text in (
        ("dataset", "mine", drive),
        ("noise", "loud", "# A noise of my own.\naccel_mps2: 0.7\n"),
    ):
        folder = tmp_path / f"of {kind}" / kind
        folder.mkdir(parents=True)
        (folder / f"{name}.yaml").write_text(text)
    return ["--config-dir", "of dataset", "--config-dir=of noise"]


def said(tmp_path, *words):
    done = verb(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_preset_of_ones_own_is_listed_shown_and_inspected(tmp_path, own):
    assert "A short drive of my own." in said(tmp_path, "list", "dataset", *own)
    assert "A noise of my own." in said(tmp_path, *own, "list", "noise")
    assert "duration_s: 14" in said(tmp_path, "show", "dataset", "mine", *own)
    assert "14.00 s" in said(tmp_path, "data", "inspect", "mine", *own)
    said(tmp_path, "data", "convert", "mine", "mine.csv", *own)


def test_a_preset_of_ones_own_is_exported_scored_and_tuned(tmp_path, own):
    words = ["dataset=mine", "noise=loud"]
    said(tmp_path, "data", "export", "out", *words, "seeds=1", *own)
    said(tmp_path, "data", "convert", "mine", "mine.tum", *own)
    said(tmp_path, "score", "mine.tum", *own, *words, "study=scored")
    tuned = said(
        tmp_path, "tune", "filter=jerk", *own, "dataset=mine", *QUICK[1:], "trials=2", "finalists=1",
        "tune_seeds=1", "choose_seeds=1", "test_seeds=2", "study=tuned",
    )  # fmt: skip
    command = next(line for line in tuned.splitlines() if line.startswith("Run the tuned method with: jerkbench "))

    assert command.count("--config-dir") == 3


def test_files_that_are_no_presets_are_not_compared_and_presets_are_forgotten_by_the_next_command(tmp_path, own):
    for folder in ("of dataset", "of noise"):
        (tmp_path / folder / "notes").mkdir()
        (tmp_path / folder / "notes" / "mine.yaml").write_text(f"# what {folder} is for\n")
    assert "A noise of my own." in said(tmp_path, "list", "noise", *own)
    said(tmp_path, "list", "dataset", *own)
    assert "no dataset 'mine'" in verb("run", "dataset=mine", *SHORT[1:], cwd=tmp_path).stderr


@pytest.mark.parametrize("words", [["--config-dir", "nowhere"], ["--config-dir"]])
def test_a_folder_that_is_not_there_is_a_sentence(tmp_path, words):
    done = verb("list", *words, cwd=tmp_path)

    assert done.returncode == 2
    assert "--config-dir needs a folder of presets" in done.stderr
