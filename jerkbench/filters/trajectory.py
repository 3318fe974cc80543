"""Anybody's trajectory as a method: what was estimated elsewhere, over the same recording."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

from jerkbench.contracts import Adaptation
from jerkbench.estimate import Attitude, Estimate
from jerkbench.io.trajectory import (
    SEED,
    TrajectoryForm,
    estimate_at_reference,
    files_digest,
    path_of_seed,
    read_trajectory,
)
from jerkbench.parameters import Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("filter", "trajectory")
@dataclass(frozen=True, kw_only=True)
class TrajectoryFile(TrajectoryForm):
    """Takes the estimate from a file, as it is; `jerkbench score` is the short way to it.

    At each stamp t of the reference, with the samples (t_i, p_i) of the file::

        p(t) = p_i                                          where t_i = t
        p(t) = p_i + (p_(i+1) - p_i) (t - t_i)/(t_(i+1) - t_i)    between them, if t_(i+1) - t_i <= max_gap_s

    velocity and covariance likewise, the attitude by the shortest turn. Nothing is aligned, shifted or scaled. A gap
    that is longer, a number that is not finite, or a begin after errors count is an error; an early end is a run that
    stopped. What the file does not have is not there: of positions alone, velocity and consistency have no value.

    Attributes:
        file: its path, or a pattern with {seed} in the place of the seed's number, of whose files each is one run.
        label: what tables call it, before "(external)"; empty: the file's name.
    """

    provenance = Provenance("own", "", "A file of the user's; what made it, its author knows.")

    adaptations: ClassVar[tuple[str, ...]] = ("none",)
    uses_imu: ClassVar[bool] = False

    file: str
    label: str = ""

    @property
    def table_label(self) -> str:
        """What tables call it."""
        stem = Path(self.file).stem.replace(SEED, "").strip("_-. ")
        return f"{self.label or stem or 'trajectory'}(external)"

    @property
    def for_each_seed(self) -> bool:
        """Whether each seed has a file of its own."""
        return SEED in self.file

    def of_seed(self, seed: int) -> "TrajectoryFile":
        """Return the one whose file belongs to ``seed``."""
        return replace(self, file=str(path_of_seed(self.file, seed)))

    def fingerprint(self) -> str:
        """Return the SHA-256 over the files.

        Raises:
            RecordingError: there is none.
        """
        return files_digest(self.file)

    def remarks(self, recording: Recording) -> tuple[str, ...]:
        """Return where the estimates come from, and what is done with them."""
        digest = self.fingerprint()[:12]
        source = (
            f"{self.table_label}: estimates from elsewhere, read from {self.file} (SHA-256 {digest}) and not aligned"
        )
        return (f"{source}; between samples at most {self.max_gap_s:g} s apart they are interpolated.",)

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the file's estimates at the reference's stamps.

        Raises:
            RecordingError: the file cannot be read, or has gaps.
        """
        return estimate_at_reference(
            read_trajectory(Path(self.file).expanduser(), self, recording), recording, self.max_gap_s
        )
