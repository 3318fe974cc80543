"""The example package is small and has the weights of its equation; `test_third_party.py` installs and sweeps it."""

from pathlib import Path

import numpy as np

SOURCE = Path(__file__).parents[2] / "examples" / "plugin"
MAX_LINES = 40


def test_it_is_two_small_files_whose_weights_are_those_of_the_equation(monkeypatch):
    files = sorted(path.name for path in SOURCE.iterdir() if path.is_file())
    assert files == ["geman_mcclure.py", "pyproject.toml"]
    assert all(len((SOURCE / name).read_text(encoding="utf-8").splitlines()) <= MAX_LINES for name in files)
    monkeypatch.syspath_prepend(SOURCE)
    from geman_mcclure import GemanMcClure

    R, HPHt = np.array([[0.04, 0.01], [0.01, 0.09]]), np.diag([0.12, 0.16])
    innovation = np.array([1.2, -0.75])  # 3 and 1.5 of its standard deviations 0.4 and 0.5
    adapted = GemanMcClure(c=3.0).adapt(innovation, HPHt, R, np.arange(2), np.zeros(0))
    np.testing.assert_allclose(adapted, [[0.04 * 4.0, 0.01 * 2.5], [0.01 * 2.5, 0.09 * 1.5625]], rtol=1e-12)
