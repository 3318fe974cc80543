"""Overrides: ranges, types of swept values, text for programs, and parameters of named plugins."""

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from commands import SHORT, verb
from hydra_plugins.jerkbench import JerkbenchSweeper
from jerkbench import api
from jerkbench.cli.recordings import _parameters, dataset_of
from jerkbench.errors import PluginError
from jerkbench.hydra_app import overrides
from jerkbench.hydra_app.composition import composed
from jerkbench.hydra_app.overrides import arranged_overrides


def jobs(*words):
    (batch,) = JerkbenchSweeper.split_arguments(OverridesParser.create().parse_overrides(list(words)), None)
    return [word for job in batch for word in job]


def test_decimal_ranges_add_decimals_and_whole_ranges_stay_whole(monkeypatch):
    assert jobs("noise.accel_mps2=range(.1,.4,.1)") == [f"noise.accel_mps2={n}" for n in (0.1, 0.2, 0.3)]
    assert jobs("noise.accel_mps2=range(.1,.41,.1)")[-1] == "noise.accel_mps2=0.4"
    assert jobs("burn_in_s=range(1,-.2,-.5)") == [f"burn_in_s={n}" for n in (1.0, 0.5, 0.0)]
    assert jobs("seeds=range(1,4)") == ["seeds=1", "seeds=2", "seeds=3"]
    monkeypatch.setattr(overrides, "MAX_COMBINATIONS", 3)
    assert jobs("seeds=1,2", "seeds=3,4") == ["seeds=3", "seeds=4"]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        *((word, "range") for word in ("seeds=range(3,3)", "seeds=range(1,3,0)", "burn_in_s=range(0,inf)")),
        ("seeds=range(1,1000000000000)", "combinations"),
        ("seeds=range(1,1002) burn_in_s=range(0,100)", "combinations"),
    ],
)
def test_a_range_without_values_or_end_and_too_many_combinations_are_refused(words, reason):
    with pytest.raises(PluginError, match=reason):
        jobs(*words.split())


@pytest.mark.parametrize("words", [["first_seed=1,11"], ["dataset.duration_s=8.0,8.5", "adaptation=none,mtf"]])
def test_an_option_beside_swept_values_keeps_its_type(tmp_path, words):
    done = verb("run", "-m", *SHORT, "engine=filterpy", *words, "figures=false", "--dry", cwd=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "word", ["burn_in_s=1,abc", "seeds=1,1.5", "first_seed=true,1", "divergence_limit_m=1,x", "metrics=[all],3"]
)
def test_a_swept_value_of_another_type_is_refused(tmp_path, word):
    done = verb("run", "-m", *SHORT, word, "--dry", cwd=tmp_path)
    assert done.returncode == 2
    assert word.partition("=")[0] in done.stderr


@pytest.mark.parametrize("sign", [*",?*&%:[]{}@`'\"!#-~;| "])
def test_a_separator_may_be_any_sign(tmp_path, sign):
    assert dataset_of(str(tmp_path), "table", [f"separator={sign}"]).separator == sign


@pytest.mark.parametrize(
    "text",
    [
        "./mine {recording} {out}",
        "python mine.py --sigma=0.1,0.2 {recording} {out}",
        "sh -c 'cp a b' {recording}",
        "./mine(2) [x] {seed}",
    ],
)
def test_a_command_is_one_value_with_its_braces_and_quotation_marks(text):
    (word,) = arranged_overrides([f"filter.command={text}"])

    assert OverridesParser.create().parse_override(word).value() == text


def test_other_words_and_those_in_quotation_marks_stay_as_they_are():
    words = ["filter=command", "filter.time_limit_s=3", 'filter.label="x y"', "filter.command="]
    words += ["adaptation.window=4", "disturbance.imu_bias.accel_mps2=1", "hydra.sweep.dir=x.y"]

    assert arranged_overrides(words) == words


def test_the_words_of_run_describe_the_same_cell():
    words = composed(["dataset=field", "dataset.duration_s=30", "filter=command", "filter.command=sh {out}", "seeds=2"])
    cell = words.job(label="mine")

    assert cell.labels.dataset == "field(duration_s=30)"
    assert cell.labels.filter == "mine(program)"
    assert cell.spec["filter"]["command"] == "sh {out}"
    assert cell.draws == range(2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["adaptation=none,mtf", "adaptation.huber.k=1"], "adaptation.huber.k has no effect without adaptation=huber"),
        (["adaptation=none,mtf", "adaptation.mtf.windw=1"], "There is no option 'adaptation.windw'"),
    ],
)
def test_what_fits_nowhere_is_a_sentence(tmp_path, words, sentence):
    done = verb("run", "-m", *SHORT, *words, cwd=tmp_path)

    assert done.returncode == 2
    assert sentence in done.stderr
    assert not list(tmp_path.rglob("*.parquet"))


def test_glob_selects_names_and_presets_of_the_user_but_no_old_names(tmp_path):
    (tmp_path / "conf" / "noise").mkdir(parents=True)
    (tmp_path / "conf" / "noise" / "default_mine.yaml").write_text("accel_mps2: 0.3\n")
    words = ["noise=glob(def*)", "adaptation=glob(mtf_*)", "disturbance=glob(*bias)"]
    done = verb("--config-dir", "conf", "run", "-m", "--dry", *words, cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert "4 combinations, 0 complete; 20 runs" in done.stdout
    assert all(name in done.stdout for name in ("mtf_block", "mtf_nis", "default_mine", "disturbance imu_bias"))
    assert "add -m" in verb("run", "--dry", "adaptation=glob(mtf_*)", cwd=tmp_path).stderr
    assert "There is no adaptation 'x*'" in verb("run", "-m", "--dry", "adaptation=glob(x*)", cwd=tmp_path).stderr


def test_a_single_run_takes_the_address_of_what_it_has():
    assert arranged_overrides(["adaptation=mtf", "adaptation.mtf.window=4"]) == [
        "adaptation=mtf",
        "adaptation.window=4",
    ]
    assert arranged_overrides(["filter.baseline.accel_mps2=1"]) == ["filter.accel_mps2=1"]
    with pytest.raises(PluginError, match=r"adaptation\.mtf\.window=4 needs adaptation=mtf"):
        arranged_overrides(["adaptation.mtf.window=4"])


@pytest.fixture
def mine(tmp_path):
    """A folder with one preset."""
    (tmp_path / "mine" / "filter").mkdir(parents=True)
    (tmp_path / "mine" / "filter" / "quiet.yaml").write_text("defaults: [jerk]\naccel_mps2: 0.3\n")
    return tmp_path / "mine"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["run", "-m", "hydra/sweeper=optuna"], "`jerkbench tune sampler=tpe`"),
        (["filter=jerk", "seeds=2"], "to run this combination: jerkbench run filter=jerk seeds=2"),
    ],
)
def test_habits_of_hydra_that_do_not_work_here_name_what_does(typed, words, told):
    done = typed(*words)
    assert done.returncode == 2
    assert told in done.stderr


def test_a_plus_before_a_group_changes_nothing():
    assert composed(["+experiment=drive"]).plain == composed(["experiment=drive"]).plain


def test_a_configuration_is_composed_from_python_with_one_call(mine):
    config = api.configuration([f"--config-dir={mine}", "filter=quiet", "dataset.duration_s=20", "seeds=2"])
    assert (config["filter"]["accel_mps2"], config["seeds"]) == (0.3, 2)
    recording = api.load(config["dataset"])
    assert recording.clock_s[-1] == pytest.approx(20.0)
    assert api.evaluate(api.estimate(recording, filter=config["filter"]), recording)["position_rmse_m"] < 1.0


@pytest.mark.parametrize("setting", ["duration_s=30", "silent=[heading]", "separator=;", "columns={t: time}"])
def test_settings_of_inspect_are_the_parameters_of_run(setting):
    key, _, value = setting.partition("=")
    of_run = OverridesParser.create().parse_override(
        f"dataset.{key}={value!r}" if value == ";" else f"dataset.{setting}"
    )
    assert _parameters([f"dataset.{setting}"]) == _parameters([setting]) == {key: of_run.value()}
