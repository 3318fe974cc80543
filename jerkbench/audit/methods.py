"""The methods of an audit, and the settings that each of them may try."""

from dataclasses import dataclass

from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.scenarios import Scenario, cell_on
from jerkbench.errors import PluginError
from jerkbench.tuning.samplers import sampler_of
from jerkbench.tuning.space import Setting, Space, space_of

FLOOR = "gnss_only"
"""The filter that tells what any of them is worth at all; it has nothing to tune."""


@dataclass(frozen=True, order=True)
class Method:
    """A filter with an adaptation.

    Attributes:
        filter: its name.
        adaptation: its name.
    """

    filter: str
    adaptation: str

    @property
    def name(self) -> str:
        """What tables call it."""
        return f"{self.filter} + {self.adaptation}"


def methods(protocol: AuditProtocol) -> list[Method]:
    """Return every method, those of one filter together, the plain one first."""
    adaptations = (*protocol.compared, *protocol.references)
    kinematic = [Method(model, adaptation) for model in protocol.filters for adaptation in adaptations]
    return [*kinematic, *(Method(name, protocol.plain) for name in (FLOOR, *protocol.apart))]


def space_of_method(method: Method, scenario: Scenario) -> Space:
    """Return the knobs of a method; empty where there is none."""
    try:
        return space_of(cell_on(scenario, method.filter, method.adaptation, seeds=1))
    except PluginError:
        if method.filter == FLOOR:
            return Space(())
        raise


def settings_of(protocol: AuditProtocol, space: Space) -> tuple[tuple[Setting, ...], ...]:
    """Return (restarts, trials) the settings that each search tries: the defaults, then points of a Sobol sequence.

    Two methods with as many knobs try the same shares of their ranges.
    """
    if not space.knobs:
        return tuple(((),) for _ in range(protocol.restarts))
    return tuple(tried_settings(protocol.trials, space, restart) for restart in range(protocol.restarts))


def tried_settings(trials: int, space: Space, restart: int = 0) -> tuple[Setting, ...]:
    """Return the settings that one search tries: the one before it, then points of the sequence of ``restart``."""
    sampler = sampler_of("sobol", len(space.knobs), restart)
    return (
        (space.start, *(space.setting(shares) for shares in sampler.ask(trials - 1))) if trials > 1 else (space.start,)
    )
