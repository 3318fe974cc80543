"""The digest of a function changes with all that it computes, and with nothing else."""

import types

import numpy as np
import pytest

from jerkbench.compilation.code_digest import digest

SOURCE = '''
from typing import NamedTuple

import numpy as np
TABLE = np.array([1.0, 2.0])
LIMIT = 3.0
STEPS = np.int64(4)
PAIR = (np.array([1.0, 2.0]), 5)

class Point(NamedTuple):
    x: float
    y: float

def deeper(x):
    return x + LIMIT

def helper(x):
    """Words."""
    return deeper(x) * TABLE[0] * STEPS + Point(*PAIR).x

def unrelated(x):
    return x

def function(x, power=2):
    return [helper(v) for v in x][0] ** power
'''


def made(source=SOURCE):
    module = types.ModuleType("made")
    exec(source, module.__dict__)  # noqa: S102 - the text stands above
    return module.function


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("x + LIMIT", "x - LIMIT"),
        ("LIMIT = 3.0", "LIMIT = 3.5"),
        ("TABLE = np.array([1.0, 2.0])", "TABLE = np.array([1.0, 2.5])"),
        ("STEPS = np.int64(4)", "STEPS = np.int64(5)"),
        ("PAIR = (np.array([1.0, 2.0])", "PAIR = (np.array([1.0, 2.0 + 1e-12])"),
        ("    x: float\n    y: float\n", "    y: float\n    x: float\n"),
        ("* TABLE[0]", "* TABLE[1]"),
        ("power=2", "power=3"),
        ("helper(v) for", "deeper(v) for"),
    ],
)
def test_an_edit_anywhere_on_the_way_changes_it(before, after):
    assert before in SOURCE
    assert digest(made(SOURCE.replace(before, after))) != digest(made())


@pytest.mark.parametrize("edit", [("return x\n", "return 2 * x\n"), ("def deeper", "# why\ndef deeper")])
def test_what_it_does_not_reach_does_not_change_it(edit):
    assert edit[0] in SOURCE
    assert digest(made(SOURCE.replace(*edit))) == digest(made())


def test_options_belong_to_it():
    assert len({digest(made()), digest(made(), n=2), digest(made(), n=3)}) == 3


def test_a_closure_belongs_to_it():
    def maker(value):
        def inner(x):
            return x + value

        return inner

    assert digest(maker(1.0)) == digest(maker(1.0)) != digest(maker(2.0))
    assert digest(maker(np.ones(2))) != digest(maker(np.zeros(2)))
