"""Optional members of plugins, a package that is not installed, and messages that are printed once."""

import subprocess
import sys
from dataclasses import dataclass

import pytest

from jerkbench import errors, plugins
from jerkbench.errors import PluginError, notify, shared_notices


def refusal(kind, cls):
    with pytest.raises(PluginError) as raised:
        plugins.register(kind, "of_a_test")(dataclass(frozen=True)(cls))
    return str(raised.value)


@pytest.mark.parametrize(
    ("kind", "name", "value", "meant"),
    [
        ("metric", "summarize", lambda self, sums: {}, "summarise"),
        ("adaptation", "wants_true_covarience", True, "wants_true_covariance"),
        ("adaptation", "memory_sise", lambda self: 3, "memory_size"),
        ("adaptation", "fades", lambda self, *update: 2.0, "fade"),
        ("engine", "run_setings", lambda self: [], "run_settings"),
        ("dataset", "default_atitude", "real", "default_attitude"),
        ("filter", "axis_modells", lambda self: (), "axis_models"),
        ("attitude", "requires", lambda self, load: None, "require"),
    ],
)
def test_every_kind_knows_its_own_optional_parts(kind, name, value, meant):
    assert f"Did you mean {meant}?" in refusal(kind, type("Typo", (), {name: value}))


def test_a_misspelt_part_of_a_base_and_one_that_a_metric_reads_are_found_too():
    class Base:
        def remark(self, recording):
            return ()

    assert "Did you mean remarks?" in refusal("attitude", type("Derived", (Base,), {}))


def test_all_mistakes_of_a_class_are_refused_at_once():
    class Several:
        wants_true_covarience = True
        factor = 2.0

    message = refusal("adaptation", Several)

    for words in ("Did you mean wants_true_covariance?", "factor has no type"):
        assert words in message


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


def test_a_parameter_may_have_any_name():
    @dataclass(frozen=True)
    class Near:
        fades: float = 1.0

    assert not list(plugins.misfits("adaptation", Near))


SAY = "from jerkbench.errors import notify; notify('compiling a', 'a'); notify('waiting for a', 'a'); notify('b')"


@pytest.fixture(autouse=True)
def fresh(monkeypatch):
    monkeypatch.setattr(errors, "_GIVEN", set())
    monkeypatch.delenv(errors.NOTICES_FOLDER, raising=False)


def said_by_another():
    return subprocess.run([sys.executable, "-c", SAY], capture_output=True, text=True, check=True, timeout=60).stderr


def test_a_process_says_it_once(capsys):
    for text in ("one", "one", "two"):
        notify(text)
    assert capsys.readouterr().err == "jerkbench: one\njerkbench: two\n"


def test_processes_that_work_together_say_it_once_between_them_and_others_anew(capsys):
    notify("b")
    with shared_notices():
        assert said_by_another() == "jerkbench: compiling a\n"
        assert said_by_another() == ""
        notify("compiling a", "a")
    assert capsys.readouterr().err == "jerkbench: b\n"
    assert said_by_another() == "jerkbench: compiling a\njerkbench: b\n"
