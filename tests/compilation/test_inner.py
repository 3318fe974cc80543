"""Functions that only compiled code calls: they do what Python does, and no machine code is made of them alone."""

import numpy as np
import pytest
from numba import njit
from numba.core.codegen import JITCodeLibrary

from jerkbench.compilation.jitted import jitted


def squared(x):
    return x * x


def summed(values):
    total = 0.0
    for value in values:
        total += squared(value)
    return total


def factorial(n):
    return 1 if n <= 1 else n * factorial(n - 1)


def refused(n):
    if n < 0:
        raise ValueError("n is negative; give one that is not.")
    return n


def asked(n):
    return refused(n) + 1


def called(function, signature, **options):
    """The function as compiled code has it, called from outside."""
    inner = jitted(function, __name__, **options)

    @njit(signature)
    def outer(argument):
        return inner(argument)

    return outer


@pytest.mark.parametrize("options", [{}, {"kernel": True}, {"kernel": True, "apart": ("squared", "summed")}])
def test_only_the_outermost_becomes_machine_code(monkeypatch, options):
    made, finalize = [], JITCodeLibrary._finalize_specific
    monkeypatch.setattr(
        JITCodeLibrary,
        "_finalize_specific",
        lambda library: (made.append(library.name.split(".")[-1]), finalize(library)),
    )
    values = np.array([1.0, 2.0, -3.0])

    assert called(summed, "float64(float64[::1])", **options)(values) == 14.0
    assert "outer" in made
    assert not {"squared", "summed"} & set(made)


def test_one_may_call_itself():
    assert called(factorial, "int64(int64)")(10) == 3628800


def test_an_error_inside_comes_out():
    compiled = called(asked, "int64(int64)")

    assert compiled(3) == 4
    with pytest.raises(ValueError, match="n is negative; give one that is not"):
        compiled(-1)
