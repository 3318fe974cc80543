"""Comparisons in which the median run of one method is lost: a ratio of 0, or an infinite one."""

import math

import pytest

from jerkbench.evaluation.judgement import Verdict
from jerkbench.report.findings import ALL_LOST, certain_size, size_text


@pytest.mark.parametrize(
    ("verdict", "ratio", "word"), [(Verdict.BETTER, 0.0, "better"), (Verdict.WORSE, math.inf, "worse")]
)
def test_it_has_a_weight_and_words_without_a_size(judgement, verdict, ratio, word):
    lost = judgement(verdict, ratio, ratio, ratio, (0, 17))
    assert certain_size(lost) == ALL_LOST
    assert size_text(lost) == f"{word}, as the median run of the one is lost"


def test_one_end_that_is_lost_leaves_the_other_to_weigh_by(judgement):
    assert certain_size(judgement(Verdict.WORSE, 8.0, 2.0, math.inf, (6, 0))) == pytest.approx(math.log(2.0))
