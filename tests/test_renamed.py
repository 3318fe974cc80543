"""Old names of plugins, presets and options."""

import pytest

from jerkbench import plugins
from jerkbench.hydra_app.composition import composed
from jerkbench.jobs.names import choose
from jerkbench.presets import preset_files
from jerkbench.renamed import RENAMED, new_argument, new_label
from jerkbench.report.comparisons import parse_baseline

PAIRS = [(kind, old, new) for kind, names in RENAMED.items() for old, new in names.items()]


@pytest.mark.parametrize(("kind", "old", "new"), PAIRS)
def test_an_old_name_is_the_new_one_everywhere_and_is_not_listed(capsys, kind, old, new):
    by_old, said = composed([f"{kind}={old}"]), capsys.readouterr().err
    by_new, unsaid = composed([f"{kind}={new}"]), capsys.readouterr().err
    assert by_old.job().spec == by_new.job().spec
    assert by_old.job().labels == by_new.job().labels
    assert said == f"{kind}={old} is now {kind}={new}; the old name will be removed in the next version.\n"
    assert not unsaid
    if kind != "noise":
        assert choose(kind, old).plain == choose(kind, new).plain
    listed = [*preset_files(kind), *(plugins.names(kind) if kind in plugins.KINDS else ())]
    assert new in listed
    assert old not in listed


def test_a_file_of_ones_own_may_still_have_old_names(tmp_path, typed):
    folder = tmp_path / "own" / "experiment"
    folder.mkdir(parents=True)
    (folder / "mine.yaml").write_text(
        "# @package _global_\ndefaults:\n  - override /dataset: field_v1_ruts\n  - override /disturbance: [bias]\n"
        "  - override /noise: naive\n",
        encoding="utf-8",
    )

    shown = typed("run", "--config-dir", str(tmp_path / "own"), "experiment=mine", "--cfg", "job")

    assert shown.returncode == 0, shown.stderr
    assert all(line in shown.stdout for line in ("  name: field_white", "    name: imu_bias", "  accel_mps2: 0.02"))


@pytest.mark.parametrize(
    ("kind", "stored", "shown"),
    [
        ("dataset", "field_v1_ruts(duration_s=20)", "field_white_ruts(duration_s=20)"),
        ("disturbance", "bias(accel_mps2=0.1)+gnss_outage", "imu_bias(accel_mps2=0.1)+gnss_outage"),
        ("disturbance", "stated_covariance(of=bias)", "stated_covariance(of=bias)"),
        ("filter", "bias", "bias"),
        ("filter", "baseline_naive(accel_mps2=0.1)", "baseline_untuned(accel_mps2=0.1)"),
        ("noise", "own", "default"),
        ("adaptation", "own", "own"),
    ],
)
def test_labels_of_stored_rows_are_read_with_the_names_of_today(kind, stored, shown):
    assert new_label(kind, stored) == shown


def test_a_choice_of_stored_rows_may_have_old_names():
    assert parse_baseline("noise=own;disturbance=bias") == {"noise": "default", "disturbance": "imu_bias"}


@pytest.mark.parametrize(
    ("typed", "today"),
    [
        ("disturbance=none,[bias,gnss_outage]", "disturbance=none,[imu_bias,gnss_outage]"),
        ("disturbance.bias.accel_mps2=0.1", "disturbance.imu_bias.accel_mps2=0.1"),
        ("+disturbance@disturbance.second=bias", "+disturbance@disturbance.second=imu_bias"),
        ("filter=jerk,baseline_naive", "filter=jerk,baseline_untuned"),
        *(
            (word, word)
            for word in ("dataset.duration_s=3", "filter=bias,jerk", "study=field_v1", "noise.accel_mps2=1")
        ),
    ],
)
def test_a_word_has_its_names_of_today(typed, today):
    assert new_argument(typed) == today
