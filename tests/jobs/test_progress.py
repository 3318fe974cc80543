"""The bar of a sweep: what is left, and nothing where nothing is."""

import re
import time
from functools import partial

import pytest

from jerkbench.jobs import progress as progress_module
from jerkbench.jobs.progress import Progress, duration, pulse


def test_what_is_left_is_counted_and_without_anything_left_there_is_no_bar(capsys):
    with Progress(4, already=1) as progress:
        for _ in range(3):
            progress.advance(["ok", "diverged"])
    err = capsys.readouterr().err
    for line in ("1 of 4 cells are done already.", "3/3 cells", "3 runs diverged"):
        assert line in err
    with Progress(3, already=3):
        pass
    assert capsys.readouterr().err == "3 of 3 cells are done already.\n"


def test_a_pipe_hears_how_far_it_is(capsys, monkeypatch):
    monkeypatch.setattr(progress_module, "pulse", partial(pulse, first_s=0.01, every_s=0.01))
    with Progress(4) as progress:
        progress.advance(["diverged"])
        err = ""
        while not (line := re.search("Sweep: 1 of 4 cells after .*", err)):
            time.sleep(0.01)
            err += capsys.readouterr().err
    assert line[0].endswith("left; 1 runs diverged.")


def test_a_pulse_ends_with_its_work():
    said = []
    with pulse(lambda seconds: f"{seconds:.0f} s", said.append, first_s=0.0, every_s=0.001):
        while not said:
            time.sleep(0.001)
    count = len(said)
    time.sleep(0.02)
    assert said[0] == "0 s"
    assert len(said) == count


@pytest.mark.parametrize(("seconds", "said"), [(40.4, "40 s"), (180, "3 min"), (9000, "2.5 h")])
def test_times_are_said_as_people_do(seconds, said):
    assert duration(seconds) == said
