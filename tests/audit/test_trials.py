"""The trials that a scenario needs, by hand."""

from jerkbench.audit.methods import AuditMethod
from jerkbench.audit.stages import Search, needed_trials

from jerkbench.audit.protocol import read_protocol
from jerkbench.campaigns.search import ALL, seen, unseen

MTF, PLAIN = AuditMethod("baseline", "mtf"), AuditMethod("baseline", "none")
KNOWN = list(read_protocol("small").scenarios)
TRIALS = {Search(MTF, "first", 0): [3, 1], Search(MTF, "second", 0): [2], Search(MTF, ALL, 0): [5]}
EXPECTED = {
    seen: {"first": (0, 1, 3, 5), "second": (0, 2, 5), "both": (0, 1, 2, 3, 5)},
    unseen: {"first": (0, 2, 5), "second": (0, 1, 3, 5), "both": (0, 1, 2, 3, 5)},
}


def test_a_scenario_needs_the_settings_of_the_searches_that_it_belongs_to():
    for looked_at, expected in EXPECTED.items():
        needed = needed_trials(TRIALS, [MTF, PLAIN], KNOWN, looked_at)
        assert [trials[MTF] for trials in needed] == [expected[scenario.half] for scenario in KNOWN]
        assert {trials[PLAIN] for trials in needed} == {(0,)}
