"""A preset as plain data is what Hydra makes of the same file."""

import pytest
from omegaconf import OmegaConf

from jerkbench import plugins, presets
from jerkbench.errors import PluginError
from jerkbench.presets import preset, preset_names
from made_jobs import composed

KINDS = ("dataset", "disturbance", "attitude", "filter", "adaptation", "noise", "engine")
SHIPPED = [(kind, name) for kind in KINDS for name in preset_names(kind)]


def by_hydra(kind, name):
    return OmegaConf.to_container(composed(f"{kind}={name}")[kind], resolve=True)


def completed(kind, part):
    """A part with the defaults of its plugin, as Hydra shows it."""
    return OmegaConf.to_container(OmegaConf.merge(OmegaConf.structured(plugins.schema(kind, part["name"])), part))


@pytest.mark.parametrize(("kind", "name"), SHIPPED)
def test_every_preset_that_is_shipped_is_what_hydra_makes_of_it(kind, name):
    part, wanted = preset(kind, name), by_hydra(kind, name)

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
    assert (noise["jerk_mps3_per_sqrt_s"], noise["initial_jerk_mps3"]) == (
        jerk.jerk_mps3_per_sqrt_s,
        jerk.initial_jerk_mps3,
    )
    assert (noise["bias_mps2_per_sqrt_s"], noise["initial_bias_mps2"]) == (
        bias.bias_mps2_per_sqrt_s,
        bias.initial_bias_mps2,
    )


@pytest.fixture
def conf(tmp_path, monkeypatch):
    """A folder of presets of one's own; returns a function that writes one."""
    monkeypatch.setattr(presets, "config_folder", lambda: tmp_path)

    def write(kind, name, text):
        (tmp_path / kind).mkdir(exist_ok=True)
        (tmp_path / kind / f"{name}.yaml").write_text(text)

    return write


def test_a_preset_of_a_preset_is_read_to_the_end(conf):
    conf("filter", "first", "defaults: [jerk]\naccel_mps2: 1.0\njerk_mps3_per_sqrt_s: 2.0\n")
    conf("filter", "second", "defaults: [first, _self_]\naccel_mps2: 3.0\n")

    assert preset("filter", "second") == {"name": "jerk", "accel_mps2": 3.0, "jerk_mps3_per_sqrt_s": 2.0}


def test_what_stands_later_wins_and_self_says_where_the_own_values_stand(conf):
    conf("filter", "first", "defaults: [jerk]\naccel_mps2: 1.0\n")
    conf("filter", "under", "defaults: [_self_, first]\naccel_mps2: 3.0\n")

    assert preset("filter", "under")["accel_mps2"] == 1.0


def test_disturbances_of_presets_are_merged_by_their_names(conf):
    conf("disturbance", "one", "defaults: [bias, gnss_outage]\nbias: {accel_mps2: 1.0, gyro_radps: 2.0}\n")
    conf("disturbance", "two", "defaults: [one]\nbias: {gyro_radps: 3.0}\n")

    assert preset("disturbance", "two") == {
        "imu_bias": {"name": "imu_bias", "accel_mps2": 1.0, "gyro_radps": 3.0},
        "gnss_outage": {"name": "gnss_outage"},
    }


def test_a_preset_that_reaches_into_another_group_is_a_sentence(conf):
    conf("dataset", "mine", "defaults:\n  - field\n  - override /attitude: real\n")

    with pytest.raises(PluginError, match="override /attitude"):
        preset("dataset", "mine")


def test_an_unknown_preset_names_the_nearest():
    with pytest.raises(PluginError, match="Did you mean 'baseline_untuned'"):
        preset("filter", "baseline_untund")


def test_a_preset_reads_an_environment_variable_only_on_request(conf, monkeypatch):
    conf("filter", "mine", "defaults: [jerk]\naccel_mps2: ${oc.env:SECRET}\n")
    monkeypatch.setenv("SECRET", "0.5")

    with pytest.raises(PluginError, match="JERKBENCH_ENV=SECRET"):
        preset("filter", "mine")

    monkeypatch.setenv("JERKBENCH_ENV", "SECRET")
    assert preset("filter", "mine")["accel_mps2"] == "0.5"
