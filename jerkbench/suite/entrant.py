"""An entrant: a filter with an adaptation, as it was given, and what a suite may change of it."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from jerkbench.audit.methods import tried_settings
from jerkbench.audit.scenarios import Scenario, cell_on
from jerkbench.cells.cell import Cell
from jerkbench.cells.protocol import Protocol
from jerkbench.cells.refusal import refusal
from jerkbench.contracts import ReadingFile
from jerkbench.errors import PluginError
from jerkbench.parameters import ranges_of
from jerkbench.suite.protocol import SuiteProtocol
from jerkbench.tuning.space import Setting, Space, space_of

UNTUNED = Space(())
"""Of a method that nothing can be tuned of."""


@dataclass(frozen=True)
class Entrant:
    """A method that enters.

    Attributes:
        filter: {"name": ..., parameters}.
        adaptation: likewise.
        r_scale: what it is told of the reported R.
    """

    filter: Mapping[str, Any]
    adaptation: Mapping[str, Any]
    r_scale: Mapping[str, float]

    @property
    def name(self) -> str:
        """Its filter and its adaptation."""
        return f"{self.filter['name']} + {self.adaptation['name']}"

    @property
    def text(self) -> str:
        """All of it, the same for the same method."""
        return json.dumps(dataclasses.asdict(self), sort_keys=True)


def plain_of(protocol: SuiteProtocol) -> Entrant:
    """Return the plain filter that every entry is compared with."""
    names = {kind: {"name": name} for kind, name in protocol.plain.items()}
    return Entrant(**names, r_scale={})


def entrant_cell(
    entrant: Entrant, scenario: Scenario, protocol: SuiteProtocol, metrics: Sequence[str] | None = None
) -> Cell:
    """Return the cell of an entrant, as it was given, on a scenario.

    Args:
        entrant: the method.
        scenario: what it runs over.
        protocol: of the suite.
        metrics: names; default: the one that is tuned for.

    Raises:
        PluginError: it cannot be made, or does not fit.
    """
    names = metrics or protocol.metrics[:1]
    cell = cell_on(scenario, entrant.filter, entrant.adaptation, 1, names, entrant.r_scale)
    if reason := refusal(cell):
        raise PluginError(f"This method cannot enter: {reason}.")
    limits = Protocol(burn_in_s=protocol.burn_in_s, divergence_limit_m=protocol.divergence_limit_m)
    return dataclasses.replace(cell, protocol=limits)


def entrant_space(entrant: Entrant, protocol: SuiteProtocol) -> Space:
    """Return what may be tuned of it; nothing where neither part has a parameter with a range, as of a program."""
    cell = entrant_cell(entrant, protocol.scenarios[0], protocol)
    if not any(ranges_of(type(part)) for part in (cell.filter, cell.adaptation)):
        return UNTUNED
    return space_of(cell)


def entrant_settings(space: Space, protocol: SuiteProtocol) -> tuple[Setting, ...]:
    """Return the settings that are tried on each half: the one that it came with, then points of a Sobol sequence."""
    return tried_settings(protocol.trials, space) if space.knobs else ((),)


def program_digest(entrant: Entrant, protocol: SuiteProtocol) -> str:
    """Return the hash of the program, or of the files, that the filter reads; empty where there is none.

    Raises:
        RecordingError: it is not on this machine.
    """
    model = entrant_cell(entrant, protocol.scenarios[0], protocol).filter
    return model.fingerprint() if isinstance(model, ReadingFile) else ""
