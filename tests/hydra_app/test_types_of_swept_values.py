"""Swept values have the types of the schema, as those of a single run have."""

import pytest

from commands import SHORT, verb
from jerkbench.cli.recordings import dataset_of


@pytest.mark.parametrize("words", [["first_seed=1,11"], ["dataset.duration_s=8.0,8.5", "adaptation=none,mtf"]])
def test_an_option_beside_swept_values_keeps_its_type(tmp_path, words):
    done = verb("run", "-m", *SHORT, "engine=filterpy", *words, "figures=false", "--dry", cwd=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "word", ["burn_in_s=1,abc", "seeds=1,1.5", "first_seed=true,1", "divergence_limit_m=1,x", "metrics=[all],3"]
)
def test_a_swept_value_of_another_type_is_refused(tmp_path, word):
    done = verb("run", "-m", *SHORT, word, "--dry", cwd=tmp_path)
    assert done.returncode == 2
    assert word.partition("=")[0] in done.stderr


@pytest.mark.parametrize("sign", [*",?*&%:[]{}@`'\"!#-~;| "])
def test_a_separator_may_be_any_sign(tmp_path, sign):
    assert dataset_of(str(tmp_path), "table", [f"separator={sign}"]).separator == sign
