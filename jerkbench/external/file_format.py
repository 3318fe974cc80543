"""The form of a trajectory's file: which columns are what, in which frame and unit, on which clock."""

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from jerkbench.checks import require_choices, require_not_negative
from jerkbench.errors import PluginError
from jerkbench.readers.columns import TIME_UNITS
from jerkbench.readers.frames import ANGLE_UNITS, FRAMES

CLOCKS = ("", "start", "unix")
CHOICES = {
    "time_unit": tuple(TIME_UNITS),
    "clock": CLOCKS,
    "frame": FRAMES,
    "angle_unit": tuple(ANGLE_UNITS),
    "attitude_unit": tuple(ANGLE_UNITS),
    "attitude_frame": ("", "enu", "ned"),
    "body": ("flu", "frd"),
}
COUNTS = {"position": (0, 3), "velocity": (0, 3), "attitude": (0, 3, 4), "covariance": (0, 3, 6, 21, 36)}
"""How many columns each parameter may name."""

TEXT = {"separator": "", "header": False, "time_unit": "s"}
TUM = TEXT | {
    "comment": "#",
    "time": "1",
    "time_week": "",
    "position": ("2", "3", "4"),
    "velocity": (),
    "attitude": ("8", "5", "6", "7"),
    "covariance": (),
}
"""A line ``t x y z qx qy qz qw``; the frame is the user's."""

KF_GINS = TEXT | {
    "time_week": "1",
    "time": "2",
    "frame": "geodetic",
    "angle_unit": "deg",
    "position": ("3", "4", "5"),
    "velocity": ("6", "7", "8"),
    "attitude": ("9", "10", "11"),
    "attitude_unit": "deg",
    "attitude_frame": "ned",
    "body": "frd",
    "covariance": (),
}
"""A line ``week second latitude longitude height vn ve vd roll pitch yaw``."""

KNOWN: dict[str, dict[str, Any]] = {".tum": TUM, ".nav": KF_GINS}
"""Endings of files whose columns need no map."""


@dataclass(frozen=True, kw_only=True)
class TrajectoryForm:
    """The columns of a trajectory, by the header's names or by numbers from 1.

    A file that ends in .tum (``t x y z qx qy qz qw``) or .nav (KF-GINS) needs no map. Of any other table (CSV, Parquet,
    .mat) the columns that are not named are looked for by the names that an exported recording has: t_s, east_m,
    north_m, up_m (by frame: north_m, east_m, down_m, or latitude_deg, longitude_deg, height_m), and, where they are
    there, east_mps, north_mps, up_mps (of NED, and of geodetic places: north_mps, east_mps, down_mps), roll_rad,
    pitch_rad, yaw_rad, and P11, P12, ..., P16, P22, ..., P66.

    Attributes:
        time: the column of times.
        time_unit: s, ms, us or ns.
        time_week: the column of GPS weeks, where the times are GPS seconds of the week; empty: they are not.
        clock: what times count from: start (of the recording), unix (1970, UTC); empty: unix where the first is beyond
            100 000 000 s.
        position: three columns, in the order of the frame.
        frame: of position and covariance, and of velocity: enu, ned, geodetic (velocity, covariance and attitude: NED)
            or ecef (position alone).
        angle_unit: of latitude and longitude: deg or rad.
        velocity: three columns.
        attitude: three columns (roll, pitch, yaw) or four (w, x, y, z), body to local frame.
        attitude_unit: of roll, pitch and yaw: rad or deg.
        attitude_frame: the local frame of the attitude: enu or ned; empty: that of the velocity.
        body: whose attitude it is: flu or frd.
        covariance: columns of variances: three (position) or six (and velocity); or of the whole matrix of both: 21
            (11, 12, ..., 16, 22, ..., 66) or 36, row by row.
        separator: between the columns of a text; empty: white space.
        header: whether a line names the columns.
        comment: what a line to be left out begins with.
        topic: of a ROS bag, the Odometry or poses to take; empty: its only Odometry. Poses are in the recording's ENU,
            the body is forward, left, up, the twist is in it, and nothing of the above is asked.
        max_gap_s: between two samples that are further apart nothing is interpolated.
    """

    time: str = "t_s"
    time_unit: str = "s"
    time_week: str = ""
    clock: str = ""
    position: tuple[str, ...] = ()
    frame: str = "enu"
    angle_unit: str = "deg"
    velocity: tuple[str, ...] = ()
    attitude: tuple[str, ...] = ()
    attitude_unit: str = "rad"
    attitude_frame: str = ""
    body: str = "flu"
    covariance: tuple[str, ...] = ()
    separator: str = ","
    header: bool = True
    comment: str = ""
    topic: str = ""
    max_gap_s: float = 0.2

    def __post_init__(self) -> None:
        """Check every choice and every number of columns."""
        require_choices(self, CHOICES)
        for name, counts in COUNTS.items():
            if len(getattr(self, name)) not in counts:
                allowed = " or ".join(str(count) for count in counts if count)
                raise PluginError(f"{name} names {len(getattr(self, name))} columns; give {allowed}, or none.")
        require_not_negative("trajectory", self, ("max_gap_s",))

    @property
    def local_frame(self) -> str:
        """The axes of the velocity and the covariance."""
        return "ned" if self.frame == "geodetic" else self.frame


def form_of(path: Path, declared: TrajectoryForm) -> TrajectoryForm:
    """Return the form of a file: that of its ending, or the one that is ``declared``."""
    own = TrajectoryForm(**{f.name: getattr(declared, f.name) for f in fields(TrajectoryForm)})
    return replace(own, **KNOWN.get(path.suffix, {}))
