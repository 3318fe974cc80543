"""Every adaptation compiles in numba's nopython mode and gives the same there, `self` being a named tuple."""

import numpy as np
import pytest
from numba import njit
from sequences import sequence

from jerkbench import plugins
from jerkbench.compilation.methods import address_of, ask, compiled_method, fill_by, parameter_vector
from jerkbench.contracts import empty_memory
from jerkbench.kinematic.plugin_call import ADAPT, FADE, GAIN, PRIOR
from jerkbench.plugins.samples import TRIED_STATES, tried_update

NAMES = plugins.names("adaptation")
METHODS = {method.name: method for method in (FADE, PRIOR, ADAPT, GAIN)}


@njit
def filled(address, arrays, sizes):
    fill_by(address, arrays, sizes)


@njit
def asked(address, arrays, sizes):
    return ask(address, arrays, sizes)


@pytest.fixture(scope="module")
def compiled():
    """A method as the engines have it: the same machine code, from the disk where another test needed it before."""

    def method(plugin, name, arguments, memory):
        known = METHODS[name]
        lengths = {"m": len(arguments[-1]), "size": len(memory), "n": TRIED_STATES}
        sizes = tuple(lengths[size] for size in known.sizes)
        given = (parameter_vector(plugin), *map(np.ascontiguousarray, arguments), memory)
        address = address_of(compiled_method(plugin, known))
        if not known.result:
            return asked(address, given, sizes)
        shape = [lengths[size] for size in known.result.strip("()").split(", ")]
        result = np.full(shape, np.nan)
        filled(address, (*given, result), sizes)
        return result

    return method


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_compiled_and_plain_agree(name, compiled):
    plugin = plugins.create("adaptation", {"name": name})
    memories = np.tile(empty_memory(plugin, TRIED_STATES), (2, 1))
    for method, arguments in calls(plugin):
        wanted = getattr(plugin, method)(*arguments, memories[0])
        got = compiled(plugin, method, arguments, memories[1])
        known = np.abs(np.asarray(wanted))
        largest = known[np.isfinite(known)].max(initial=0.0)  # an infinite variance drops its row
        np.testing.assert_allclose(got, wanted, rtol=1e-6, atol=1e-9 * largest)
        np.testing.assert_allclose(*memories, rtol=1e-9, atol=1e-12)


def calls(plugin):
    """Each method that the plugin has, in the order in which an engine asks them, over a sequence of updates."""
    rng = np.random.default_rng(1)
    for _, _, _, rows in sequence(1, 80):
        x, P, F, Q, y, R, _ = tried_update(rng, tuple(rows.tolist()), (0.3, 1.0, 5.0, 60.0)[rng.integers(4)])
        HPHt = P[np.ix_(rows, rows)]
        seen = {
            "fade": (y, HPHt, R, rows),
            "adapt_prior": (x, P, F, Q, y, R, rows),
            "adapt": (y, HPHt, R, rows),
            "adapt_gain": (x, P, y, R, rows),
        }
        yield from ((name, seen[name]) for name in seen if hasattr(plugin, name))
