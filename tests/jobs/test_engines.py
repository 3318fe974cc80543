"""The page on clusters: its sweep on each engine of this machine has the same rows, to the byte, in planned order."""

import re
import shlex

import pytest

import pages
from commands import swept
from jerkbench.errors import PluginError
from jerkbench.hydra_app.overrides import arranged_words
from jerkbench.jobs.executors import ClusterError, required
from jerkbench.presets import config_folder, preset_names

PAGE = pages.text("cluster")


def words(cluster):
    """The words of the page's sweep on a cluster of this machine, in small."""
    line = re.search(rf"^jerkbench run -m (.* cluster={cluster})$", PAGE, flags=re.MULTILINE)[1]
    return [*shlex.split(line), "workers=2"]


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    folder = tmp_path_factory.mktemp("local")
    swept(*words("local"), cwd=folder)
    return (folder / "results/adhoc/rows.csv").read_bytes()


def test_the_rows_are_those_of_the_own_pool(expected, tmp_path):
    pytest.importorskip("distributed")
    done = swept(*words("dask"), cwd=tmp_path)

    assert (tmp_path / "results/adhoc/rows.csv").read_bytes() == expected
    assert "4/4 cells" in done.stderr


def test_the_page_names_every_cluster_and_no_other():
    named = set(re.findall(r"cluster=(\w+)", PAGE)) | set(re.findall(r"`(pbs|lsf)`", PAGE))

    assert named == set(preset_names("cluster"))


def test_the_parameters_on_the_page_are_those_of_the_presets():
    presets = (config_folder() / "cluster").glob("*.yaml")
    known = {name for path in presets for name in re.findall(r"^(\w+):", path.read_text(), flags=re.MULTILINE)}

    assert set(re.findall(r"cluster\.(\w+)", PAGE)) <= known


def test_a_missing_extra_is_a_sentence_with_the_command():
    with pytest.raises(ClusterError) as caught:
        required("package_that_is_not_there", "slurm")

    assert str(caught.value) == (
        "cluster=slurm needs the package package_that_is_not_there, which is not installed: "
        "pip install 'jerkbench[dask]'."
    )


def test_a_sweep_has_one_cluster():
    with pytest.raises(PluginError, match="a sweep runs on one cluster; give one of dask, local"):
        arranged_words(["-m", "cluster=dask,slurm"])
