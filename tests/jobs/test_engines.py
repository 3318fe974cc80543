"""The page on clusters: its sweep gives the same rows on each cluster of this machine."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import pages
from commands import environment, swept
from jerkbench.errors import PluginError
from jerkbench.hydra_app.overrides import arranged_overrides
from jerkbench.jobs.executors import ClusterError, required
from jerkbench.presets import config_folder, preset_files

PAGE = pages.text("cluster")


def words(cluster):
    """The words of the page's sweep on a cluster of this machine, in small."""
    line = re.search(rf"^jerkbench run -m (.* cluster={cluster})$", PAGE, flags=re.MULTILINE)[1]
    return [*shlex.split(line), "workers=2", "dataset.duration_s=12", "seeds=1"]


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    folder = tmp_path_factory.mktemp("local")
    swept(*words("local"), cwd=folder)
    return (folder / "results/adhoc/rows.csv").read_bytes()


def test_the_rows_are_those_of_the_own_pool(expected, tmp_path):
    pytest.importorskip("distributed")
    done = swept(*words("dask"), cwd=tmp_path)

    assert (tmp_path / "results/adhoc/rows.csv").read_bytes() == expected
    assert "4/4 combinations" in done.stderr


def test_the_page_names_every_cluster_and_its_parameters_and_no_other():
    named = set(re.findall(r"cluster=(\w+)", PAGE))
    assert named == set(preset_files("cluster"))
    presets = (config_folder() / "cluster").glob("*.yaml")
    known = {name for path in presets for name in re.findall(r"^(\w+):", path.read_text(), flags=re.MULTILINE)}
    assert set(re.findall(r"cluster\.(\w+)", PAGE)) <= known


def test_a_missing_extra_and_two_clusters_are_sentences():
    with pytest.raises(ClusterError) as caught:
        required("package_that_is_not_there", "slurm")
    assert str(caught.value) == (
        "cluster=slurm needs the package package_that_is_not_there, which is not installed: "
        "pip install 'jerkbench[dask]'."
    )
    with pytest.raises(PluginError, match="a sweep runs on one cluster; give only one of dask, local"):
        arranged_overrides(["-m", "cluster=dask,slurm"])


FEW = "filter=gnss_only adaptation=none dataset.duration_s=12 figures=false study=paper"


@pytest.mark.slow
def test_the_tasks_of_the_array_are_one_study(tmp_path):
    """In small, and without SLURM, which says to each task which it is."""
    script = pages.files("cluster")["shards.sh"].replace("experiment=paper", FEW).replace("seeds=4", "seeds=2")
    (tmp_path / "shards.sh").write_text(script.replace("4 *", "2 *"), encoding="utf-8")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for task in ("1", "0"):
        variables = environment(PATH=path, SLURM_ARRAY_TASK_ID=task, SLURM_CPUS_PER_TASK="1")
        subprocess.run(["bash", "shards.sh"], cwd=tmp_path, env=variables, check=True, capture_output=True)
    (tmp_path / "whole").mkdir()
    swept(*FEW.split(), "seeds=4", cwd=tmp_path / "whole")

    shards, whole = ((folder / "results/paper/rows.csv").read_bytes() for folder in (tmp_path, tmp_path / "whole"))
    assert shards == whole
    assert whole.count(b"\n") == 5
