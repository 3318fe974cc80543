"""`jerkbench compare` with a file of tolerances, and of one method with another."""

import hashlib
import json

import pytest

from commands import verb
from jerkbench.jobs.store import Store
from stored_cells import LABELS, about, row, store_cell

YAML = """\
tolerances:
  - {method: mtf, scenario: "*outage", ratio: 1.5}
  - {metric: velocity_rmse_mps, ratio: 1.02}
  - {ratio: 1.10}
"""
TOML = """\
[[tolerances]]
method = "mtf"
scenario = "*outage"
ratio = 1.5
[[tolerances]]
metric = "velocity_rmse_mps"
ratio = 1.02
[[tolerances]]
ratio = 1.10
"""


def put(folder, rmse_m, rmse_mps=1.0, **labels):
    """Store a cell with the errors of three runs."""
    key = hashlib.sha256(str(labels).encode()).hexdigest()[:16]
    rows = [row(rmse_m * (1 + seed / 10), seed, **labels) | {"velocity_rmse_mps": rmse_mps} for seed in range(3)]
    store_cell(Store(folder), key, rows, about(labels={**LABELS, **labels}))


def study(folder, outage=1.0, nothing=1.0, velocity=1.0):
    """Two methods in two scenarios; the errors of mtf are times a factor, all velocities as well."""
    for disturbance, factor in (("gnss_outage", outage), ("none", nothing)):
        put(folder, 2.0, velocity, adaptation="none", disturbance=disturbance)
        put(folder, 2.0 * factor, velocity, adaptation="mtf", disturbance=disturbance)
    return folder


@pytest.fixture
def before(tmp_path):
    return study(tmp_path / "before")


@pytest.mark.parametrize(("name", "rules"), [("rules.yaml", YAML), ("rules.toml", TOML)])
def test_each_combination_has_its_own_tolerance(before, tmp_path, name, rules):
    (tmp_path / name).write_text(rules)
    study(tmp_path / "near", outage=1.4, nothing=1.09, velocity=1.01)
    study(tmp_path / "after", outage=1.6, nothing=1.09, velocity=1.03)
    passed = verb("compare", "before", "near", "--tolerances", name, cwd=tmp_path)
    assert passed.returncode == 0, passed.stderr

    done = verb("compare", "before", "after", "--tolerances", name, "--format", "json", cwd=tmp_path)
    answer = json.loads(done.stdout)
    worse = {
        (change["metric"], change["combination"]["adaptation"], change["combination"]["disturbance"])
        for change in answer["changes"]
        if change["worse"]
    }
    velocities = {
        ("velocity_rmse_mps", *method) for method in (("none", "gnss_outage"), ("none", "none"), ("mtf", "none"))
    }
    assert done.returncode == 3
    assert answer["metrics"] == ["position_rmse_m", "velocity_rmse_mps"]
    assert worse == {("position_rmse_m", "mtf", "gnss_outage"), *velocities}
    assert "3 of 4 combinations, by velocity_rmse_mps, are worse by more than" in done.stderr


def test_the_table_says_what_was_allowed_and_what_failed(before, tmp_path):
    (tmp_path / "rules.yaml").write_text(YAML)
    study(tmp_path / "after", outage=1.6, nothing=1.05)
    page = verb("compare", "before", "after", "--tolerances", "rules.yaml", "--format", "md", cwd=tmp_path).stdout
    outage = next(line for line in page.splitlines() if line.startswith("| gnss_outage | mtf"))

    assert "×1.60 |      | 0 of 3 lost (up to 63 %) | ×1.5 " in outage  # noqa: RUF001
    assert outage.endswith(", too much |")
    assert page.count("too much") == 1
    assert page.count("## ") == 2


def test_where_no_line_fits_the_option_counts_and_a_line_that_fits_nothing_is_told(before, tmp_path):
    (tmp_path / "rules.yaml").write_text("tolerances:\n  - {method: huber, ratio: 2}\n")
    study(tmp_path / "after", nothing=1.2)
    words = ["compare", "before", "after", "--tolerances", "rules.yaml"]

    free = verb(*words, cwd=tmp_path)
    assert free.returncode == 0
    assert "Tolerance 1 fits no combination (metric *, method huber, scenario *)." in free.stdout
    assert verb(*words, "--fail-above", "10", cwd=tmp_path).returncode == 3


@pytest.mark.parametrize(
    ("rules", "sentence"),
    [
        ("tolerance: []", "has no list of tolerances"),
        ("tolerances: [1.05]", "tolerance 1 is 1.05; write it as"),
        ("tolerances: [{ratio: 5 %}]", "ratio is '5 %'; it must be a number above 0"),
        ("tolerances: [{metric: a}]", "ratio is None"),
        ("tolerances: [{ratio: 1.1, filter: jerk}]", "There is no key 'filter'"),
        ("tolerances: [", "rules.yaml cannot be read: "),
    ],
)
def test_a_file_that_says_nothing_clear_is_refused(before, tmp_path, rules, sentence):
    (tmp_path / "rules.yaml").write_text(rules)
    done = verb("compare", "before", "before", "--tolerances", "rules.yaml", cwd=tmp_path)

    assert done.returncode == 2
    assert sentence in done.stderr


def test_one_method_is_compared_with_another_on_the_scenarios_of_both(before, tmp_path):
    put(tmp_path / "mine", 3.0, filter="mine", adaptation="none", disturbance="gnss_outage")
    put(tmp_path / "mine", 1.0, filter="mine", adaptation="none", disturbance="none")
    words = ["compare", "before:jerk+mtf", "mine:mine+none"]
    answer = json.loads(verb(*words, "--format", "json", cwd=tmp_path).stdout)
    ratios = {change["combination"]["disturbance"]: change["ratio"] for change in answer["changes"]}

    assert ratios == {"gnss_outage": pytest.approx(1.5), "none": pytest.approx(0.5)}
    assert "mine + none of B is compared with jerk + mtf of A, and stands under its name." in answer["notes"]
    assert verb(*words, "--fail-above", "40", cwd=tmp_path).returncode == 3
    assert verb(*words, "--fail-above", "60", cwd=tmp_path).returncode == 0


def test_a_factor_that_is_not_named_has_to_be_the_same_in_both(before, tmp_path):
    put(tmp_path / "mine", 4.0, filter="mine", adaptation="mtf", disturbance="none")
    done = verb("compare", "before", "mine:mine", "--format", "json", cwd=tmp_path)

    assert [change["combination"]["adaptation"] for change in json.loads(done.stdout)["changes"]] == ["mtf"]


@pytest.mark.parametrize(
    ("a", "b", "sentence"),
    [
        ("before:jerky", "before", "Did you mean 'jerk'?"),
        ("before:jerk+mtf", "before", "has 2 values of the adaptation: mtf, none. Say which one to compare"),
        ("before:jerk+filter=jerk", "before", "names the filter twice"),
        ("before:jerk+none+own+field", "before", "has more words than filter, adaptation, noise"),
        ("before:colour=red", "before", "There is no factor 'colour'"),
        ("nothing:jerk", "before", "nothing holds no results"),
    ],
)
def test_a_method_that_is_not_clear_is_refused(before, tmp_path, a, b, sentence):
    done = verb("compare", a, b, cwd=tmp_path)

    assert done.returncode == 2
    assert sentence in done.stderr


def test_a_method_is_chosen_by_two_factors_of_one_study(before, tmp_path):
    put(before, 6.0, filter="baseline", adaptation="none", disturbance="none")
    put(before, 3.0, filter="baseline", adaptation="mtf", disturbance="none")
    done = verb("compare", "before:baseline+none+default", "before:jerk+mtf+own", "--format", "json", cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    (change,) = json.loads(done.stdout)["changes"]
    assert change["combination"]["disturbance"] == "none"
    assert change["ratio"] == pytest.approx(2.0 / 6.0)


def test_exit_codes_tell_worse_from_what_cannot_be_compared_and_from_wrong_input(before, tmp_path):
    study(tmp_path / "after", outage=1.6)
    put(tmp_path / "part", 2.0, adaptation="none", disturbance="none")
    put(tmp_path / "other", 2.0, filter="baseline", disturbance="elsewhere")
    put(tmp_path / "bad", 8.0, adaptation="none", disturbance="none")
    codes = {
        b: verb("compare", "before", b, "--fail-above", "3", cwd=tmp_path).returncode
        for b in ("before", "after", "part", "other", "bad", "absent")
    }

    assert codes == {"before": 0, "after": 3, "part": 4, "other": 4, "bad": 3, "absent": 2}


def test_the_help_names_each_exit_code(tmp_path):
    text = verb("compare", "--help", cwd=tmp_path).stdout

    assert all(f"\n  {code}  " in text for code in (0, 1, 2, 3, 4))
