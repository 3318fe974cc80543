"""Presets of a --config-dir that somebody else wrote cannot write files or create objects through Hydra."""

import pytest

from commands import SHORT, verb

GLOBAL = "# @package _global_\n"
HANDLERS = (
    "{version: 1, handlers: {f: {class: logging.FileHandler, filename: thesis.tex, mode: w}}, root: {handlers: [f]}}"
)
MINE = "experiment/mine.yaml"
HOSTILE = {
    "logging": {MINE: f"{GLOBAL}hydra: {{job_logging: {HANDLERS}}}"},
    "logging of Hydra": {MINE: f"{GLOBAL}hydra: {{hydra_logging: {HANDLERS}}}"},
    "package": {MINE: f"# @package hydra.job_logging\n{HANDLERS}"},
    "package that ends in hydra": {MINE: f"# @package _global_Xhydra.job_logging\n{HANDLERS}"},
    "package in brackets": {MINE: f"# @package [hydra][job_logging]\n{HANDLERS}"},
    "package in the defaults": {
        MINE: f"{GLOBAL}defaults: ['/noise/mine@_global_.hydra.job_logging', _self_]",
        "noise/mine.yaml": HANDLERS,
    },
    "group of Hydra": {
        MINE: f"{GLOBAL}defaults: [override /hydra/job_logging: mine]",
        "hydra/job_logging/mine.yaml": HANDLERS,
    },
    "default group of Hydra": {MINE: f"{GLOBAL}defaults: [override /hydra/job_logging: default]"},
    "launcher": {MINE: f"{GLOBAL}hydra: {{launcher: {{_target_: pathlib.Path}}}}"},
    "sweeper": {MINE: f"{GLOBAL}hydra: {{sweeper: {{_target_: pathlib.Path, params: {{seeds: 1}}}}}}"},
    "callbacks": {MINE: f"{GLOBAL}hydra: {{callbacks: {{mine: {{_target_: pathlib.Path}}}}}}"},
    "folder": {MINE: f"{GLOBAL}hydra: {{run: {{dir: written}}, sweep: {{dir: written}}, output_subdir: written}}"},
    "environment": {MINE: f"{GLOBAL}hydra: {{job: {{env_set: {{PATH: /}}, chdir: true}}}}"},
    "interpolation": {MINE: f"{GLOBAL}hydra: ${{noise}}\n"},
    "parameter of a sweep": {MINE: f"{GLOBAL}hydra: {{sweeper: {{params: {{+hydra.job_logging.version: 1}}}}}}"},
    "data set": {
        MINE: f"{GLOBAL}defaults: [override /dataset: mine]",
        "dataset/mine.yaml": f"{GLOBAL}hydra: {{mode: RUN}}",
    },
    "cluster": {MINE: f"{GLOBAL}cluster: {{_target_: pathlib.Path}}"},
    "cluster in text": {MINE: GLOBAL + "cluster: \"${oc.create:'{_target_: pathlib.Path}'}\"\n"},
}


def attacked(folder, files, *words):
    """Run a command with the presets ``files``; returns what it printed about the error."""
    (folder / "thesis.tex").write_text("precious")
    for name, text in files.items():
        (folder / "presets" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "presets" / name).write_text(text + "\n")
    done = verb(*words, "--config-dir", "presets", cwd=folder)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert {path.name for path in folder.iterdir()} <= {"presets", "thesis.tex", "results"}
    assert (folder / "thesis.tex").read_text() == "precious"
    return done.stderr


@pytest.mark.parametrize("multirun", [[], ["-m"]], ids=["run", "sweep"])
@pytest.mark.parametrize("kind", HOSTILE)
def test_a_preset_that_configures_hydra_is_refused(tmp_path, kind, multirun):
    said = attacked(tmp_path, HOSTILE[kind], "run", *multirun, "--dry", *SHORT, "experiment=mine")
    assert "class of the cluster" in said if "cluster" in kind else "mine.yaml" in said and "command line" in said


@pytest.mark.parametrize("words", [["tune", "trials=2"], ["data", "export", "out"], ["run", "--cfg", "all"]])
def test_every_command_that_composes_refuses_it(tmp_path, words):
    assert "mine.yaml" in attacked(tmp_path, HOSTILE["logging"], *words, "experiment=mine")


@pytest.mark.parametrize("words", [["audit", "--scale", "small"], ["suite", "run", "filter=jerk"]])
def test_a_cluster_of_a_stranger_is_not_created(tmp_path, words):
    files = {"cluster/mine.yaml": "_target_: pathlib.Path"}
    assert "class of the cluster" in attacked(tmp_path, files, *words, "--cluster", "mine")


@pytest.mark.parametrize("option", ["--config-path", "--config-name"])
def test_the_configuration_itself_is_not_replaced(tmp_path, option):
    assert option in attacked(tmp_path, {"config.yaml": "study: x"}, "run", "--dry", option, "presets", *SHORT)


def test_a_folder_cannot_be_named_past_the_check(tmp_path):
    words = ["run", "--dry", *SHORT, "experiment=mine", "hydra.searchpath=[file://presets]"]
    assert "mine.yaml" in attacked(tmp_path, HOSTILE["logging"], *words)


def test_values_of_a_sweep_are_taken_from_a_preset(tmp_path):
    mine = tmp_path / "presets" / MINE
    mine.parent.mkdir(parents=True)
    mine.write_text(f"{GLOBAL}hydra: {{sweeper: {{params: {{filter: 'jerk,bias'}}}}}}\n")
    done = verb("run", "-m", "--dry", *SHORT, "experiment=mine", "--config-dir", "presets", cwd=tmp_path)
    assert "2 combinations" in done.stdout, done.stderr
