"""The example package, built as a wheel, installed into an environment of its own, checked and swept."""

import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from commands import PATIENCE_S, SHORT, environment

SOURCE = Path(__file__).parents[2] / "examples" / "plugin"
MOST_LINES = 40

pytestmark = pytest.mark.slow


def run(python, *words, check, **more):
    command = [str(python), "-m", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=check, **more)


@pytest.fixture(scope="module")
def own_jerkbench(tmp_path_factory):
    """An environment that sees our packages and has, from its wheel, the package: runs `jerkbench WORDS` in it."""
    wheels, venv = tmp_path_factory.mktemp("wheels"), tmp_path_factory.mktemp("environment") / "venv"
    quiet = ["--quiet", "--no-deps", "--disable-pip-version-check"]
    run(sys.executable, "pip", "wheel", *quiet, "--no-build-isolation", "-w", str(wheels), str(SOURCE), check=True)
    run(sys.executable, "venv", "--without-pip", str(venv), check=True)
    python, (wheel,) = venv / "bin" / "python", wheels.glob("*.whl")
    run(sys.executable, "pip", "--python", str(python), "install", *quiet, str(wheel), check=True)
    (site,) = venv.glob("lib/*/site-packages")
    (site / "ours.pth").write_text("\n".join([str(SOURCE.parents[1]), sysconfig.get_path("purelib")]))
    return lambda *words, cwd: run(python, "jerkbench", *words, cwd=cwd, env=environment(), check=False)


def test_it_is_two_small_files():
    files = sorted(path.name for path in SOURCE.iterdir() if path.is_file())

    assert files == ["geman_mcclure.py", "pyproject.toml"]
    assert all(len((SOURCE / name).read_text(encoding="utf-8").splitlines()) <= MOST_LINES for name in files)


def test_it_keeps_its_contract(own_jerkbench, tmp_path):
    done = own_jerkbench("check", "jerkbench-geman-mcclure", cwd=tmp_path)

    assert (done.returncode, done.stdout) == (0, "adaptation geman_mcclure: keeps its contract.\n")


def test_it_is_swept_beside_ours(own_jerkbench, tmp_path):
    words = [*SHORT, "adaptation=none,geman_mcclure", "disturbance=outliers"]
    done = own_jerkbench("run", "-m", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
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
