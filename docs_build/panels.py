"""Panels of the gallery. Each panel shows the effect of a disturbance on one stream of a recording."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from jerkbench.arrays import FloatArray
from jerkbench.recording import Recording

GREY = "0.65"
COLOURS = ("C0", "C1", "C2")
ENU, FLU = ("east", "north", "up"), ("forward", "left", "up")


class Series(NamedTuple):
    """The samples in a panel.

    Attributes:
        t_s: (n,) times.
        values: (n, 3) one column for each axis.
    """

    t_s: FloatArray
    values: FloatArray


class Panel(NamedTuple):
    """One stream.

    Attributes:
        label: quantity and unit.
        axes: names of the axes.
        of: reads the stream from a recording.
        relative: show the change instead of the values.
    """

    label: str
    axes: tuple[str, ...]
    of: Callable[[Recording], Series]
    relative: bool = False


def position_error(recording: Recording) -> Series:
    """Return the fixes minus the truth."""
    fixes, truth = recording.position, recording.reference
    return Series(fixes.t_s, fixes.enu_m - _at(fixes.t_s, truth.t_s, truth.enu_m))


def velocity_error(recording: Recording) -> Series:
    """Return the measured velocities minus the truth."""
    measured, truth = recording.velocity, recording.reference
    return Series(measured.t_s, measured.mps - _at(measured.t_s, truth.t_s, truth.velocity_mps))


def position_sigma(recording: Recording) -> Series:
    """Return the reported standard deviations of the fixes."""
    fixes = recording.position
    return Series(fixes.t_s, np.sqrt(np.diagonal(fixes.covariance_m2, axis1=1, axis2=2)))


def accel(recording: Recording) -> Series:
    """Return the specific force."""
    return Series(recording.inertial.t_s, recording.inertial.accel_mps2)


def gyro(recording: Recording) -> Series:
    """Return the angular rate."""
    return Series(recording.inertial.t_s, recording.inertial.gyro_radps)


PANELS = (
    Panel("position error [m]", ENU, position_error),
    Panel("reported sigma [m]", ENU, position_sigma),
    Panel("velocity error [m/s]", ENU, velocity_error),
    Panel("added force [m/s²]", FLU, accel, relative=True),
    Panel("added rate [rad/s]", FLU, gyro, relative=True),
)


def changed(before: Recording, after: Recording) -> list[Panel]:
    """Return the panels whose content differs, or the first panel if nothing differs."""
    return [panel for panel in PANELS if _differ(panel.of(before), panel.of(after))] or [PANELS[0]]


def draw(ax: Axes, panel: Panel, before: Recording, after: Recording) -> None:
    """Draw one stream of both recordings."""
    old, new = panel.of(before), panel.of(after)
    if panel.relative:
        new = Series(new.t_s, new.values - _at(new.t_s, old.t_s, old.values))
        old = Series(old.t_s, np.zeros_like(old.values))
    ax.plot(old.t_s, old.values, ".", color=GREY, markersize=2)
    for column, colour, name in zip(new.values.T, COLOURS, panel.axes, strict=True):
        ax.plot(new.t_s, column, ".", color=colour, markersize=2, label=name)
    for start, end in after.outages_s:
        ax.axvspan(start, end, color="0.92", zorder=0)
    count = f"{len(new.t_s)} of {len(old.t_s)} samples" if len(new.t_s) != len(old.t_s) else None
    ax.set_ylabel(panel.label)
    ax.legend(
        loc="upper left", ncols=3, fontsize="x-small", markerscale=3, title=count or None, title_fontsize="x-small"
    )


def _differ(old: Series, new: Series) -> bool:
    """Return whether values differ. Constant standard deviations of removed fixes do not count."""
    if len(old.t_s) == len(new.t_s):
        return not (np.array_equal(old.t_s, new.t_s) and np.array_equal(old.values, new.values, equal_nan=True))
    return not np.isin(new.values, old.values).all() or len(np.unique(old.values)) > len(ENU)


def _at(t_s: FloatArray, known_s: FloatArray, values: FloatArray) -> FloatArray:
    return np.column_stack([np.interp(t_s, known_s, column) for column in values.T])
