"""Registries: what a plugin is, how it is found, and what is said when something is wrong with it."""

import dataclasses
import math
from dataclasses import dataclass
from importlib.metadata import EntryPoint

import pytest
from omegaconf import OmegaConf

from jerkbench import notices, plugins
from jerkbench.adaptation.mtf import Mtf
from jerkbench.errors import PluginError
from jerkbench.jobs.job import metric_names
from jerkbench.jobs.names import choose
from jerkbench.plugins.catalogue import list_text, show_text


def test_every_kind_has_plugins_and_each_says_in_one_line_what_it_is():
    for kind in plugins.KINDS:
        assert plugins.names(kind)
        for name in plugins.names(kind):
            cls = plugins.get(kind, name)
            first = (cls.__doc__ or "").split("\n", 1)[0]
            assert first.endswith("."), f"{kind} {name}: {first!r}"
            for f in dataclasses.fields(cls):
                assert f"{f.name}:" in show_text(kind, name), f"{kind} {name} does not document {f.name}"


def test_a_wrong_name_lists_what_there_is_and_the_nearest():
    with pytest.raises(PluginError, match=r"mean 'mtf'.* sage_husa"):
        plugins.get("adaptation", "mtv")


def test_a_wrong_parameter_names_the_plugin_and_the_parameter():
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


def test_zeros_of_both_signs_are_two_values():
    signs = [plugins.create("filter", {"name": "jerk", "accel_mps2": zero}).accel_mps2 for zero in (0.0, -0.0, 0.0)]
    assert [math.copysign(1.0, sign) for sign in signs] == [1.0, -1.0, 1.0]


def test_what_equals_the_default_is_still_converted_or_refused():
    assert Mtf().window == 1
    assert type(plugins.create("dataset", {"name": "field", "duration_s": 60}).duration_s) is float
    with pytest.raises(PluginError, match=r"window.*True"):
        plugins.create("adaptation", {"name": "mtf", "window": True})


def test_lists_of_pairs_come_as_tuples_and_a_wrong_one_is_a_sentence():
    outage = plugins.create("disturbance", {"name": "gnss_outage", "windows_s": [[1, 2], [5, 6.5]]})

    assert outage.windows_s == ((1.0, 2.0), (5.0, 6.5))
    with pytest.raises(PluginError, match="parameter 'windows_s'"):
        plugins.create("disturbance", {"name": "gnss_outage", "windows_s": [3]})


def test_the_schema_can_be_changed_although_the_plugin_is_frozen():
    config = OmegaConf.structured(plugins.schema("adaptation", "mtf"))
    config.window = 7

    assert plugins.create("adaptation", config) == Mtf(window=7)


@dataclass
class Thawed:
    pass


def test_a_class_that_is_no_frozen_dataclass_is_refused():
    with pytest.raises(PluginError, match="Thawed is not a frozen dataclass"):
        plugins.register("adaptation", "thawed")(Thawed)


@dataclass(frozen=True)
class Other:
    pass


def test_a_name_can_be_taken_only_once():
    with pytest.raises(PluginError, match=r"jerkbench\.adaptation\.mtf\.Mtf"):
        plugins.register("adaptation", "mtf")(Other)


@pytest.fixture
def broken(monkeypatch):
    """Entry points of two kinds that cannot be loaded."""

    def entries(group):
        named = group in ("jerkbench.adaptation", "jerkbench.metric")
        return [EntryPoint("broken", "no_such_module:Nothing", group)] if named else []

    monkeypatch.setattr(plugins, "entry_points", entries)
    monkeypatch.setattr(plugins, "_left_out", {kind: {} for kind in plugins.KINDS})
    monkeypatch.setattr(notices, "_GIVEN", set())
    plugins._import_entry_points.cache_clear()
    yield
    plugins._import_entry_points.cache_clear()


SENTENCE = "adaptation 'broken' of no_such_module:Nothing is left out: ModuleNotFoundError: No module named"


def test_an_entry_point_that_fails_to_import_harms_no_other_and_is_named_where_it_is_asked_for(broken):
    names = plugins.names("adaptation")

    assert "mtf" in names
    assert "broken" not in names
    for ask in (lambda: plugins.get("adaptation", "broken"), lambda: choose("adaptation", "broken")):
        with pytest.raises(PluginError, match=SENTENCE):
            ask()


def test_it_is_said_once_in_the_list_of_its_kind_and_in_no_other(broken, capsys):
    list_text("filter")
    assert capsys.readouterr().err == ""
    list_text("adaptation")
    assert capsys.readouterr().err.startswith(f"jerkbench: {SENTENCE}")
    list_text("adaptation")
    assert capsys.readouterr().err == ""


def test_a_metric_that_cannot_be_loaded_is_said_where_all_are_asked_for(broken, capsys):
    metric_names(["position"])
    assert capsys.readouterr().err == ""
    metric_names(["all"])
    assert capsys.readouterr().err.count("metric 'broken' of no_such_module:Nothing is left out") == 1
