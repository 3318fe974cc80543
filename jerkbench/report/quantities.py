"""What a metric's column name means: its title, its unit, and what to expect of it."""

from dataclasses import dataclass

UNITS = {"m": "m", "mps": "m/s", "rad": "rad", "radps": "rad/s", "s": "s", "us": "µs", "percent": "%"}
"""Last part of a column's name, and the unit that it stands for."""

WORDS = {"rmse": "RMSE", "anees": "ANEES", "anis": "ANIS", "max": "maximum"}
"""Parts of column names that are not plain words."""

TITLES = {
    "position_rmse_m": "Position RMSE (3-D)",
    "position_rmse_whole_m": "Position RMSE (3-D), burn-in included",
    "position_max_m": "Largest position error (3-D)",
    "velocity_rmse_mps": "Velocity RMSE (3-D)",
    "outage_rmse_m": "Position RMSE (3-D) during outages",
    "outage_end_m": "Position error (3-D) at the end of an outage, mean over the outages",
    "outage_end_max_m": "Position error (3-D) at the end of an outage, the largest",
    "outages_counted": "Outages with a known error at the end",
    "anees": "ANEES of position and velocity",
    "anees_position": "ANEES of position",
    "anis_per_row": "ANIS per row, with the reported R",
    "anis_used_per_row": "ANIS per row, with the R that was used",
}
"""Titles that say more than the column's name."""

EXPECTED = {"anees": 6, "anees_position": 3, "anis_per_row": 1, "anis_used_per_row": 1}
"""What a consistent filter gives; of these neither the lowest nor the highest is the best."""

COUNTS = ("outages_counted",)
"""What tells how much was scored: no quality of a filter."""


@dataclass(frozen=True)
class Quantity:
    """A metric's column.

    Attributes:
        title: in words.
        unit: "" for a ratio.
        expected: what a consistent filter gives, or None.
        lowest_is_best: whether the lowest is the best; if not, none is.
    """

    title: str
    unit: str
    expected: float | None = None
    lowest_is_best: bool = True

    @property
    def heading(self) -> str:
        """Title and unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


def quantity(column: str) -> Quantity:
    """Return what a column's name means; names that are not known here speak for themselves.

    >>> quantity("position_rmse_up_m").heading
    'Position RMSE up [m]'
    """
    stem, _, last = column.rpartition("_")
    unit = UNITS.get(last, "") if stem else ""
    words = [WORDS.get(word, word) for word in (stem if unit else column).split("_")]
    plain = " ".join(words)
    title = TITLES.get(column, plain[:1].upper() + plain[1:])
    return Quantity(title, unit, EXPECTED.get(column), column not in (*EXPECTED, *COUNTS))
