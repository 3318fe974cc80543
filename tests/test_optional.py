"""The optional parts of plugins: kept by every plugin of the tree, refused in words where they are misspelt."""

from dataclasses import dataclass

import pytest

from jerkbench import plugins
from jerkbench.errors import PluginError


def refusal(kind, cls):
    with pytest.raises(PluginError) as raised:
        plugins.register(kind, "of_a_test")(dataclass(frozen=True)(cls))
    return str(raised.value)


def test_a_misspelt_method_is_refused_with_the_name_that_was_meant():
    class Fades:
        def adapt(self, innovation, HPHt, R, rows, memory):
            return R

        def fades(self, innovation, HPHt, R, rows, memory):
            return 2.0

    sentence = refusal("adaptation", Fades)

    assert "adaptation of_a_test" in sentence
    assert "Fades.fades" in sentence
    assert "Did you mean fade?" in sentence
    assert "of_a_test" not in plugins.names("adaptation")


@pytest.mark.parametrize(
    ("kind", "name", "value", "meant"),
    [
        ("metric", "summarize", lambda self, sums: {}, "summarise"),
        ("adaptation", "wants_true_covarience", True, "wants_true_covariance"),
        ("adaptation", "memory_sise", lambda self: 3, "memory_size"),
        ("engine", "run_setings", lambda self: [], "run_settings"),
        ("dataset", "default_atitude", "real", "default_attitude"),
        ("filter", "axis_modells", lambda self: (), "axis_models"),
        ("attitude", "requires", lambda self, load: None, "require"),
    ],
)
def test_every_kind_knows_its_own_optional_parts(kind, name, value, meant):
    assert f"Did you mean {meant}?" in refusal(kind, type("Typo", (), {name: value}))


def test_a_misspelt_part_of_a_base_is_found_too():
    class Base:
        def remark(self, recording):
            return ()

    assert "Did you mean remarks?" in refusal("attitude", type("Derived", (Base,), {}))


def test_all_mistakes_of_a_class_are_refused_at_once():
    class Several:
        wants_true_covarience = True
        factor = 2.0
        scale: float = "x"

    message = refusal("adaptation", Several)

    for words in ("Did you mean wants_true_covariance?", "factor has no type", "scale has the type float"):
        assert words in message


@pytest.mark.parametrize("columns", [("error_m",), {"error_m": "Error"}])
def test_what_explains_columns_is_a_mapping_of_columns(columns):
    assert "columns must be a mapping" in refusal("metric", type("Explains", (), {"columns": columns}))


@pytest.mark.parametrize("varying", ["window", ("windows",), ("sigma",), ("on",)])
def test_what_varies_between_runs_is_a_whole_number(varying):
    @dataclass(frozen=True)
    class Varies:
        window: int = 3
        sigma: float = 1.0
        on: bool = False

    Varies.varying = varying
    assert "varying must be a tuple of names" in next(plugins.misfits("adaptation", Varies))
    Varies.varying = ("window",)
    assert not list(plugins.misfits("adaptation", Varies))


def test_a_parameter_may_have_any_name_but_that_of_a_method():
    @dataclass(frozen=True)
    class Near:
        fades: float = 1.0

    @dataclass(frozen=True)
    class Same:
        fade: float = 1.0

    assert not list(plugins.misfits("adaptation", Near))
    assert "must be a method" in next(plugins.misfits("adaptation", Same))


def test_a_metric_reads_a_part_that_there_is():
    assert "Did you mean" in refusal("metric", type("Reads", (), {"reads": "atitude"}))


def test_no_plugin_of_the_tree_is_near_a_part_that_it_has_not():
    for kind in plugins.KINDS:
        for name in plugins.names(kind):
            assert not list(plugins.misfits(kind, plugins.get(kind, name))), (kind, name)
