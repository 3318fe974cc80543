"""A plugin that was written for version 0.2.0, as it was then: it is found, keeps its contract and is swept."""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from commands import jerkbench, swept
from jerkbench import plugins
from jerkbench.testing import check_plugin

MADE = Path(__file__).parent / "made_with_020"
RMSE_M = 0.03189500018518018
"""Its position RMSE in the sweep below, as 0.2.0 computed it."""


def test_it_registers_and_keeps_its_contract(tmp_path, monkeypatch):
    path = shutil.copy(MADE / "geman_mcclure.py", tmp_path / "geman_mcclure_of_020.py")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, path.stem, module)
    spec.loader.exec_module(module)
    plugins.register("adaptation", "of_020")(module.GemanMcClure)

    plugin = plugins.create("adaptation", {"name": "of_020", "c": 2.0})
    assert plugin == module.GemanMcClure(c=2.0)
    check_plugin("adaptation", plugin)


@pytest.mark.slow
def test_its_package_is_installed_found_and_swept_with_the_number_that_it_had(tmp_path):
    source, target = shutil.copytree(MADE, tmp_path / "source"), tmp_path / "installed"
    words = ["install", "--quiet", "--no-deps", "--no-build-isolation", "--target", str(target), str(source)]
    subprocess.run([sys.executable, "-m", "pip", *words], check=True, capture_output=True, timeout=120)

    checked = jerkbench("check", "jerkbench-geman-mcclure", cwd=tmp_path, PYTHONPATH=str(target))
    assert (checked.returncode, checked.stdout) == (0, "adaptation geman_mcclure: keeps its contract.\n")
    swept("adaptation=none,geman_mcclure", "disturbance=outliers", cwd=tmp_path, PYTHONPATH=str(target))
    rows = pd.read_csv(tmp_path / "results" / "adhoc" / "rows.csv").set_index("adaptation")
    assert rows.loc["geman_mcclure", "position_rmse_m"] == pytest.approx(RMSE_M, rel=1e-9)
