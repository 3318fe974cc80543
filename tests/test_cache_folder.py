import pytest
from platformdirs import user_cache_path

from jerkbench.compilation.compiled import COMPILED
from jerkbench.files import cache_folder
from jerkbench.io.bag import BAGS
from jerkbench.io.files import fetched_folder
from jerkbench.jobs.rows import SIMULATED


@pytest.mark.parametrize("kind", [BAGS, COMPILED, SIMULATED])
def test_every_kind_of_cache_is_in_the_users_cache_or_where_the_variable_says(monkeypatch, tmp_path, kind):
    monkeypatch.delenv("JERKBENCH_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder(kind) == user_cache_path("jerkbench", appauthor=False) / kind
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path))
    assert cache_folder(kind) == tmp_path / kind
    monkeypatch.setenv("JERKBENCH_CACHE", "~/kept")
    assert "~" not in str(cache_folder(kind))


def test_fetched_recordings_are_no_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path))
    monkeypatch.delenv("JERKBENCH_DATA", raising=False)

    assert tmp_path not in fetched_folder("drive").parents
