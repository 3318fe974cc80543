"""Parameters under the name of their plugin, in a sweep of plugins of which not all have them."""

import pandas as pd
import pytest

from commands import SHORT, swept, verb
from jerkbench.errors import PluginError
from jerkbench.hydra_app.overrides import arranged_words


def adaptations(folder):
    return sorted(pd.read_csv(folder / "results" / "adhoc" / "rows.csv")["adaptation"])


@pytest.mark.slow
def test_a_parameter_applies_where_its_plugin_is_chosen(tmp_path):
    swept("adaptation=none,mtf,student_t", "adaptation.mtf.window=1,4", "filter=jerk", cwd=tmp_path)

    assert adaptations(tmp_path) == ["mtf(window=1)", "mtf(window=4)", "none", "student_t"]


@pytest.mark.slow
def test_a_preset_is_addressed_by_its_own_name_and_by_that_of_its_plugin(tmp_path):
    words = ["filter=baseline_untuned,jerk", "filter.baseline_untuned.accel_mps2=0.3", "filter.jerk.accel_mps2=0.1,0.2"]
    swept(*words, cwd=tmp_path)
    swept("filter=baseline_untuned", "filter.baseline.accel_mps2=0.4", "study=plugin", cwd=tmp_path)
    named = sorted(pd.read_csv(tmp_path / "results" / "adhoc" / "rows.csv")["filter"])

    assert named == ["baseline_untuned(accel_mps2=0.3)", "jerk(accel_mps2=0.1)", "jerk(accel_mps2=0.2)"]
    (other,) = pd.read_csv(tmp_path / "results" / "plugin" / "rows.csv")["filter"]
    assert other == "baseline_untuned(accel_mps2=0.4)"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["adaptation=none,mtf", "adaptation.huber.k=1"], "No combination has adaptation=huber"),
        (["adaptation=mtf,student_t", "adaptation.window=1,4"], "adaptation.NAME.window=VALUE"),
        (["adaptation=none,mtf", "adaptation.mtf.windw=1"], "There is no option 'adaptation.windw'"),
    ],
)
def test_what_fits_nowhere_is_a_sentence(tmp_path, words, sentence):
    done = verb("run", "-m", *SHORT, *words, cwd=tmp_path)

    assert done.returncode == 2
    assert sentence in done.stderr
    assert not list(tmp_path.rglob("*.parquet"))


def test_a_single_run_takes_the_address_of_what_it_has():
    assert arranged_words(["adaptation=mtf", "adaptation.mtf.window=4"]) == ["adaptation=mtf", "adaptation.window=4"]
    assert arranged_words(["filter.baseline.accel_mps2=1"]) == ["filter.accel_mps2=1"]
    with pytest.raises(PluginError, match="adaptation=mtf is not chosen"):
        arranged_words(["adaptation.mtf.window=4"])


@pytest.mark.parametrize("word", ["adaptation.window=4", "disturbance.imu_bias.accel_mps2=1", "hydra.sweep.dir=x.y"])
def test_other_words_have_no_address(word):
    assert arranged_words([word]) == [word]
