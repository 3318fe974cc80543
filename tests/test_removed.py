"""Whoever types a word of earlier versions hears its successor, in one sentence, and nothing runs."""

import pytest
from omegaconf import OmegaConf

from jerkbench.errors import JerkbenchError
from jerkbench.hydra_app.configuration import cluster_named, study_folder
from jerkbench.renamed import refuse_removed, removed

TYPED = [
    (("run", "-m", "cluster=loky"), "cluster=local"),
    (("run", "-m", "cluster=dask,loky", "workers=2"), "cluster=local"),
    (("tune", "filter=baseline", "cluster=ray"), "cluster=dask"),
    (("run", "-m", "+cluster=ray", "cluster.address=head:6379"), "cluster=dask"),
    (("audit", "--scale", "small", "--cluster", "ray"), "cluster=dask"),
    (("suite", "run", "filter=baseline", "--cluster=loky"), "cluster=local"),
    (("run", "results=s3://bucket/folder"), "folders of this machine"),
    (("run", "results=memory://here"), "folders of this machine"),
    (("table", "s3://bucket/folder/study"), "folders of this machine"),
    (("report", "s3:/bucket/folder/study"), "folders of this machine"),
    (("compare", "gs://bucket/a:jerk+mtf", "results/b"), "folders of this machine"),
    (("audit", "--results", "gs://bucket"), "folders of this machine"),
    (("run", "-m", "portable=true"), "suite verify"),
    (("score", "portable=false"), "suite verify"),
    (("table", "results/a", "--format", "tex", "--fit"), "resizebox"),
    (("compare", "results/a", "results/b", "--tolerances", "rules.yaml"), "--fail-above PERCENT"),
    (("audit", "--stored", "--reweight", "faulty=0.05"), "experiments/audit/audit_page.py"),
    (("audit", "--attribution"), "what each step brings"),
    (("audit", "--scale", "attribution", "--stored"), "what each step brings"),
    (("audit", "attitude", "--settings", "3"), "filter=attitude_only"),
    (("completion", "bash"), "argcomplete"),
    (("pack", "results/first"), "into one file"),
    (("run", "-m", "tags=[thesis]"), "study=NAME"),
    (("table", "results/a", "--tag", "thesis"), "study=NAME"),
    (("run", "-m", "filter=eskf15,fgo"), "examples/fgo"),
    (("run", "filter=eskf15", "filter.misalignment_mrad=1"), "turn-on biases"),
    (("suite", "run", "filter=jerk", "--scale", "v1"), "--scale v2"),
    (("suite", "run", "attitude=vqf", "--scale=attitude-v1"), "filter=attitude_only"),
]


@pytest.mark.parametrize(("words", "successor"), TYPED)
def test_a_removed_word_is_one_sentence_with_its_successor(typed, tmp_path, words, successor):
    done = typed(*words)

    assert done.returncode == 2
    assert successor in done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []


def test_every_removed_word_is_typed_here():
    refused = set()
    for words, _ in TYPED:
        with pytest.raises(JerkbenchError) as caught:
            refuse_removed(words)
        refused.add(str(caught.value))

    assert refused == set(removed().values())


def test_a_configuration_hears_the_same():
    with pytest.raises(JerkbenchError, match="cluster=dask"):
        cluster_named("ray")
    with pytest.raises(JerkbenchError, match="folders of this machine"):
        study_folder(OmegaConf.create({"results": "s3://bucket/folder", "study": "mine"}))


@pytest.mark.parametrize(
    "words",
    [
        ("run", "cluster=local", "study=ray", "notes=[cluster=ray on Monday]"),
        ("table", "results/s3", "--filter", "ray"),
        ("table", "results/array", "--metric", "portable"),
        ("run", "dataset=table", "dataset.file=https://host/a.csv", "results=/tmp/s3"),
    ],
)
def test_words_that_only_look_like_removed_ones_are_left_alone(words):
    refuse_removed(words)
