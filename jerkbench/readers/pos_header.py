"""The header of a .pos file: the options that RTKLIB wrote with, and its columns."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from jerkbench.errors import RecordingError
from jerkbench.readers.text import Line

Frame = Literal["geodetic", "dms", "ecef", "baseline"]

CLOCKS = ("GPST", "UTC", "JST")
FRAMES: dict[str, tuple[Frame, str, str]] = {
    "latitude(deg)": ("geodetic", "latitude(deg) longitude(deg) height(m)", "neu"),
    "latitude(d'\")": ("dms", "latitude(d'\") longitude(d'\") height(m)", "neu"),
    "x-ecef(m)": ("ecef", "x-ecef(m) y-ecef(m) z-ecef(m)", "xyz"),
    "e-baseline(m)": ("baseline", "e-baseline(m) n-baseline(m) u-baseline(m)", "enu"),
}
"""First column of each kind of position: the frame, its three columns, and the letters of its axes."""

COLUMNS = (
    "GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
    " vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun"
)
"""The header of degrees with velocities, as an example."""

REFERENCE = "ref pos"


@dataclass(frozen=True)
class PosHeader:
    """The columns behind the two fields of time.

    Attributes:
        clock: GPST, UTC or JST.
        frame: of the positions; dms: degrees, minutes and seconds in columns of their own.
        axes: letters of the axes, in the order of the columns.
        count: how many columns there are.
        position: of the position: the three columns' numbers (of dms where each angle begins).
        quality: of Q.
        sigmas: of the six standard deviations a, b, c, ab, bc, ca.
        velocity: of the three velocities; empty: there are none.
        velocity_sigmas: of their six standard deviations.
        reference: of the base: the three numbers that the header gives, or none.
        ellipsoidal: whether heights are above the ellipsoid, as RTKLIB's line "% (lat/lon/height=WGS84/ellipsoidal,
            ..." says, or above the geoid ("WGS84/geodetic"); None: the header does not say.
    """

    clock: str
    frame: Frame
    axes: str
    count: int
    position: tuple[int, ...]
    quality: int
    sigmas: tuple[int, ...]
    velocity: tuple[int, ...]
    velocity_sigmas: tuple[int, ...]
    reference: tuple[float, ...]
    ellipsoidal: bool | None = None


def read_header(path: Path, comments: Sequence[Line]) -> PosHeader:
    """Return what the comments (lines that begin with %) say.

    Raises:
        RecordingError: none of them names the columns, or a column is missing; names file and line.
    """
    for number, text in reversed(comments):
        words = text.lstrip("% ").split()
        if len(words) > 1 and words[0] in CLOCKS and words[1] in FRAMES:
            return replace(_header(path, number, words, _reference(comments)), ellipsoidal=_ellipsoidal(comments))
    number, text = comments[-1] if comments else (1, "no line that begins with %")
    raise RecordingError(
        f"{path}, line {number}: the header is '{' '.join(text.split())}'; it must be like '% {COLUMNS}': let RTKLIB"
        " write it (out-outhead=on)."
    )


def _header(path: Path, line: int, words: list[str], reference: tuple[float, ...]) -> PosHeader:
    frame, names, axes = FRAMES[words[1]]
    numbers: dict[str, int] = {}
    count = 0
    for word in words[1:]:
        numbers[word] = count
        count += 3 if word.endswith("(d'\")") else 1
    crossed = [axes[k] + axes[(k + 1) % 3] for k in range(3)]
    sigmas = [f"sd{letters}(m)" for letters in (*axes, *crossed)]
    missing = [name for name in (*names.split(), "Q", *sigmas) if name not in numbers]
    if missing:
        raise RecordingError(f"{path}, line {line}: the header lacks {', '.join(missing)}; let RTKLIB write the file.")
    velocity = [f"v{axis}(m/s)" for axis in axes]
    velocity_sigmas = [f"sdv{letters}" for letters in (*axes, *crossed)]
    has_velocity = all(name in numbers for name in (*velocity, *velocity_sigmas))
    return PosHeader(
        clock=words[0],
        frame=frame,
        axes=axes,
        count=count,
        position=tuple(numbers[name] for name in names.split()),
        quality=numbers["Q"],
        sigmas=tuple(numbers[name] for name in sigmas),
        velocity=tuple(numbers[name] for name in velocity) if has_velocity else (),
        velocity_sigmas=tuple(numbers[name] for name in velocity_sigmas) if has_velocity else (),
        reference=reference,
    )


def _reference(comments: Sequence[Line]) -> tuple[float, ...]:
    """The base's place, which RTKLIB writes in the frame of the solution; of baselines latitude, longitude, height."""
    for _, text in comments:
        name, _, numbers = text.lstrip("% ").partition(":")
        if name.strip() == REFERENCE:
            try:
                return tuple(float(number) for number in numbers.split())
            except ValueError:
                return ()
    return ()


def _ellipsoidal(comments: Sequence[Line]) -> bool | None:
    text = " ".join(text for _, text in comments)
    return next((datum == "ellipsoidal" for datum in ("ellipsoidal", "geodetic") if f"WGS84/{datum}" in text), None)
