"""How the benchmarks take a time."""

import math
from importlib import import_module
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.mark.parametrize("often", [1, 4])
@pytest.mark.parametrize("runs", [1, 64])
def test_whatever_is_timed_has_a_time(often, runs, monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    lines, called = import_module("lines"), []
    entrant = lines.Entrant("what", lambda: called.append(sum(range(1000))), often, runs, 0.0)

    (line,) = lines.in_rounds([entrant], 2)

    assert len(called) == 1 + 2 * often
    assert math.isfinite(line.seconds)
    assert line.ratio == 1.0
