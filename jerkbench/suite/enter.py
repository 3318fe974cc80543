"""The way of a method into a suite: from its parts to its entry."""

from dataclasses import replace
from pathlib import Path

import pandas as pd

from jerkbench.files import cache_folder
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.suite.campaign import ENTRY, PLAIN, SuiteCampaign, plugins_digest, scored_plain
from jerkbench.suite.entry import write_entry
from jerkbench.suite.protocol import FROZEN, SuiteProtocol, read_suite, require_recordings
from jerkbench.suite.scores import entry_scoring, score_as_json
from jerkbench.tuning.entrant import Entrant, Site


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
    both = {ENTRY: scored, PLAIN: plain}
    rows = pd.concat([own.rows.assign(method=method) for method, own in both.items()], ignore_index=True)
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
    write_entry(place.folder, manifest, rows, {method: own.settings for method, own in both.items()}, page)
    return page


def plain_folder(protocol: SuiteProtocol) -> Path:
    """Return where the runs of the plain filter are kept for every entry."""
    return cache_folder("suite") / f"{protocol.name}-rows"


def frozen_part(scale: str, protocol: SuiteProtocol) -> dict[str, object]:
    """Return what the manifest of each entry of a suite has to say."""
    return {"suite": scale, "protocol": protocol.digest, "data": list(FROZEN[scale].data)}
