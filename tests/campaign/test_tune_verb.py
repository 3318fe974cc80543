"""`jerkbench tune`: what it prints, what it writes, and what it refuses."""

import json
import re
import shlex
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import yaml
from scipy import stats

import pages
from commands import verb
from jerkbench.campaign.outcome import against_default
from jerkbench.campaign.search import TuningScore
from jerkbench.jobs.store import Store

SMALL = ["dataset.duration_s=12", "tune_seeds=1", "choose_seeds=1", "test_seeds=2", "finalists=2", "workers=1"]
FAST = [*SMALL, "trials=4", "figures=false"]


def preset_folders(*methods):
    return [word for name in methods for word in ("--config-dir", f"results/adhoc/tune/{name}/conf")]


@pytest.fixture(scope="module")
def tuned(tmp_path_factory):
    """A folder in which two methods were tuned over two scenarios, and what was said."""
    folder = tmp_path_factory.mktemp("tuned")
    words = ["filter=baseline", "adaptation=none,chi2", "disturbance=none,outliers", *SMALL, "trials=4"]
    done = verb("tune", "-m", *words, cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


def test_it_says_that_budgets_were_equal_and_writes_trials_figure_and_files_for_other_programs(tuned):
    folder, out = tuned
    assert "Equal budgets: each of 2 methods tried 4 settings." in out
    assert "Split: seeds 0 to 0 to tune, 1 to 1 to choose, 2 to 3 to test." in out
    record = json.loads((folder / "results/adhoc/tune/baseline-chi2/tuning.json").read_text())
    assert record["trials"] == 4
    assert set(record["unseen"]) == {"field(duration_s=12), none, field", "field(duration_s=12), outliers, field"}
    assert len(record["setting"]) == 5
    place = tuned[0] / "results/adhoc/tune/baseline-none"
    trials = pd.read_csv(place / "trials.csv")
    assert len(trials) == 4
    assert trials["filter.accel_mps2"][0] == 0.2
    assert trials["loss"][0] == pytest.approx(0.0, abs=1e-12)
    place = tuned[0] / "results/adhoc/tune/baseline-chi2"
    setting = json.loads((place / "tuning.json").read_text())["setting"]
    texts = {path.name: path.read_text() for path in (place / "export").iterdir()}
    node = yaml.safe_load(texts["robot_localization.yaml"])
    density = setting["filter.accel_mps2"] ** 2 * 0.01  # the field's IMU gives 100 samples a second
    noise = node["ekf_filter_node"]["ros__parameters"]["process_noise_covariance"]
    assert len(noise) == 225
    assert noise[16 * 6] == pytest.approx(density, rel=1e-4)
    assert min(noise[::16]) > 0  # a zero would freeze that state
    assert noise[0] == 0.05  # its own default
    assert "oes not map" in texts["robot_localization.yaml"]


def printed(text):
    """The words of the command that a page prints."""
    return shlex.split(text.partition("Run the tuned method with: jerkbench ")[2].splitlines()[0])


def test_the_command_that_is_printed_runs_what_was_tuned_where_it_was_tuned(tuned):
    folder, _ = tuned
    place = folder / "results/adhoc/tune/baseline-chi2"
    setting = json.loads((place / "tuning.json").read_text())["setting"]
    command = printed((place / "tuning.md").read_text())
    assert command[-2:] == ["first_seed=4", "seeds=2"]  # 0 to 3 are of the tuning, and 2 seeds are of the test

    done = verb(*command, "seeds=1", "study=printed", "figures=false", cwd=folder)

    assert done.returncode == 0, done.stderr
    cells = [stored.metadata for stored in Store(folder / "results/printed").read()[0]]
    assert {cell["labels"]["disturbance"] for cell in cells} == {"none", "outliers"}
    for cell in cells:
        labels = [cell["labels"][name] for name in ("filter", "adaptation", "noise")]
        assert labels == ["baseline, tuned", "chi2", "default"]
        assert cell["spec"]["dataset"]["duration_s"] == 12
        assert cell["spec"]["filter"]["accel_mps2"] == pytest.approx(setting["filter.accel_mps2"])
        assert cell["spec"]["adaptation"]["longest"] == setting["adaptation.longest"]
        assert cell["spec"]["r_scale"]["velocity"] == pytest.approx(setting["r_scale.velocity"])


def test_the_report_of_a_study_of_tuned_methods_is_true(tuned):
    folder, _ = tuned
    folders = preset_folders("baseline-none", "baseline-chi2")
    words = ["experiment=baseline_none_tuned,baseline_chi2_tuned", "disturbance=none,outliers", "dataset.duration_s=12"]
    done = verb("run", "-m", *folders, *words, "first_seed=4", "seeds=6", "study=fair", "figures=false", cwd=folder)
    assert done.returncode == 0, done.stderr

    found = verb("table", "results/fair", "--findings", cwd=folder).stdout
    assert verb("report", "results/fair", "--scenarios", "0", cwd=folder).returncode == 0

    budget = "Tuned by jerkbench tune: objective=rmse, trials=4, finalists=2, sampler=sobol; seeds 0 to 0 to tune"
    assert budget in done.stdout
    assert any("chi2" in line and "none" in line for line in found.splitlines()[4:]), found
    assert "not run" not in done.stdout  # each tuned method has its own cell
    assert "optimistic" not in done.stderr
    text = (folder / "results/fair/report.html").read_text(encoding="utf-8")
    review = re.sub(r"<[^>]*>", "", text)
    assert re.search(rf"Were the baselines tuned with the same budget\?\s*passed\s*{budget}", review)
    assert "best noise of the sweep" not in text
    assert "No comparison is possible" not in text


def test_default_and_tuned_methods_are_side_by_side_and_the_review_passes(tuned):
    folder, _ = tuned
    folders = preset_folders("baseline-none", "baseline-chi2")
    shared = ["disturbance=none,outliers", "dataset.duration_s=12", "first_seed=4", "seeds=6", "study=both"]
    experiments = "experiment=baseline_none_tuned,baseline_chi2_tuned"
    for words in (["filter=baseline", "adaptation=none,chi2"], [experiments, "figures=false"]):
        done = verb("run", "-m", *folders, *words, *shared, cwd=folder)
        assert done.returncode == 0, done.stderr

    table = verb("table", "results/both", cwd=folder).stdout
    assert verb("report", "results/both", "--scenarios", "0", cwd=folder).returncode == 0

    rows = [line for line in table.splitlines() if line.strip().startswith(("none", "outliers", "baseline"))]
    assert [("tuned" in line, line.count("[")) for line in rows] == [(False, 2), (True, 2)] * 2
    review = re.sub(r"<[^>]*>", "", (folder / "results/both/report.html").read_text(encoding="utf-8"))
    assert re.search(r"Were the baselines tuned with the same budget\?\s*passed\s*Tuned by jerkbench tune", review)


def test_seeds_that_were_tuned_on_are_not_run_without_a_message(tuned):
    folder, _ = tuned
    preset = [*preset_folders("baseline-chi2"), "experiment=baseline_chi2_tuned"]
    for words in (["run"], ["run", "-m"]):
        done = verb(*words, *preset, "dataset.duration_s=12", "seeds=3", "study=again", "figures=false", cwd=folder)
        assert "tuned on the seeds 0 to 1, and 2 of them are run again" in " ".join(done.stderr.split())
        assert "first_seed=4" in done.stderr


def test_compare_tunes_all_methods_and_runs_them_on_unused_seeds(tmp_path):
    words = ["filter=baseline,jerk", "adaptation=none,chi2", "disturbance=outliers", *FAST]
    done = verb("tune", "-m", *words, "study=one", "--compare", cwd=tmp_path)
    assert done.returncode == 0, done.stderr

    rows = pd.read_csv(tmp_path / "results/one/rows.csv")
    filters = ("baseline, untuned", "baseline, tuned", "jerk, untuned", "jerk, tuned")
    methods = {(name, rule) for name in filters for rule in ("none", "chi2")}
    assert set(rows[["filter", "adaptation"]].itertuples(index=False, name=None)) == methods
    assert set(rows["seed"]) == {4, 5}  # 0 to 3 are of the tuning


def test_settings_before_tuning_have_the_scenario_of_the_tuned_settings_also_if_r_is_scaled(tmp_path):
    words = ["filter=baseline", "adaptation=mtf", "adaptation.mtf.window=1,4", "r_scale.position=2", *FAST]
    done = verb("tune", "-m", *words, "study=one", "--compare", cwd=tmp_path)
    assert done.returncode == 0, done.stderr

    rows = pd.read_csv(tmp_path / "results/one/rows.csv")
    assert set(rows["filter"]) == {f"baseline {k}, {state}" for k in (1, 2) for state in ("tuned", "untuned")}
    assert set(rows["noise"]) == {"default"}
    stored, _ = Store(tmp_path / "results/one").read()
    before = {one.metadata["labels"]["filter"]: one.metadata["spec"] for one in stored}
    assert [before[f"baseline {k}, untuned"]["adaptation"]["window"] for k in (1, 2)] == [1, 4]
    assert before["baseline 1, untuned"]["r_scale"]["position"] == 2


def test_a_tuning_that_makes_a_method_worse_is_named():
    ratios = np.exp(0.3 + 0.02 * np.random.default_rng(1).standard_normal(20))
    score = TuningScore(np.zeros(1), np.full(1, 0.3), 0, 0, 20, np.ones(20), ratios)
    tuning = SimpleNamespace(name="jerk-mtf", outcome=SimpleNamespace(best=3), score=score)

    *_, verdict, advice, _ = against_default([tuning])

    assert verdict.startswith("tuning of jerk-mtf")
    assert "] worse; 0 of 20 failed" in verdict
    assert advice.startswith("Tuning made jerk-mtf worse on runs that were not used for tuning. Publish the tuned row")


def test_the_command_keeps_what_was_given_and_not_tuned(tmp_path):
    given = ["filter=bias", "adaptation=mtf", "adaptation.window=3", "r_scale.position=2"]
    words = [*given, "dataset=field_white", "attitude=real", *FAST, "knobs=[filter.accel_mps2]"]
    done = verb("tune", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr

    ran = verb(*printed(done.stdout), "seeds=1", "study=printed", cwd=tmp_path)

    assert ran.returncode == 0, ran.stderr
    ((stored,), _) = Store(tmp_path / "results/printed").read()
    spec = stored.metadata["spec"]
    labels = stored.metadata["labels"]
    assert (labels["dataset"], labels["attitude"]) == ("field_white(duration_s=12)", "real")
    assert (spec["adaptation"]["window"], spec["r_scale"]["position"]) == (3, 2)
    record = json.loads(next(tmp_path.rglob("tuning.json")).read_text())
    assert spec["filter"]["accel_mps2"] == pytest.approx(record["setting"]["filter.accel_mps2"])


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["filter=gnss_only"], "no parameter of the filter gnss_only and the adaptation none has a range"),
        (["filter=baseline,jerk"], "There are 2 methods; add -m"),
        (["trials=0"], "trials is 0; it must be at least 1"),
        (["trials=many"], "trials:"),
        (["sampler=soboll"], "Did you mean 'sobol'"),
        (["objective=rmsee"], "Did you mean 'rmse'"),
        (["split=seed"], "Did you mean 'seeds'"),
        (["split=families"], "held_out=[NAME,...]"),
        (["split=families", "held_out=[wheel_slip]"], "each part needs at least one scenario"),
        (["knobs=[filter.acel_mps2]"], "Did you mean 'filter.accel_mps2'"),
        (["test_seeds=0"], "tune_seeds and test_seeds must be at least 1"),
        (["test_seeds=2147483648"], "at most 100000"),
        (["filter.sigma=3"], "sigma"),
        (["jerk"], "give KEY=VALUE"),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_sentence(tmp_path, words, sentence):
    done = verb("tune", *FAST, *words, cwd=tmp_path)

    assert done.returncode == 2
    assert sentence in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_two_workers_find_what_this_process_finds(tuned, tmp_path):
    fast = [word for word in FAST if word != "workers=1"]
    words = ["filter=baseline", "adaptation=chi2", "disturbance=none,outliers", *fast, "workers=2"]
    done = verb("tune", *words, cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    own, here = (folder / "results/adhoc/tune/baseline-chi2/trials.csv" for folder in (tmp_path, tuned[0]))
    pd.testing.assert_frame_equal(pd.read_csv(own), pd.read_csv(here), rtol=1e-12)


def test_the_tuned_methods_are_compared_by_their_own_errors_seed_by_seed(tmp_path):
    """Ratio and interval follow from ordinary runs of the presets; two models, whose plain filters differ."""
    scenarios = ["disturbance=none,imu_bias", "dataset.duration_s=30"]
    words = ["filter=baseline,jerk", *scenarios, "tune_seeds=1", "choose_seeds=1", "test_seeds=6", "trials=2"]
    out = verb("tune", "-m", *words, "finalists=2", "figures=false", "workers=1", cwd=tmp_path).stdout
    folders = preset_folders("baseline-none", "jerk-none")
    experiments = "experiment=baseline_none_tuned,jerk_none_tuned"
    verb("run", "-m", *folders, experiments, *scenarios, "first_seed=2", "seeds=6", "study=both", cwd=tmp_path)

    rows = pd.read_csv(tmp_path / "results/both/rows.csv").assign(log=lambda own: np.log(own["position_rmse_m"]))
    means = rows.assign(model=rows["filter"].str.removesuffix(", tuned")).pivot_table("log", "seed", "model")
    d = means["jerk"] - means["baseline"]
    assert abs(d.mean()) > 0.1  # else the two cannot be told apart
    (line,) = (line for line in out.splitlines() if line.startswith("jerk-none") and "[" in line)
    ratio, low, high = (float(number) for number in re.findall(r"\d+\.\d+", line)[:3])
    assert ratio == pytest.approx(np.exp(d.mean()), abs=6e-4)
    assert np.sqrt(low * high) == pytest.approx(ratio, abs=2e-3)
    half = stats.t.ppf(0.975, 5) * d.std(ddof=1) / np.sqrt(6)  # Student's is too narrow where errors are skewed
    assert 0.99 * half <= np.log(high / low) / 2 <= 1.5 * half
    assert line.endswith("; 0 of 6 failed (up to 39 %)")


def test_presets_of_one_name_in_two_folders_are_refused(tmp_path):
    """Else the first would silently stand for both, and a method be compared with itself."""
    for folder, accel_mps2 in (("a", 0.1), ("b", 0.2)):
        (tmp_path / folder / "filter").mkdir(parents=True)
        text = f"defaults: [baseline, _self_]\naccel_mps2: {accel_mps2}\n"
        (tmp_path / folder / "filter/mine.yaml").write_text(text)

    done = verb("run", "--config-dir", "a", "--config-dir", "b", "filter=mine", cwd=tmp_path)

    assert done.returncode != 0
    assert "different presets with the same name; rename one file." in done.stderr


@pytest.mark.parametrize(("velocity", "knobs"), [("", 1), (",1.0,0,0", 2)])
def test_r_of_velocities_is_tuned_where_there_are_velocities(tmp_path, velocity, knobs):
    t_s = np.arange(400) / 10
    rows = [f"{t},{1.0 * t:.3f},{0.3 * np.sin(t):.3f},0{velocity}" for t in t_s]
    names = "t,east_m,north_m,up_m" + (",ve,vn,vu" if velocity else "")
    (tmp_path / "log.csv").write_text("\n".join([names, *rows]))
    assert verb("data", "inspect", "log.csv", "--preset", "mine.yaml", cwd=tmp_path).returncode == 0
    words = ["dataset=mine", "filter=constant_velocity", "trials=2", "finalists=1", "objective=likelihood", "workers=1"]
    done = verb("tune", "--config-dir", ".", *words, "split=time", "figures=none", cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert done.stdout.count("| r_scale.") == knobs


@pytest.mark.slow
def test_a_comparison_on_a_log_without_reference_withholds_fixes_in_the_part_that_was_not_tuned(tmp_path):
    t_s = np.arange(600) / 10
    noise = np.random.default_rng(0).normal(0, 0.5, (600, 2))
    rows = [f"{t},{t + a:.3f},{8 * np.sin(t / 3) + b:.3f},0" for t, (a, b) in zip(t_s, noise, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(["t,east_m,north_m,up_m", *rows]))
    inspected = verb("data", "inspect", "log.csv", "--preset", "mine.yaml", cwd=tmp_path)
    assert "\nreference none\n" in inspected.stdout
    words = ["dataset=mine", "filter=constant_velocity,acceleration", "trials=2", "finalists=1", "workers=1"]
    for more in (["objective=rmse"], ["objective=rmse", "disturbance=none"], ["disturbance=none", "--compare"]):
        refused = verb("tune", "-m", "--config-dir", ".", *words, *more, cwd=tmp_path)
        assert "The log has no reference; use disturbance=withhold" in refused.stderr
    done = verb("tune", "-m", "--config-dir", ".", *words, "figures=none", "study=one", "--compare", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Objective: likelihood" in done.stdout
    assert f"burn_in_s={0.5 * t_s[-1]:g}" in printed(done.stdout)  # the first half was used for tuning
    assert "disturbance=withhold" in printed(done.stdout)
    typed = ["disturbance=none", "figures=none", "study=two"]
    other = verb("tune", "--config-dir", ".", words[0], "filter=acceleration", *words[2:], *typed, cwd=tmp_path)
    assert [word for word in printed(other.stdout) if word.startswith("disturbance")] == ["disturbance=none"]
    assert "The log has no reference: the comparison withholds three of four fixes" in done.stdout

    stored, _ = Store(tmp_path / "results/one").read()
    assert all(one.metadata["protocol"]["burn_in_s"] == pytest.approx(0.5 * t_s[-1]) for one in stored)
    rows = pd.read_csv(tmp_path / "results/one/rows.csv")
    assert set(rows["disturbance"]) == {"withhold"}
    assert set(rows["seed"]) == {0, 1, 2, 3}


HUSKY = ["dataset=husky_bag", "dataset.file=BAG"]
QUICK = {"tune": ["trials=2", "figures=false"], "run": ["figures=false"], "data": []}


@pytest.mark.slow
@pytest.mark.parametrize("recording", ["husky_bag", "drive"])
def test_the_page_goes_well_from_the_log_to_the_settings(recording, shared_folder, tmp_path):
    data = shared_folder / "data"
    log = {"husky_bag": data / "robot_localization/test1.bag", "drive": data / "rtklib_drive_0708"}[recording]
    drive = ["dataset=rtklib", f"dataset.folder={log}"]
    own = drive if recording == "drive" else ["dataset=husky_bag", f"dataset.file={log}"]

    for words in pages.commands("one_bag"):
        typed = [word for word in words if word not in HUSKY]
        typed += own if len(typed) < len(words) else []
        typed = [str(log) if word == "BAG" else word for word in typed]
        done = verb(*typed, *QUICK[typed[0]], cwd=tmp_path)
        assert done.returncode == 0, (typed, done.stderr)

    place = tmp_path / "results/bag/tune/bias-none"
    assert "the first 50 % of the time to tune" in (place / "tuning.md").read_text()
    for path in (place / "export").iterdir():
        assert yaml.safe_load(path.read_text())


@pytest.mark.slow
def test_a_search_for_the_likelihood_warns_of_innovations_that_stay_correlated(tmp_path):
    drive = ["dataset.duration_s=60", "dataset.position_sigma_m=[2,2,4]", "seeds=1", "figures=none", "workers=1"]
    words = ["tune", "filter=baseline", "objective=likelihood", "split=time", "trials=2", "finalists=1", *drive]
    slow = ["dataset=field", "dataset.position_coloured_share=0.95", "dataset.position_coloured_time_s=30"]
    coloured = verb(*words, *slow, "study=coloured", cwd=tmp_path)
    assert "Warning: successive innovations of the tuned filter have the correlation 0." in coloured.stdout
    white = verb(*words, "dataset=field_white", "study=white", cwd=tmp_path)
    assert "On runs that the search has not used" in white.stdout, white.stderr
    assert "Warning" not in white.stdout
