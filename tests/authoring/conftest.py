"""A check's traces in its process (plugins, modules, the path), taken out again."""

import sys
from pathlib import Path

import pytest

from jerkbench import plugins


@pytest.fixture(autouse=True)
def as_before(monkeypatch, tmp_path_factory):
    for kind in plugins.KINDS:
        plugins.names(kind)  # those of the tree stay
    known = set(sys.modules)
    monkeypatch.setattr(plugins, "_registry", {kind: dict(named) for kind, named in plugins._registry.items()})
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield
    made = tmp_path_factory.getbasetemp()
    for name in set(sys.modules) - known:
        if Path(getattr(sys.modules[name], "__file__", None) or "/").is_relative_to(made):
            del sys.modules[name]
