from jerkbench import plugins
from jerkbench.audit.protocol import read_protocol
from jerkbench.campaigns.entrant import Entrant
from jerkbench.campaigns.protocol import HALVES


def test_every_scenario_of_the_committed_protocols_can_be_built():
    for scale in ("full", "small"):
        protocol = read_protocol(scale)
        for scenario in protocol.scenarios:
            cell = Entrant.named(protocol.filters[0], protocol.plain).job(scenario)
            assert cell.scenario.seeded


def test_each_family_stands_in_one_half_and_the_halves_have_the_same_number_of_scenarios():
    protocol = read_protocol("full")
    counts = {half: sum(len(f.severities) for f in protocol.families if f.half == half) for half in HALVES}
    assert abs(counts["first"] - counts["second"]) <= 3


def test_the_digest_changes_with_anything_in_it():
    import dataclasses

    protocol = read_protocol("full")
    others = [
        dataclasses.replace(protocol, test_seeds=protocol.test_seeds + 1),
        dataclasses.replace(protocol, filters=protocol.filters[1:]),
        dataclasses.replace(protocol, families=protocol.families[::-1]),
    ]
    assert len({protocol.digest, *(other.digest for other in others)}) == 4
    assert read_protocol("full").digest == protocol.digest


def test_all_adaptations_are_compared_but_the_references():
    protocol = read_protocol("full")
    own = {name for name in plugins.names("adaptation") if plugins.is_own(plugins.get("adaptation", name))}
    assert set(protocol.compared) == own - {"oracle"}
    assert protocol.compared[0] == "none"
