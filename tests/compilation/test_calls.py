"""Compiled methods called by their address, as the engine does."""

from dataclasses import dataclass

import numpy as np
import pytest
from numba import njit

from jerkbench.compilation.methods import (
    address_of,
    ask,
    compiled_method,
    fill_by,
    parameter_vector,
    try_ask,
    try_fill_by,
)
from jerkbench.kinematic.plugin_call import ADAPT, FADE


@njit
def call_fill(address, arrays, sizes):
    fill_by(address, arrays, sizes)


@njit
def call_ask(address, arrays, sizes):
    return ask(address, arrays, sizes)


@njit
def try_both(adapt, fade, arrays, result, sizes):
    filled = try_fill_by(adapt, (*arrays, result), sizes)
    asked, factor = try_ask(fade, arrays, sizes)
    return filled, asked, factor


@dataclass(frozen=True)
class Mixing:
    """Uses every argument, and every kind of parameter."""

    factor: float = 3.0
    power: int = 2
    half: bool = True
    pair: tuple[float, float] = (0.5, 0.25)

    def adapt(self, innovation, HPHt, R, rows, memory):
        memory[0] += 1.0
        scale = self.factor**self.power * (0.5 if self.half else 1.0) + self.pair[1] * memory[0]
        return R * scale + HPHt + np.outer(innovation, rows.astype(np.float64))

    def fade(self, innovation, HPHt, R, rows, memory):
        return self.factor + innovation[0] + HPHt[0, -1] + R[-1, 0] + rows[-1] + memory[0]


@dataclass(frozen=True)
class Refusing:
    """Raises, or returns a matrix that is too small."""

    raises: bool

    def adapt(self, innovation, HPHt, R, rows, memory):
        if self.raises:
            raise ValueError("the window is empty")
        return R[1:, 1:].copy()


def arguments(plugin, m):
    rng = np.random.default_rng(m)
    return plugin, rng.normal(size=m), rng.normal(size=(m, m)), rng.normal(size=(m, m)), np.arange(m), np.ones(2)


def compiled_arguments(plugin, innovation, HPHt, R, rows, memory):
    return parameter_vector(plugin), innovation, HPHt, R, rows, memory


@pytest.mark.slow
@pytest.mark.parametrize("m", [1, 3, 6])  # 6 has a compilation of its own
def test_a_method_sees_what_its_author_wrote(m):
    given = arguments(Mixing(), m)
    wanted, factor = Mixing().adapt(*given[1:5], np.ones(2)), Mixing().fade(*given[1:5], np.full(2, 2.0))
    result = np.zeros((m, m))

    call_fill(address_of(compiled_method(Mixing(), ADAPT)), (*compiled_arguments(*given), result), (m, 2))
    np.testing.assert_allclose(result, wanted, rtol=1e-15)
    assert given[-1][0] == 2.0  # the memory is its own
    assert call_ask(address_of(compiled_method(Mixing(), FADE)), compiled_arguments(*given), (m, 2)) == factor


@pytest.mark.parametrize(("raises", "said"), [(True, "the window is empty"), (False, "another shape")])
@pytest.mark.parametrize("m", [2, 6])
def test_an_error_of_a_method_reaches_python(raises, said, m):
    given, address = arguments(Refusing(raises), m), address_of(compiled_method(Refusing(raises), ADAPT))
    with pytest.raises(ValueError, match=said):
        call_fill(address, (*compiled_arguments(*given), np.zeros((m, m))), (m, 2))


@dataclass(frozen=True)
class Choosy:
    """Raises where the innovation is negative."""

    def adapt(self, innovation, HPHt, R, rows, memory):
        if innovation[0] < 0.0:
            raise ValueError("negative")
        return 2.0 * R

    def fade(self, innovation, HPHt, R, rows, memory):
        if innovation[0] < 0.0:
            raise ValueError("negative")
        return 3.0


@pytest.mark.parametrize("m", [2, 6])
def test_a_tried_call_says_whether_there_was_an_error_and_goes_on(m):
    adapt, fade = (address_of(compiled_method(Choosy(), method)) for method in (ADAPT, FADE))
    given, result = compiled_arguments(*arguments(Choosy(), m)), np.zeros((m, m))

    given[1][:] = 1.0
    assert try_both(adapt, fade, given, result, (m, 2)) == (True, True, 3.0)
    np.testing.assert_array_equal(result, 2.0 * given[3])
    given[1][:] = -1.0
    assert try_both(adapt, fade, given, result, (m, 2))[:2] == (False, False)
