"""The digests of the recordings that a suite simulates: whether they are those on which the others were scored."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray
from jerkbench.campaigns.entrant import Entrant, knobs_of
from jerkbench.campaigns.site import Site
from jerkbench.errors import RecordingError
from jerkbench.files import cache_folder
from jerkbench.jobs.inputs import Inputs
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.recording import Recording
from jerkbench.suite.campaign import ENTRY, PLAIN, ScoredEntrant, SuiteCampaign, plugins_digest, scored_plain
from jerkbench.suite.entry import Settings, plain_score, write_entry
from jerkbench.suite.protocol import FROZEN, SuiteProtocol, read_suite
from jerkbench.suite.scores import entry_page, entry_score

STRETCHES = 16
"""Each array is cut into so many; what is hashed is mean and mean square of each."""
STEP = 1e-4
"""They are rounded to this, in their SI unit: what the last bits of another processor do does not count."""


def require_recordings(scale: str, protocol: SuiteProtocol) -> None:
    """Require that the simulated recordings are the frozen ones.

    Raises:
        RecordingError: one is another.
    """
    for scenario, frozen, own in zip(protocol.scenarios, FROZEN[scale].data, data_digests(protocol), strict=True):
        if own != frozen:
            raise RecordingError(
                f"The recordings of {scenario.name} are not those of {protocol.name}: their digest is {own}, the frozen"
                f" one {frozen}. Other simulated data are another suite; use a version of jerkbench that makes these."
            )


def data_digests(protocol: SuiteProtocol) -> Iterator[str]:
    """Yield the digest of the recording of each scenario, for the first seed to test on."""
    plain, inputs, seed = protocol.plain_entrant, Inputs(), protocol.seeds_to_test_on[0]
    for scenario in protocol.scenarios:
        yield recording_digest(inputs.recording(plain.job(scenario, protocol.limits).scenario, seed))


def recording_digest(recording: Recording) -> str:
    """Return the first 8 digits of the SHA-256 of rounded means of all that it measures, and of its reference."""
    sha = hashlib.sha256()
    for array in _arrays(recording):
        stretches = np.array_split(np.nan_to_num(array), STRETCHES)
        means = np.array([(stretch.mean(axis=0), np.square(stretch).mean(axis=0)) for stretch in stretches])
        sha.update(f"{array.shape}".encode() + np.rint(means / STEP).astype("<i8").tobytes())
    return sha.hexdigest()[:8]


def _arrays(recording: Recording) -> Iterator[FloatArray]:
    imu, position, velocity, heading = recording.imu, recording.position, recording.velocity, recording.heading
    if imu is not None:
        yield from (imu.t_s, imu.accel_mps2, imu.gyro_radps)
    if position is not None:
        yield from (position.t_s, position.enu_m, position.covariance_m2)
    if velocity is not None:
        yield from (velocity.t_s, velocity.mps)
    if heading is not None:
        yield from (heading.t_s, heading.yaw_rad)
    for truth in (recording.reference.enu_m, recording.reference.velocity_mps):
        if truth is not None:
            yield truth


# The way of a method into a suite: from its parts to its entry.


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
    score = entry_score(rows, protocol)
    page = entry_page(name, score, rows, protocol)
    manifest = {
        "entry": name,
        **frozen_part(scale, protocol),
        "method": asdict(entrant),
        "tuned": bool(campaign.space.knobs),
        "command": command,
        "code": code_digest(),
        "plugins": plugins_digest(entrant, protocol),
        "git_commit": git_commit(),
        "versions": versions(),
        "score": plain_score(score),
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
    return {
        method: _named(knobs_of(own.job(first, limits).method).names, tested.settings) for method, own, tested in both
    }


def _named(names: tuple[str, ...], settings: Mapping[str, tuple[float, ...]]) -> dict[str, dict[str, float]]:
    return {tuned_on: dict(zip(names, setting, strict=True)) for tuned_on, setting in settings.items()}
