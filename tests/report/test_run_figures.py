"""The title of a run's figures: what it was, and which of its seeds."""

from dataclasses import replace

import pytest

from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.plan import planned
from jerkbench.jobs.rows import run_seed
from jerkbench.report import study_figures
from jerkbench.report.study_figures import file_stem, with_title

SPEC = {
    "attitude": {"name": "tilt"},
    "filter": {"name": "baseline"},
    "adaptation": {"name": "none"},
    "engine": {"name": "filterpy"},
}
FIELD = {"name": "field", "duration_s": 20.0}
DRIVE = {"name": "rtklib", "folder": "anywhere"}


def cell(dataset, *disturbances):
    return build({**SPEC, "dataset": dataset, "disturbance": list(disturbances)}, Protocol(seeds=3, first_seed=7))


@pytest.mark.parametrize(
    ("one", "said"),
    [
        (cell(FIELD, {"name": "none"}), "a, seed 7"),
        (cell(FIELD, {"name": "imu_bias"}), "a, imu_bias, seed 7"),
        (cell(DRIVE, {"name": "none"}), "a"),
        (cell(DRIVE, {"name": "withhold", "every": 4}), "a, withhold, phase 7"),
    ],
)
def test_a_title_says_data_set_disturbance_and_seed(one, said, make_short):
    assert with_title(make_short("a"), one, 7).name == said


def test_a_long_title_has_several_lines(make_short):
    name = with_title(make_short("a " * 50), cell(FIELD, {"name": "imu_bias"}), 7).name
    assert name.endswith("imu_bias, seed 7")
    assert max(map(len, name.split("\n"))) <= 70


def test_the_figures_of_a_single_run_have_it(tmp_path, monkeypatch):
    names = []
    monkeypatch.setattr(study_figures, "with_title", lambda *given: names.append(with_title(*given).name) or given[0])
    (one,) = planned([cell(FIELD, {"name": "imu_bias"})]).jobs
    study_figures.draw_single(one, tmp_path)
    assert set(names) == {"field, imu_bias, seed 7"}


@pytest.fixture(scope="module")
def make_short():
    recording, _ = run_seed(cell(FIELD, {"name": "none"}), 7)
    return lambda name: replace(recording, name=name)


MANY = {"name": "gnss_outage", "windows_s": [[10.0 * k, 10.0 * k + 5.0] for k in range(38)]}


def test_a_title_with_many_parameters_has_a_few_lines(make_short):
    labels = cell(FIELD, {"name": "none"}).labels._replace(disturbance=f"gnss_outage(windows_s={MANY['windows_s']})")
    name = with_title(make_short("field"), replace(cell(FIELD, MANY), labels=labels), 7).name
    assert name == "field, gnss_outage, seed 7"
    assert with_title(make_short("word " * 200), cell(FIELD, MANY), 7).name.count("\n") < 4


def test_names_of_files_are_short_and_the_same_for_the_same_labels():
    plain = cell(FIELD, {"name": "imu_bias"}).labels
    long = plain._replace(dataset=f"table({', '.join(f'column_{k}=name_{k}' for k in range(40))})")

    assert file_stem(plain) == "field-imu_bias-tilt-baseline-none-default"
    assert file_stem(long) == file_stem(long)
    assert file_stem(long).startswith("table-imu_bias-tilt-baseline-none-default-")
    assert file_stem(long) != file_stem(long._replace(dataset=long.dataset.replace("name_3", "name_4")))
    assert len(file_stem(plain._replace(disturbance="+".join(["gnss_outage"] * 30)))) < 120
