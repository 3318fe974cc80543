"""`jerkbench run`: plans that are printed only (--dry), and exit codes."""

import shutil

import pytest

from commands import SHORT, verb
from jerkbench import api
from jerkbench.hydra_app import app
from jerkbench.hydra_app.app import forecast
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.names import job_of_parts
from jerkbench.jobs.plan import planned
from jerkbench.jobs.store import Store

FIELD = {"name": "field", "duration_s": 12}


def plan_of(*filters, seeds=4):
    single = {"dataset": FIELD, "attitude": None, "adaptation": None, "engine": None}
    return planned([job_of_parts({**single, "filter": f}, [], None, Protocol(seeds=seeds)) for f in filters])


def test_a_dry_sweep_says_what_it_would_do_and_does_nothing(tmp_path):
    words = ["dataset.duration_s=12", "seeds=3", "workers=2"]
    done = verb("run", "-m", "--dry", *words, "filter=gnss_only,jerk", "adaptation=none,mtf", cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    same = "In all combinations: dataset field(duration_s=12), disturbance none, attitude field, noise default."
    assert done.stdout.startswith(f"{same}\nfilter, adaptation:\n")
    assert "\n  jerk, mtf: 3 runs\n" in done.stdout
    assert "Left out 1 combination: the filter gnss_only does not support adaptation=mtf" in done.stdout
    assert "3 combinations, 0 complete; 9 runs to compute." in done.stdout
    assert not list(tmp_path.rglob("*.parquet"))


def test_a_dry_single_run_does_nothing_either(tmp_path):
    done = verb("run", "--dry", *SHORT, cwd=tmp_path)

    assert (done.returncode, done.stderr) == (0, "")
    assert (
        "  field(duration_s=12), none, field, baseline, none, default: 1 run\n"
        "1 combination, 0 complete; 1 run to compute." in done.stdout
    )
    assert not list(tmp_path.iterdir())


def test_a_single_run_says_how_much_of_the_sweep_of_its_experiment_it_ignores(tmp_path):
    given = ["experiment=paper", "dataset=field", "filter=jerk", "adaptation=mtf", "--dry"]
    ignoring = "This command runs 1 of the 5 combinations of the experiment and ignores the other 4; add -m"

    for words, said in ((given, ignoring), (["-m", *given], ""), ([*given, "disturbance=none"], "")):
        assert said in (err := verb("run", *words, cwd=tmp_path).stderr)
        assert err.count("\n") == bool(said)


def test_what_is_done_is_not_counted(tmp_path):
    api.sweep(tmp_path / "mine", dataset=FIELD, filter="jerk", seeds=4)
    told = list(forecast(plan_of("jerk"), Store(tmp_path / "mine"), 0))

    assert told[1].endswith("jerk, none, default: complete")
    assert told[-1] == "1 combination, 1 complete; 0 runs to compute."


@pytest.mark.parametrize("note", ["[5,6]", "{a:1}"])
@pytest.mark.parametrize("multirun", [[], ["-m"]])
def test_a_note_that_is_not_text_is_refused_before_the_run(tmp_path, note, multirun):
    done = verb("run", *multirun, *SHORT, f"notes=[{note}]", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "give only texts" in done.stderr
    assert not (tmp_path / "results").exists()


def test_a_diverged_run_is_a_result_and_a_failed_run_is_not(tmp_path, monkeypatch):
    done = verb("run", *SHORT, "divergence_limit_m=1e-9", cwd=tmp_path)
    assert "diverged" in done.stdout
    assert done.returncode == 0
    done = verb("run", "-m", *SHORT, "divergence_limit_m=1e-9", "adaptation=none,mtf", cwd=tmp_path)
    assert done.returncode == 0
    monkeypatch.setattr("jerkbench.jobs.rows.run_seed", lambda *_: 1 / 0)
    monkeypatch.setattr("jerkbench.jobs.rows.streams", lambda _: False)
    assert verb("run", "-m", *SHORT, "study=failing", "adaptation=none,mtf", cwd=tmp_path).returncode == 1


def test_a_sweep_whose_files_vanish_meanwhile_says_so(tmp_path, monkeypatch):
    run = app.run_missing

    def vanishing(plan, store, workers):
        run(plan, store, workers)
        shutil.rmtree(store.folder)

    monkeypatch.setattr(app, "run_missing", vanishing)
    done = verb("run", "-m", *SHORT, "adaptation=none,mtf", cwd=tmp_path)
    assert done.returncode == 1
    assert "the results of 2 of 2 combinations are missing in results/adhoc/cells" in done.stderr


def test_a_sweep_names_skips_and_counts_a_recording_that_cannot_be_used(tmp_path):
    table = "t,e,n,u\n" + "".join(f"{0.2 * k:.1f},{k},0,0\n" for k in range(100))
    for name in ("good", "short"):
        (tmp_path / name).mkdir()
    (tmp_path / "good" / "fix.csv").write_text(table)
    words = [
        *("dataset=table", "dataset.position_file=fix.csv", "dataset.position_time=t", "dataset.epoch=none"),
        *("dataset.position_columns=[e,n,u]", "dataset.position_frame=enu", "dataset.imu_file=''", "figures=none"),
        *("disturbance=withhold", "workers=1", "filter=gnss_only,constant_velocity"),
    ]
    done = verb("run", "-m", *words, "dataset.folder=short,good,nowhere", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    left_out = [line for line in done.stderr.splitlines() if line.startswith("Left out 2 combinations: the recording ")]
    assert len(left_out) == 2
    assert "There is no file short/fix.csv" in left_out[0]
    assert "There is no folder nowhere" in left_out[1]
    assert (tmp_path / "results" / "adhoc" / "rows.csv").read_text().count(",ok,") == 8

    done = verb("run", "-m", *words, "dataset.folder=short,nowhere", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
