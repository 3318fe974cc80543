"""Registries: what a plugin is, how it is found, and what is said when something is wrong with it."""

import dataclasses
import math
from dataclasses import dataclass

import pytest
from omegaconf import OmegaConf

from jerkbench import plugins
from jerkbench.adaptation.mtf import Mtf
from jerkbench.errors import PluginError
from jerkbench.plugins.catalogue import show_text


def test_every_kind_has_plugins_and_each_says_in_one_line_what_it_is():
    for kind in plugins.KINDS:
        assert plugins.names(kind)
        for name in plugins.names(kind):
            cls = plugins.get(kind, name)
            first = (cls.__doc__ or "").split("\n", 1)[0]
            assert first.endswith("."), f"{kind} {name}: {first!r}"
            for f in dataclasses.fields(cls):
                assert f"{f.name}:" in show_text(kind, name), f"{kind} {name} does not document {f.name}"


def test_a_wrong_name_or_parameter_names_the_nearest():
    with pytest.raises(PluginError, match=r"mean 'mtf'.* sage_husa"):
        plugins.get("adaptation", "mtv")
    with pytest.raises(PluginError, match="mean 'window'"):
        plugins.create("adaptation", {"name": "mtf", "windw": 3})


def test_a_value_may_refer_to_another_or_to_the_environment(monkeypatch):
    told = {"name": "jerk", "accel_mps2": "${.jerk_mps3_per_sqrt_s}", "jerk_mps3_per_sqrt_s": 2.0}
    assert plugins.create("filter", told).accel_mps2 == 2.0

    for sigma in ("0.5", "0.7"):
        monkeypatch.setenv("SIGMA_OF_A_TEST", sigma)
        monkeypatch.setenv("JERKBENCH_ENV", "SIGMA_OF_A_TEST")
        told = {"name": "jerk", "accel_mps2": "${oc.env:SIGMA_OF_A_TEST}"}
        assert plugins.create("filter", told).accel_mps2 == float(sigma)

    with pytest.raises(PluginError, match="filter jerk, parameter 'accel_mps2': Interpolation key 'nowhere'"):
        plugins.create("filter", OmegaConf.create({"name": "jerk", "accel_mps2": "${nowhere}"}))


def test_values_are_converted_or_refused_and_keep_their_signs():
    signs = [plugins.create("filter", {"name": "jerk", "accel_mps2": zero}).accel_mps2 for zero in (0.0, -0.0, 0.0)]
    assert [math.copysign(1.0, sign) for sign in signs] == [1.0, -1.0, 1.0]
    assert Mtf().window == 1
    assert type(plugins.create("dataset", {"name": "field", "duration_s": 60}).duration_s) is float
    with pytest.raises(PluginError, match=r"window.*True"):
        plugins.create("adaptation", {"name": "mtf", "window": True})
    outage = plugins.create("disturbance", {"name": "gnss_outage", "windows_s": [[1, 2], [5, 6.5]]})
    assert outage.windows_s == ((1.0, 2.0), (5.0, 6.5))
    with pytest.raises(PluginError, match="parameter 'windows_s'"):
        plugins.create("disturbance", {"name": "gnss_outage", "windows_s": [3]})
    config = OmegaConf.structured(plugins.schema("adaptation", "mtf"))
    config.window = 7
    assert plugins.create("adaptation", config) == Mtf(window=7)


def test_a_class_that_is_no_frozen_dataclass_and_a_name_that_is_taken_are_refused():
    thawed = dataclass(type("Thawed", (), {}))
    with pytest.raises(PluginError, match="Thawed is not a frozen dataclass"):
        plugins.register("adaptation", "thawed")(thawed)
    with pytest.raises(PluginError, match=r"jerkbench\.adaptation\.mtf\.Mtf"):
        plugins.register("adaptation", "mtf")(dataclass(frozen=True)(type("Other", (), {})))
