"""Objects that are no plain functions in the digest; those that cannot be told apart hold in one process only."""

import sys
import types

import pytest

from jerkbench.compilation import code_digest as reach
from jerkbench.compilation.code_digest import digest, unknown_part

DEEPER = """
from numba import njit

SCALE = 2.0

@njit
def scaled(x):
    return SCALE * x
"""
BETWEEN = """
import deeper
from numba import njit

OFFSET = 1.0

@njit
def via_module(x):
    return deeper.scaled(x)
"""
SOURCE = """
from enum import Enum, IntEnum
from functools import partial

import between
from numba import cfunc, guvectorize, njit, vectorize

class Kind(IntEnum):
    NEAR = 1
    FAR = 2

class Unit(Enum):
    METRE = 1.0

@vectorize
def raised(x):
    return x + 3.0

@guvectorize(["void(float64[:], float64[:])"], "(n)->(n)")
def lowered(x, result):
    result[0] = x[0] - 3.0

@cfunc("float64(float64)")
def called(x):
    return x + 4.0

@njit(fastmath=False)
def quick(x):
    return x

def powered(x, exponent):
    return x ** exponent

squared = partial(powered, exponent=2)
NAMES = frozenset({"one", "two", "three"})

def with_keyword(x, *, gain=5.0):
    return gain * x

def function(x):
    if x > Kind.FAR and x > Unit.METRE.value and str(x) in NAMES:
        return raised(x) + called(x) + squared(x) + with_keyword(x) + quick(x) + lowered(x)
    return between.via_module(x) + between.OFFSET
"""


def made(**edits):
    """The function of SOURCE, in modules of their own, after an edit of each that is given: (before, after)."""
    for name, source in {"deeper": DEEPER, "between": BETWEEN, "source": SOURCE}.items():
        before, after = edits.get(name, ("", ""))
        assert before in source
        module = sys.modules[name] = types.ModuleType(name)
        exec(source.replace(before, after) if before else source, module.__dict__)  # noqa: S102 - the text stands above
    return sys.modules["source"].function


@pytest.fixture(autouse=True)
def forgotten(monkeypatch):
    for name in ("deeper", "between", "source"):
        monkeypatch.setitem(sys.modules, name, None)


@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        ("deeper", "SCALE * x", "SCALE + x"),
        ("deeper", "SCALE = 2.0", "SCALE = 2.5"),
        ("between", "OFFSET = 1.0", "OFFSET = 1.5"),
        ("source", "FAR = 2", "FAR = 3"),
        ("source", "METRE = 1.0", "METRE = 0.01"),
        ("source", "x + 3.0", "x + 3.5"),
        ("source", "x[0] - 3.0", "x[0] - 3.5"),
        ("source", "x + 4.0", "x + 4.5"),
        ("source", "x ** exponent", "x * exponent"),
        ("source", "exponent=2", "exponent=3"),
        ("source", "gain=5.0", "gain=5.5"),
        ("source", '"three"', '"four"'),
        ("source", "fastmath=False", "fastmath=True"),
    ],
)
def test_an_edit_of_any_of_it_changes_it(name, before, after):
    assert digest(made(**{name: (before, after)})) != digest(made())


def test_it_is_the_same_for_the_same_text():
    assert digest(made()) == digest(made())
    assert unknown_part(digest(made())) == ""


def test_what_a_module_has_beside_it_does_not_matter():
    assert digest(made(deeper=("SCALE = 2.0", "SCALE = 2.0\nOTHER = 3.0"))) == digest(made())


class Mystery:
    """Anything at all."""


GUESSED = types.ModuleType("guessed")
GUESSED.__dict__["__getattr__"] = lambda name: 1.0
THING, OTHER = Mystery(), Mystery()


def reads_thing(x):
    return THING


def reads_other(x):
    return OTHER


def reads_module(x):
    return GUESSED.value


@pytest.mark.parametrize(("function", "name"), [(reads_thing, "THING"), (reads_module, "GUESSED")])
def test_what_cannot_be_told_apart_is_another_in_the_next_process(monkeypatch, function, name):
    before = digest(function)
    assert digest(function) == before
    assert unknown_part(before).startswith(name)
    monkeypatch.setattr(reach, "_THIS_PROCESS", "another")

    assert digest(function) != before


def test_two_things_that_cannot_be_told_apart_are_two():
    assert digest(reads_thing).rpartition(" ")[2] != digest(reads_other).rpartition(" ")[2]
