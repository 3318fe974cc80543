"""The title, the unit and the expected value of a metric, by its column's name."""

from dataclasses import dataclass

UNITS = {
    "m": "m",
    "mps": "m/s",
    "rad": "rad",
    "deg": "deg",
    "radps": "rad/s",
    "s": "s",
    "us": "µs",
    "ns": "ns",
    "db": "dB",
    "percent": "%",
}
"""Last part of a column's name, and the unit that it stands for."""

WORDS = {"rmse": "RMSE", "anees": "ANEES", "anis": "ANIS", "max": "maximum"}
"""Parts of column names that are not plain words."""

TITLES = {
    "position_rmse_m": "Position RMSE (3-D)",
    "position_bound_m": "Posterior Cramér-Rao bound of the position RMSE (3-D)",
    "position_rmse_whole_m": "Position RMSE (3-D), burn-in included",
    "position_max_m": "Largest position error (3-D)",
    "velocity_rmse_mps": "Velocity RMSE (3-D)",
    "outage_rmse_m": "Position RMSE (3-D) during outages",
    "outage_rmse_horizontal_m": "Position RMSE during outages, horizontal",
    "outage_rmse_up_m": "Position RMSE during outages, up",
    "outage_end_m": "Position error (3-D) at the end of an outage, mean over the outages",
    "outage_end_max_m": "Position error (3-D) at the end of an outage, the largest",
    "outage_drift_mps": "Growth of the position error (3-D) in an outage",
    "position_rmse_low_m": "Position RMSE (3-D), lower end of the recording's own interval",
    "position_rmse_high_m": "Position RMSE (3-D), upper end of the recording's own interval",
    "step_ns": "Time a step: one run alone, the quickest of five",
    "position_crps_m": "CRPS of the position, mean of the axes",
    "non_credibility_db": "Non-credibility index of the position",
    "inclination_db": "Inclination indicator of the covariances of the position",
    "recovery_s": "Time until the error (3-D) after a fault is halfway back, median over the faults",
    "recovery_peak_m": "Largest position error (3-D) after the begin of a fault, median over the faults",
    "position_log_score": "Log score of the true position, lower is better",
    "relative_error_percent": "Error of the displacement (3-D), of the distance",
    "inflated_percent": "Updates with an inflated position",
    "rejected_percent": "Updates with a rejected position",
    "lockout_s": "Longest streak of inflated positions",
    "innovation_correlation": "Correlation of successive innovations",
    "innovation_white_percent": "Rows with white innovations",
    "faults_counted": "Faults that begin after the burn-in",
    "outages_counted": "Outages with a known error at the end",
    "inclination_rmse_rad": "RMSE of the inclination",
    "inclination_rmse_deg": "RMSE of the inclination",
    "inclination_max_deg": "Largest error of the inclination",
    "inclination_floor_deg": "Floor of the inclination: accelerometer against reference at rest",
    "anees": "ANEES of position and velocity",
    "anees_position": "ANEES of position",
    "anis_per_row": "ANIS per row, with the reported R",
    "anis_used_per_row": "ANIS per row, with the R that was used",
}
"""Titles that say more than the column's name."""

EXPECTED = {
    "anees": 6,
    "anees_position": 3,
    "anis_per_row": 1,
    "anis_used_per_row": 1,
    "coverage_1_sigma_percent": 68.3,
    "coverage_2_sigma_percent": 95.4,
    "coverage_3_sigma_percent": 99.7,
    "innovation_correlation": 0,
    "inclination_db": 0,
    "innovation_white_percent": 95,
}
"""What a consistent filter gives; of these neither the lowest nor the highest is the best."""

READING = {
    **{f"coverage_{k}_sigma_percent": "less is overconfident, more too cautious" for k in (1, 2, 3)},
    "innovation_correlation": "more lags behind the measurements, less overshoots",
    "innovation_white_percent": "less means that innovations follow each other",
}
"""How to read what is not as expected, where it is not "more is overconfident"."""

COUNTS = (
    *(
        "outages_counted",
        "faults_counted",
        "error_correlation_rows",
        "inflated_percent",
        "rejected_percent",
        "lockout_s",
    ),
    *("inclination_floor_deg", "position_bound_m"),
)
"""What tells how much was scored, how well, how well at best, or what an adaptation did: no quality of a filter."""

NATS = ("position_log_score", "innovation_log_loss")
"""Logarithms of densities, below 0 as well: the lowest is the best, but no ratio says by how much."""


@dataclass(frozen=True)
class Quantity:
    """A metric's column.

    Attributes:
        title: in words.
        unit: "" for a ratio.
        expected: what a consistent filter gives, or None.
        lowest_is_best: whether the lowest is the best, and a ratio says by how much; if not, nothing is judged.
        reading: what more or less than expected means.
    """

    title: str
    unit: str
    expected: float | None = None
    lowest_is_best: bool = True
    reading: str = "more is overconfident, less too cautious"

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
    reading = READING.get(column, Quantity.reading)
    return Quantity(title, unit, EXPECTED.get(column), column not in (*EXPECTED, *COUNTS, *NATS), reading)
