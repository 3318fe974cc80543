"""The way of a method into a suite: from its parts to its entry."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pandas as pd

from jerkbench.files import cache_folder
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.suite.campaign import ENTRY, PLAIN, ScoredEntrant, SuiteCampaign, plugins_digest, scored_plain
from jerkbench.suite.entry import Settings, write_entry
from jerkbench.suite.protocol import FROZEN, SuiteProtocol, read_suite, require_recordings
from jerkbench.suite.scores import entry_scoring, score_as_json
from jerkbench.tuning.entrant import Entrant, Site, knobs_of


def enter(scale: str, entrant: Entrant, name: str, place: Site, command: str) -> str:
    """Tune and score an entrant, and write its entry to the folder of ``place``; returns its page.

    Runs that are stored there are not done again; those of the plain filter are kept in the cache, for every entry.

    Args:
        scale: name of the suite.
        entrant: the method.
        name: what the board calls it.
        place: where.
        command: what was typed.

    Raises:
        JerkbenchError: it cannot be made or does not fit, or the suite is not the frozen one.
    """
    protocol = read_suite(scale)
    campaign = SuiteCampaign(entrant, protocol, replace(place, folder=place.folder / "runs"), name)
    require_recordings(scale, protocol)
    levels, plain = scored_plain(protocol, replace(place, folder=plain_folder(protocol)))
    scored = campaign.scored(levels)
    rows = _joined(scored, plain)
    page = entry_scoring(protocol).page(name, rows)
    manifest = {
        "entry": name,
        **frozen_part(scale, protocol),
        "method": entrant.parts,
        "tuned": bool(campaign.space.knobs),
        "command": command,
        "code": code_digest(),
        "plugins": plugins_digest(entrant, protocol),
        "git_commit": git_commit(),
        "versions": versions(),
        "score": score_as_json(rows, protocol),
    }
    write_entry(place.folder, manifest, rows, _settings(entrant, scored, plain, protocol), page)
    return page


def plain_folder(protocol: SuiteProtocol) -> Path:
    """Return where the runs of the plain filter are kept for every entry."""
    return cache_folder("suite") / f"{protocol.name}-rows"


def frozen_part(scale: str, protocol: SuiteProtocol) -> dict[str, object]:
    """Return what the manifest of each entry of a suite has to say."""
    return {"suite": scale, "protocol": protocol.digest, "data": list(FROZEN[scale].data)}


def _joined(scored: ScoredEntrant, plain: ScoredEntrant) -> pd.DataFrame:
    parts = [tested.rows.assign(method=method) for method, tested in ((ENTRY, scored), (PLAIN, plain))]
    return pd.concat(parts, ignore_index=True)


def _settings(entrant: Entrant, scored: ScoredEntrant, plain: ScoredEntrant, protocol: SuiteProtocol) -> Settings:
    """The settings with the names of their knobs."""
    both = ((ENTRY, entrant, scored), (PLAIN, protocol.plain_entrant, plain))
    first, limits = protocol.scenarios[0], protocol.limits
    return {method: _named(knobs_of(own.job(first, limits)).names, tested.settings) for method, own, tested in both}


def _named(names: tuple[str, ...], settings: Mapping[str, tuple[float, ...]]) -> dict[str, dict[str, float]]:
    return {tuned_on: dict(zip(names, setting, strict=True)) for tuned_on, setting in settings.items()}
