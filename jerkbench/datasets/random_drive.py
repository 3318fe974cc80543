"""Random drives: a simulated data set whose parameters and faults are drawn from the seed."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from jerkbench import plugins
from jerkbench.errors import PluginError, unknown
from jerkbench.plugins import register
from jerkbench.random_streams import stream
from jerkbench.recording import Recording
from jerkbench.simulation.laws import law


@register("dataset", "random_drive")
@dataclass(frozen=True)
class RandomDrive:
    """A simulated drive whose parameters and faults are drawn from the seed, by laws that a preset states.

    Each seed is another drive, so that a sweep over seeds is a sweep over drives: a draw is one drive, for which each
    parameter has got one random value by its law. A law is a line of text::

        speed_mps ~ uniform 0.9 to 2.2          roughness ~ log_normal 1.5 sigma 0.4    (median; sigma of the logarithm)
        size_m ~ log_uniform 0.5 to 10          trace ~ one_of comma2k19 pixel4 tokyo_1105
        times_s ~ times 2 in 15 to 145          windows_s ~ windows 1 to 3 of 2 to 10 in 15 to 145
        duration_s ~ always 60                  gyro_radps = accel_mps2 * 0.025         (of one that is drawn before)

    Windows are uniform in number, length and place, and do not overlap. The unit of a parameter ends its name.

    A drive has 0, 1, 2 ... faults with the given probabilities. Their kinds are drawn without replacement, all alike,
    and act in the order in which they are listed. The preset `mixture` states the laws of the audit.

    Each parameter has a random stream of its own. The drive is the one that the data set and the disturbances give by
    themselves with the drawn parameters and the same seed. What was drawn stands in each row of a study, in columns
    that begin with ``drawn.``: numbers as they are, a word as ``drawn.trace.pixel4 = 1``, a tuple by the places of its
    numbers, the kinds of faults as ``drawn.fault.outliers = 1``, and their number as ``drawn.faults``.

    Attributes:
        bases: simulated data sets, of which one is drawn.
        drive: laws of the data set's parameters.
        fault_shares: probability of 0, 1, 2 ... faults.
        faults: kinds of faults: the name of a disturbance, or of a switch of the data set (``ruts``), and the laws of
            its parameters.
    """

    seeded: ClassVar[bool] = True

    bases: tuple[str, ...] = ("field",)
    drive: tuple[str, ...] = ()
    fault_shares: tuple[float, ...] = (1.0,)
    faults: tuple[tuple[str, ...], ...] = ()

    def __post_init__(self) -> None:
        """Check that every name exists, every law can be drawn from, and the probabilities are some."""
        for base in self.bases:
            if not getattr(plugins.get("dataset", base), "seeded", False) or base == "random_drive":
                raise PluginError(
                    f"random_drive: {base} is no simulated data set, so that nothing can be drawn for it."
                )
        shares = np.array(self.fault_shares)
        if not self.bases or (shares < 0).any() or abs(shares.sum() - 1) > 1e-9 or len(shares) > len(self.faults) + 1:
            raise PluginError(
                f"random_drive: fault_shares is {self.fault_shares} for {len(self.faults)} kinds of faults and the data"
                f" sets {self.bases}; give probabilities whose sum is 1, at most one more than kinds, and a data set."
            )
        for kind, laws in ("", self.drive), *((kind, laws) for kind, *laws in self.faults):
            owners = [("dataset", base) for base in self.bases] if self._of_drive(kind) else [("disturbance", kind)]
            for owner in owners:
                known = [f.name for f in dataclasses.fields(plugins.get(*owner))]
                for wrong in (law(text).parameter for text in laws if law(text).parameter not in known):
                    raise PluginError(unknown(f"parameter of {' '.join(owner)}", wrong, known))

    def load(self, seed: int) -> Recording:
        """Return the drive that belongs to ``seed``."""
        base, drive, faults = self.drawn(seed)
        switched = [{kind: True, **own} for kind, own in faults.items() if self._of_drive(kind)]
        parameters = {name: value for own in (drive, *switched) for name, value in own.items()}
        recording: Recording = plugins.create("dataset", {"name": base, **parameters}).load(seed)
        for kind, own in faults.items():
            if not self._of_drive(kind):
                recording = plugins.create("disturbance", {"name": kind, **own}).apply(recording, seed)
        return replace(recording, parameters=self.columns(seed), drawn=None if faults else recording.drawn)

    def fingerprint(self) -> str:
        """Return the empty string: it reads no data."""
        return ""

    def drawn(self, seed: int) -> tuple[str, dict[str, Any], dict[str, dict[str, Any]]]:
        """Return what ``seed`` draws: the data set, its parameters, and the parameters of each fault by its kind."""
        base = self.bases[stream(seed, "random_drive", "base").integers(len(self.bases))]
        random = stream(seed, "random_drive", "faults")
        count = random.choice(len(self.fault_shares), p=self.fault_shares)
        kinds = sorted(random.permutation(len(self.faults))[:count])
        faults = {kind: _values(seed, kind, laws) for kind, *laws in (self.faults[place] for place in kinds)}
        return base, _values(seed, "", self.drive), faults

    def columns(self, seed: int) -> dict[str, float]:
        """Return what ``seed`` draws as the columns that a study's rows have."""
        base, drive, faults = self.drawn(seed)
        return dict(_numbers("drawn", {"base": base, **drive, "faults": len(faults), "fault": [*faults], **faults}))

    def _of_drive(self, kind: str) -> bool:
        """Whether the parameters of a kind of faults are the data set's: those of none, and of one of its switches."""
        bases = [plugins.get("dataset", base) for base in self.bases]
        return not kind or all(isinstance(getattr(base, kind, None), bool) for base in bases)


def _values(seed: int, kind: str, laws: Sequence[str]) -> dict[str, Any]:
    """Draw the parameters of a kind of faults; of none, the data set's."""
    values: dict[str, Any] = {}
    for each in map(law, laws):
        values[each.parameter] = each.draw(stream(seed, "random_drive", kind, each.parameter), values)
    return values


def _numbers(name: str, value: Any) -> Iterator[tuple[str, float]]:  # noqa: ANN401 - whatever a parameter may be
    """Yield the columns of what was drawn."""
    if isinstance(value, (int, float)):
        yield name, float(value)
    elif isinstance(value, str):
        yield f"{name}.{value}", 1.0
    elif isinstance(value, Mapping):
        for key, own in value.items():
            yield from _numbers(f"{name}.{key}", own)
    else:
        for place, own in enumerate(value):
            yield from _numbers(name if isinstance(own, str) else f"{name}.{place}", own)
