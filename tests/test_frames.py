"""The way from what is typed to a rule's `adapt`: how many of our own functions lie between."""

import traceback
from pathlib import Path

import pytest

import jerkbench
from jerkbench.adaptation.mtf import Mtf
from jerkbench.cli import main

OWN = str(Path(jerkbench.__file__).parent)
WORDS = ("filter=baseline", "adaptation=mtf", "engine=filterpy", "dataset.duration_s=8", "seeds=1", "figures=false")


@pytest.mark.parametrize("first", [("run",), ("run", "-m", "workers=1")], ids=["one", "sweep"])
def test_the_way_to_adapt_is_short(first, tmp_path, monkeypatch):
    stacks, adapt = [], Mtf.adapt

    def watched(*given):
        if not stacks:
            stacks.append([frame.name for frame in traceback.extract_stack() if frame.filename.startswith(OWN)])
        return adapt(*given)

    monkeypatch.setattr(Mtf, "adapt", watched)
    monkeypatch.chdir(tmp_path)
    main([*first, *WORDS])

    (names,) = stacks
    assert names[0] == "main"
    assert len(names) <= 9, names
