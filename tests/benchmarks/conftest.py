"""The scripts of the folder benchmarks, as modules."""

from importlib import import_module
from pathlib import Path

import pytest


@pytest.fixture
def script(monkeypatch):
    """Imports a script by its name."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    return import_module
