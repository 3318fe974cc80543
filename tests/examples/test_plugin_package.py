"""The example package, built as a wheel, installed beside nothing else of ours, checked and swept."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from commands import jerkbench, swept

SOURCE = Path(__file__).parents[2] / "examples" / "plugin"
MOST_LINES = 40

pytestmark = pytest.mark.slow


def pip(*words):
    command = [sys.executable, "-m", "pip", *words, "--quiet", "--no-deps", "--disable-pip-version-check"]
    subprocess.run(command, check=True, capture_output=True, timeout=120)


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with nothing but the package, which the wheel alone has brought there."""
    wheels, target = tmp_path_factory.mktemp("wheels"), tmp_path_factory.mktemp("installed")
    pip("wheel", "--no-build-isolation", "--wheel-dir", str(wheels), str(SOURCE))
    (wheel,) = wheels.glob("*.whl")
    pip("install", "--target", str(target), str(wheel))
    return str(target)


def test_it_is_two_small_files():
    files = sorted(path.name for path in SOURCE.iterdir() if path.is_file())

    assert files == ["geman_mcclure.py", "pyproject.toml"]
    assert all(len((SOURCE / name).read_text(encoding="utf-8").splitlines()) <= MOST_LINES for name in files)


def test_it_keeps_its_contract(installed, tmp_path):
    done = jerkbench("check", "jerkbench-geman-mcclure", cwd=tmp_path, PYTHONPATH=installed)

    assert (done.returncode, done.stdout) == (0, "adaptation geman_mcclure: keeps its contract.\n")


def test_it_is_swept_beside_ours(installed, tmp_path):
    swept("adaptation=none,geman_mcclure", "disturbance=outliers", cwd=tmp_path, PYTHONPATH=installed)
    rows = pd.read_csv(tmp_path / "results" / "adhoc" / "rows.csv").set_index("adaptation")

    assert set(rows["status"]) == {"ok"}
    assert rows.loc["geman_mcclure", "position_rmse_m"] < rows.loc["none", "position_rmse_m"]


def test_its_weights_are_those_of_the_equation(monkeypatch):
    monkeypatch.syspath_prepend(SOURCE)
    from geman_mcclure import GemanMcClure

    R, HPHt = np.array([[0.04, 0.01], [0.01, 0.09]]), np.diag([0.12, 0.16])
    innovation = np.array([1.2, -0.75])  # 3 and 1.5 of its standard deviations 0.4 and 0.5
    adapted = GemanMcClure(c=3.0).adapt(innovation, HPHt, R, np.arange(2), np.zeros(0))

    np.testing.assert_allclose(adapted, [[0.04 * 4.0, 0.01 * 2.5], [0.01 * 2.5, 0.09 * 1.5625]], rtol=1e-12)
