"""Every adaptation compiles in numba's nopython mode and gives the same there, `self` being a named tuple."""

import dataclasses
import types
from collections import namedtuple

import numpy as np
import pytest
from sequences import sequence

from jerkbench import plugins
from jerkbench.conformance.updates import STATES, ordinary
from jerkbench.memory import empty_memory

numba = pytest.importorskip("numba")
NAMES = plugins.names("adaptation")


def compiled(function, done):
    """`function` as a dispatcher, and before it every plain function of this package that it calls."""
    if function not in done:
        scope = dict(function.__globals__)
        done[function] = numba.njit(types.FunctionType(function.__code__, scope, function.__name__))
        for name in function.__code__.co_names:
            helper = scope.get(name)
            if isinstance(helper, types.FunctionType) and helper.__module__.startswith("jerkbench"):
                scope[name] = compiled(helper, done)
    return done[function]


def parameters(plugin):
    """The fields as a named tuple."""
    names = [f.name for f in dataclasses.fields(plugin)]
    return namedtuple("Parameters", names)(*(getattr(plugin, name) for name in names))  # noqa: PYI024 - the fields are known only here


@pytest.fixture(scope="module")
def done():
    """What is compiled already; without optimisation, which is what takes the time."""
    level, numba.config.OPT = numba.config.OPT, type(numba.config.OPT)(0)
    yield {}
    numba.config.OPT = level


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_compiled_and_plain_agree(name, done):
    plugin = plugins.create("adaptation", {"name": name})
    self = parameters(plugin)
    memories = np.tile(empty_memory(plugin, STATES), (2, 1))
    for method, arguments in calls(plugin):
        fast = compiled(getattr(type(plugin), method), done)
        wanted = getattr(plugin, method)(*arguments, memories[0])
        got = fast(self, *arguments, memories[1])
        known = np.abs(np.asarray(wanted))
        largest = known[np.isfinite(known)].max(initial=0.0)  # an infinite variance drops its row
        np.testing.assert_allclose(got, wanted, rtol=1e-6, atol=1e-9 * largest)
        np.testing.assert_allclose(*memories, rtol=1e-9, atol=1e-12)


def calls(plugin):
    """Each method that the plugin has, in the order in which an engine asks them, over a sequence of updates."""
    rng = np.random.default_rng(1)
    for _, _, _, rows in sequence(1, 80):
        (y, HPHt, R, _), (x, P, F, Q) = ordinary(rng, tuple(rows.tolist()), (0.3, 1.0, 5.0, 60.0)[rng.integers(4)])
        seen = {
            "fade": (y, HPHt, R, rows),
            "adapt_prior": (x, P, F, Q, y, R, rows),
            "adapt": (y, HPHt, R, rows),
            "adapt_gain": (x, P, y, R, rows),
        }
        yield from ((name, seen[name]) for name in seen if hasattr(plugin, name))
