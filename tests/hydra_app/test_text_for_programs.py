"""Words of a command reach the plugin as they were typed; Hydra's grammar has no opinion of them."""

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from jerkbench.hydra_app.composition import composed
from jerkbench.hydra_app.overrides import arranged_words


@pytest.mark.parametrize(
    "text",
    [
        "./mine {recording} {out}",
        "python mine.py --sigma=0.1,0.2 {recording} {out}",
        "sh -c 'cp a b' {recording}",
        "./mine(2) [x] {seed}",
    ],
)
def test_a_command_is_one_value_with_its_braces_and_quotation_marks(text):
    (word,) = arranged_words([f"filter.command={text}"])

    assert OverridesParser.create().parse_override(word).value() == text


def test_other_words_and_those_in_quotation_marks_stay_as_they_are():
    words = [
        "filter=command",
        "filter.time_limit_s=3",
        'filter.label="x y"',
        "filter.command=",
    ]

    assert arranged_words(words) == words


def test_the_words_of_run_describe_the_same_cell():
    words = composed(["dataset=field", "dataset.duration_s=30", "filter=command", "filter.command=sh {out}", "seeds=2"])
    cell = words.job(label="mine")

    assert cell.labels.dataset == "field(duration_s=30)"
    assert cell.labels.filter == "mine(program)"
    assert cell.spec["filter"]["command"] == "sh {out}"
    assert cell.draws == range(2)
