"""The command line, as a person uses it."""

import signal
import subprocess
import sys
import time

import pandas as pd
import pytest
from omegaconf.errors import ConfigAttributeError

from commands import SHORT, environment, jerkbench, swept, verb
from jerkbench.cli import main
from jerkbench.jobs.store import Store
from stored_cells import drop, keys_of

CELLS = ["filter=baseline,jerk,gnss_only", "adaptation=none,mtf"]


def rows_of(folder):
    return pd.read_csv(folder / "rows.csv")


def test_help_and_catalogue_answer(tmp_path):
    assert "COMMAND" in jerkbench("--help", cwd=tmp_path).stdout
    helped = verb("run", "--help", cwd=tmp_path).stdout
    assert "experiment=paper" in helped
    assert "disturbance.gnss_outage.windows_s=[[50,60]]" in helped
    shown = verb("show", "disturbance", "gnss_outage", cwd=tmp_path).stdout
    assert "On the command line: disturbance=gnss_outage disturbance.gnss_outage.windows_s=..." in shown
    listed = verb("list", cwd=tmp_path).stdout
    assert all(name in listed for name in ("field_ruts", "gnss_outage", "sage_husa", "baseline_untuned", "paper"))
    shown = verb("show", "adaptation", "mtf", cwd=tmp_path).stdout
    assert all(word in shown for word in ("y'y >= sum h + sum r", "window  = 1", "Source:", "[updates]"))
    assert "0.02 # m/s2" in verb("show", "filter", "baseline_untuned", cwd=tmp_path).stdout


def test_a_single_run_prints_its_metrics_and_draws_two_figures(tmp_path):
    words = [word for word in SHORT if not word.startswith("figures")]
    done = verb("run", *words, "filter=jerk", "adaptation=mtf", cwd=tmp_path)
    study = tmp_path / "results" / "adhoc"

    assert done.returncode == 0
    assert "Position RMSE (3-D) [m]" in done.stdout
    drawn = sorted(path.name.rsplit("-", 1)[1] for path in (study / "figures").iterdir())
    assert drawn == ["errors.png", "trajectory.png"]
    (row,) = rows_of(study).to_dict("records")
    assert (row["filter"], row["adaptation"], row["seed"], row["status"]) == ("jerk", "mtf", 0, "ok")
    assert 0.001 < row["position_rmse_m"] < 0.1


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep")
    return folder / "results" / "adhoc", swept(*CELLS, "disturbance=none,[imu_bias,gnss_outage]", cwd=folder)


def test_a_sweep_leaves_rows_tables_and_a_manifest(sweep):
    study, done = sweep
    rows = rows_of(study)

    assert len(rows) == 2 * 5  # gnss_only takes no mtf
    left_out = "Left out 2 combinations: the filter gnss_only does not support adaptation=mtf; supported: none."
    assert left_out in done.stderr
    assert list(rows.columns[:9]) == [
        *("dataset", "disturbance", "attitude", "filter", "adaptation", "noise", "seed", "replicate", "status")
    ]
    assert set(rows["disturbance"]) == {"none", "imu_bias+gnss_outage"}
    for name in ("table.md", "table.csv", "table.tex", "manifest.json"):
        assert (study / name).stat().st_size > 0
    assert "Position RMSE (3-D) [m]" in done.stdout
    assert "simulated truth; independent of the measurements" in (study / "table.md").read_text(encoding="utf-8")


def test_a_sweep_goes_on_where_it_was_and_gives_the_same_rows(sweep):
    study, _ = sweep
    before = rows_of(study)
    store = Store(study)
    drop(store, keys_of(study)[:1])
    again = swept(*CELLS, "disturbance=none,[imu_bias,gnss_outage]", cwd=study.parents[1])

    assert "9 of 10 combinations are already complete" in again.stderr
    pd.testing.assert_frame_equal(rows_of(study), before, check_exact=True)


def test_the_table_can_be_arranged_otherwise_with_ratios_and_findings(sweep, tmp_path):
    study, _ = sweep
    arranged = ["--rows", "adaptation", "--columns", "filter,disturbance", "--format", "md"]
    done = verb("table", str(study), "--metric", "velocity_rmse_mps", *arranged, cwd=study)
    assert done.returncode == 0
    assert "Velocity RMSE" in done.stdout
    assert "| mtf" in done.stdout
    for path in (study / "cells").glob("*.parquet"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    done = verb("table", str(tmp_path), "--baseline", "adaptation=none", "--format", "html", cwd=tmp_path)
    assert '<span class="factor">' in done.stdout
    said = verb("table", str(study), "--findings", cwd=tmp_path).stdout
    assert "Each comparison uses" in said
    wrong = verb("table", str(study), "--baseline", "adaptation=nome", cwd=tmp_path)
    assert wrong.returncode == 2
    assert "Did you mean 'none'?" in wrong.stderr


@pytest.mark.slow
def test_two_workers_give_the_rows_of_one(sweep):
    study, _ = sweep
    swept(*CELLS, "disturbance=none,[imu_bias,gnss_outage]", "workers=2", "study=two", cwd=study.parents[1])

    pd.testing.assert_frame_equal(rows_of(study.parent / "two"), rows_of(study), check_exact=True)


@pytest.mark.slow
def test_hydras_own_sweeper_gives_the_same_rows(sweep):
    study, _ = sweep
    words = ["filter=baseline,jerk", "adaptation=mtf", "disturbance=none,[imu_bias,gnss_outage]"]
    swept(*words, "hydra/sweeper=basic", "study=basic", cwd=study.parents[1])
    basic, builtin = rows_of(study.parent / "basic"), rows_of(study)
    builtin = builtin[builtin["adaptation"] == "mtf"]
    columns = list(basic.columns[:8])

    pd.testing.assert_frame_equal(*(rows.sort_values(columns, ignore_index=True) for rows in (basic, builtin)))


def test_swept_parameters_are_in_the_labels(tmp_path):
    swept("noise.accel_mps2=0.1,0.2", "filter=baseline,gnss_only", cwd=tmp_path)
    rows = rows_of(tmp_path / "results" / "adhoc")

    assert list(zip(rows["filter"], rows["noise"], strict=True)) == [
        ("baseline", "accel_mps2=0.1"),
        ("gnss_only", "default"),  # once: it has no such parameter
        ("baseline", "accel_mps2=0.2"),
    ]


@pytest.mark.parametrize("windows", [["[[6,8]]"], ["[[6,8]]", "[[6,9]]"]])
def test_a_disturbance_with_parameters_is_swept_beside_none(tmp_path, windows):
    swept("disturbance=none,gnss_outage", f"disturbance.gnss_outage.windows_s={','.join(windows)}", cwd=tmp_path)
    labels = [f"gnss_outage(windows_s={each})" for each in windows]

    assert list(rows_of(tmp_path / "results" / "adhoc")["disturbance"]) == ["none", *labels]


@pytest.fixture
def refused(tmp_path, monkeypatch):
    """Types what cannot run: returns the sentence."""
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    monkeypatch.setenv("JERKBENCH_DATA", str(tmp_path / "fetched"))

    def run(*words):
        done = verb(*words, cwd=tmp_path)
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
        assert done.stderr.startswith("jerkbench: ")
        return done.stderr

    return run


BAD = [
    (["filter=jrk"], "There is no filter 'jrk'. Did you mean 'jerk'?"),
    (["disturbance=[imu_bias,gnss_outag]"], "Did you mean 'gnss_outage'?"),
    (["sedds=3"], "There is no option 'sedds'. Did you mean 'seeds'?"),
    (["filter.acel_mps2=3"], "Did you mean 'filter.accel_mps2'?"),
    (["noise.accel_mps2=much"], "noise.accel_mps2: Value 'much'"),
    (["seeds=many"], "seeds: Value 'many'"),
    (["seeds=0"], "seeds is 0; give 1 to 100000."),
    (["adaptation=mtf", "adaptation.window=0"], "mtf: window is 0"),
    (["metrics=[position_rms]"], "Did you mean 'position_rmse'?"),
    (["dataset=rtklib"], "run `jerkbench data fetch rtklib_drive_0708`, or give dataset.folder=FOLDER"),
    (["dataset=rtklib", "dataset.folder=nowhere"], "nowhere"),
    (["dataset=rtklib", "dataset.folder=."], "."),
    (["filter==jerk"], "="),
    (["jerk"], "'jerk' cannot be read; give KEY=VALUE"),
    (["adaptation=[mtf,none]"], "adaptation accepts one value; for a sweep give -m adaptation=A,B."),
    (
        ["disturbance=[imu_bias,{name:gnss_outage,windows_s:[[50,60]]}]"],
        "give parameters separately: disturbance.NAME.PARAMETER=VALUE.",
    ),
    (["filter={name:jerk,accel_mps2:0.3}"], "give parameters separately: filter.PARAMETER=VALUE."),
    (["disturbance=gnss_outage", "disturbance.windows_s=[[50,60]]"], "Available: disturbance.gnss_outage."),
    (["disturbance=imu_bias", "disturbance.gnss_outage.length_s=3"], "disturbance.gnss_outage"),
    (["adaptation.window=5"], "There is no option 'adaptation.window'"),
    (["workers=-3"], "workers is -3; give 0 (one for each processor) or more."),
    (["study=../x"], "study is '../x'; give the name of a single folder"),
    (["study=a/b"], "study is 'a/b'; give the name of a single folder"),
    (["study=.."], "study is '..'; give the name of a single folder"),
    (["filter.accel_mps2=-1"], "filter baseline: accel_mps2 is -1.0; it must be zero or positive, and finite."),
    (["seeds=???"], "seeds"),
    (["first_seed=99999999999999999999"], "first_seed"),
    (["seeds=100001"], "give 1 to 100000."),
    ([f"study={'x' * 300}"], "File name too long"),
    (["disturbance=[]"], "disturbance accepts only names"),
    (["disturbance=[null]"], "disturbance accepts only names"),
    (["filter=3"], "filter accepts only names"),
    (["~seeds"], "options cannot be removed"),
    (["metrics=${seeds}"], "give a list of names"),
    (["metrics=[[all]]"], "give a list of names"),
    (["=1"], "'=1' cannot be read"),
    (["--resolve"], "--resolve works only with --cfg"),
    (["--nonsense"], "--nonsense"),
    (["--info=nonsense"], "invalid choice"),
    (["hydra/launcher=joblib"], "There is no hydra/launcher 'joblib'"),
    (["results=/proc/x"], "/proc/x"),
    (["dataset.duration_s=43200", "dataset.imu_rate_hz=200", "dataset.reference_rate_hz=200"], "8.64e+06 samples"),
    (["dataset.sensor_rate_hz=1e9"], "sensor_rate_hz is 1000000000.0"),
    (["dataset.pass_s=1e-6", "dataset.turn_s=1e-6", "dataset.speed_change_s=1e-8"], "needs too much memory"),
    (["++r_scale=inf"], "r_scale is inf; give two factors"),
    (["noise.accel_mps2=nan"], "filter baseline: accel_mps2 is nan; it must be zero or positive, and finite."),
]


@pytest.mark.parametrize(
    ("place", "words", "said"), [(k, *bad) for k, bad in enumerate(BAD)], ids=[" ".join(words) for words, _ in BAD]
)
def test_bad_input_is_one_sentence_and_leaves_no_result(tmp_path, refused, place, words, said):
    """Of a single run and of a sweep in turn: both compose most of their configuration by the same functions."""
    assert said in refused("run", *([] if place % 2 else ["-m"]), *words)
    assert not list(tmp_path.rglob("*.parquet"))
    assert not list(tmp_path.rglob("rows.csv"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["run", "hydra.run.dir=/proc/x"], "/proc/x"),
        (["run", "--shell-completion"], "--shell-completion is not supported"),
        (["run", "--experimental-rerun", "gone"], "jerkbench rerun DIR ROW"),
        (["run", "--cfg", "job", "--info"], "--cfg and --info cannot be combined"),
        (["run", "seeds=2", "-m", "filter=jrk"], "There is no filter 'jrk'"),
        (
            ["run", "filter=jerk,bias"],
            "filter=jerk,bias has several values; add -m to run each value, or write a list in",
        ),
        (["run", "filter=gnss_only", "adaptation=mtf"], "does not support adaptation=mtf"),
        *(
            (["run", "-m", "adaptation=mtf,none,chi2", f"adaptation.{name}=5"], f"plugins, give adaptation.NAME.{name}")
            for name in ("window", "threshold")
        ),
        (["table", "results/nothing"], "results/nothing has no results"),
    ],
)
def test_what_makes_no_sense_is_a_sentence(refused, words, said):
    assert said in refused(*words)


@pytest.mark.parametrize(
    ("group", "text", "said"),
    [
        ("disturbance", "name: gnss_outage\nwindows_s: [[5,6]]\n", "'# @package disturbance'"),
        ("disturbance", "gnss_outage:\n  windows_s: [[5,6]]\n", "list the plugins in its defaults"),
        ("disturbance", "{}\n", "No disturbance is chosen"),
        ("experiment", "study: mine\n", "must be '# @package _global_'"),
        ("experiment", "# @package _global_\nseeds: 0\n", "seeds is 0"),
    ],
)
@pytest.mark.parametrize("multirun", [[], ["-m"]])
def test_a_preset_of_ones_own_that_cannot_be_is_a_sentence(refused, tmp_path, group, text, said, multirun):
    own = tmp_path / "own" / group / "mine.yaml"
    own.parent.mkdir(parents=True)
    own.write_text(text)

    assert said in refused("run", *multirun, "--config-dir", str(tmp_path / "own"), f"{group}=mine")


def test_sigterm_while_a_sweep_is_planned_ends_with_a_sentence(tmp_path):
    words = ["run", "-m", "noise.accel_mps2=range(1,90001)"]
    command = [sys.executable, "-m", "jerkbench", *words]
    with subprocess.Popen(command, cwd=tmp_path, env=environment(), stderr=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 120
        while not (tmp_path / "results" / "adhoc" / "multirun.yaml").exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(0.2)
        process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=300)

    assert (process.returncode, err) == (130, "jerkbench: interrupted.\n")


@pytest.mark.parametrize("error", [ConfigAttributeError, AttributeError])  # OmegaConf raises both
@pytest.mark.parametrize(
    ("words", "place"), [("run", "app.prepared_app"), ("run -m dataset=field,field_white", "app.compose_jobs")]
)
def test_an_interrupt_that_a_library_turns_into_its_own_error_is_one_all_the_same(
    words, place, error, tmp_path, monkeypatch, capsys
):
    def composing(*_):
        try:
            raise KeyboardInterrupt
        finally:
            raise error("Missing key _flags_cache")  # as OmegaConf, tidying up what it had half made

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(f"jerkbench.hydra_app.{place}", composing)
    with pytest.raises(SystemExit) as end:
        main(words.split())
    assert (end.value.code, capsys.readouterr().err) == (130, "jerkbench: interrupted.\n")


def test_a_refused_study_leaves_no_folder(tmp_path, refused):
    folder = tmp_path / "results" / "inside"
    folder.mkdir(parents=True)
    refused("run", "-m", "results=results/inside", "study=../x")

    assert [path.name for path in (tmp_path / "results").iterdir()] == ["inside"]


PAUSING = """
import signal, sys
from jerkbench.cli import main
from jerkbench.jobs import run

def pausing(writer, *task, add=run.Writer.add, count=[0]):
    add(writer, *task)
    count[0] += 1
    if count[0] > 3:
        signal.pause()  # until Ctrl-C, however slow its sender is

run.Writer.add = pausing
run.MAX_FLUSH_S = 0.0
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background is born deaf to Ctrl-C
main(sys.argv[1:])
"""


LOADING = """
import sys
from jerkbench.cli import main

try:
    main(sys.argv[1:])
finally:
    print(*sys.modules)
"""


def loaded_by(*words, cwd):
    """What a command prints, and the modules that it has loaded."""
    words = [sys.executable, "-c", LOADING, *words]
    done = subprocess.run(words, cwd=cwd, env=environment(), capture_output=True, text=True, check=True, timeout=300)
    *lines, modules = done.stdout.splitlines()
    return lines, set(modules.split())


def test_what_only_lists_does_not_wait_for_numba(tmp_path):
    """Nor for what else takes long to import: half of a second for each look is too long."""
    lines, modules = loaded_by("list", cwd=tmp_path)

    assert any("maximum_correntropy" in line for line in lines)
    assert modules.isdisjoint({"numba", "filterpy", "matplotlib", "rosbags"})


@pytest.mark.slow
@pytest.mark.parametrize("multirun", [[], ["-m"]], ids=["single", "sweep"])
def test_a_run_does_not_wait_for_what_it_does_not_use(tmp_path, multirun):
    lines, modules = loaded_by("run", *multirun, "seeds=2", "figures=false", "dataset.duration_s=20", cwd=tmp_path)

    assert any("Position RMSE" in line for line in lines)
    unused = {"filterpy", "matplotlib", "rosbags", "scipy.interpolate", "scipy.ndimage", "scipy.stats"}
    assert modules.isdisjoint(unused)


@pytest.mark.slow
def test_an_interrupted_sweep_ends_with_its_table_and_goes_on(tmp_path):
    swept_values = ",".join(str(value / 12) for value in range(1, 13))
    quick = ["seeds=2", "figures=false", "workers=1", "dataset.duration_s=12", "engine=filterpy"]  # a call for each run
    words = ["run", "-m", *quick, f"noise.accel_mps2={swept_values}"]
    command = [sys.executable, "-c", PAUSING, *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, cwd=tmp_path, env=environment(), **pipes)
    cells = tmp_path / "results" / "adhoc" / "cells"
    while process.poll() is None and len(list(cells.glob("*.parquet"))) < 4:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=300)

    assert process.returncode == 130, err
    assert "the same command continues the sweep" in err
    assert "Traceback" not in err
    assert "Position RMSE" in out
    done = len(Store(cells.parent).read(shown={})[0])
    assert done == 2  # of four runs; the last was stored before it was counted
    assert len(list(cells.iterdir())) == 1
    again = verb(*words, cwd=tmp_path)
    assert f"{done} of 12 combinations are already complete" in again.stderr
    assert len(rows_of(cells.parent)) == 24


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["filter=eskf15", "filter.wheel_scale=true"], "eskf15.wheel_scale needs a wheel speed"),
        (
            ["filter=gnss_only", "adaptation=mtf,iae"],
            "There is nothing to run, because every combination was left out.",
        ),
        (["filter=jerk,bias", "--cfg", "job"], "--cfg shows the configuration of a single run; leave out -m"),
    ],
    ids=["an input is missing", "nothing is left", "a configuration of many"],
)
def test_a_sweep_that_cannot_be_says_so_before_anything_runs(tmp_path, words, said):
    done = verb("run", "-m", *words, cwd=tmp_path)

    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr.splitlines()[-1]
    assert not list(tmp_path.rglob("*.parquet"))
