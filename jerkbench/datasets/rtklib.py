"""A real drive: a receiver's solution in RTKLIB's text, and the IMU's log beside it."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError, RecordingError, unknown
from jerkbench.geometry import geodetic_to_enu
from jerkbench.plugins import register
from jerkbench.readers.fetched import recording_folder
from jerkbench.readers.files import find_file, fingerprint
from jerkbench.readers.gpst import GPST_MINUS_UTC_S, utc_of
from jerkbench.readers.imu_log import ImuLog, read_imu_log
from jerkbench.readers.latency import velocity_when_true
from jerkbench.readers.mounting import ACCEL_UNITS, GYRO_UNITS, body_from_sensor
from jerkbench.readers.rest import first_rest_s, scaled_to_gravity, without_gyro_bias
from jerkbench.readers.rtklib_pos import PosSolution, read_rtklib_pos
from jerkbench.recording import Imu, Origin, Position, Recording, Reference

NOTES = (
    "Heights are above mean sea level, not above the ellipsoid; ENU is relative to the first fix and hardly changes.",
    "The receiver's fixes are measurement and reference at once unless they are withheld from the filter.",
)
FITTED = {
    "mounting": ("mounting_yaw_deg", "mounting_pitch_deg"),
    "time shift": ("imu_shift_s",),
    "latencies": ("velocity_latency_s",),
}
"""What was fitted on the public drive itself, and the parameters whose defaults it is."""


@register("dataset", "rtklib")
@dataclass(frozen=True)
class RtklibDrive:
    """A real drive from an RTKLIB solution (.pos) and an IMU log (.csv with its .tag).

    The defaults are those of the public drive that it was written for: ``data/drive_0708`` of
    github.com/rtklibexplorer/GNSS_IMU (BSD-3), a car of 549 s and 4 km. Mounting and latencies were measured on it
    and hold for no other; give your own, or zeros, for another drive.

    Time 0 is when the first IMU sample was true. The public drive's receiver began 3.4 s before; these fixes have
    negative times, and the filters start with the first one that the IMU covers. Everything stands at the time when
    it was true::

        IMU       start + (ms - ms[0]) total / (ms[-1] - ms[0]) + imu_shift      start, total: the time tag's
        position  stamp
        velocity  stamp - velocity_latency, axis by axis; an axis that is not in a row is NaN

    and the IMU is turned into the body::

        f_body = (Rz(yaw) Ry(pitch))' diag(signs) f_sensor                       and the same for the gyro

    Two percent of the public drive's IMU rows repeat the row before: the logger asks a little more often than the
    sensor measures. They are kept, for the value holds until the next one comes, and so the intervals of the samples
    stay whole; without them the sample after each gap would stand for 20 ms.

    Source: RTKLIB manual, appendix B, "Positioning Solution File".

    Attributes:
        folder: where the files are; empty: where `jerkbench data fetch rtklib_drive_0708` has put them.
        position_file: name of the solution in it; empty: the one that ends in .pos.
        imu_file: name of the IMU log: ax, ay, az, gx, gy, gz, ms; no header. Empty: the one that ends in .csv.
        tag_file: name of its time tag; empty: the IMU log's name and .tag.
        accel_unit: of the log: g or m/s2.
        gyro_unit: of the log: deg/s or rad/s.
        imu_axis_signs: applied first: x, y, z.
        mounting_yaw_deg: from the body to the IMU, about z.
        mounting_pitch_deg: from the body to the IMU, about y, after the yaw; positive is nose down.
        imu_shift_s: added to the IMU's stamps.
        velocity_latency_s: how old the velocity is at its stamp: east, north, up.
        gpst_minus_utc_s: leap seconds; 18 since 2017.
        accepted_quality: values of Q that are used (1 fixed, 2 float, 4 differential, 5 single); others are dropped.
        rest_s: how long it stands still from time 0; None: found in the receiver's velocity.
        remove_gyro_bias: subtract the gyro's mean over the rest.
        scale_accel_to_gravity: scale the accelerometer so that its mean over the rest has the magnitude 9.81 m/s2.
        min_speed_mps: errors count only where the receiver's own speed over ground is not below; 0: everywhere.
    """

    seeded: ClassVar[bool] = False
    default_attitude: ClassVar[str] = "real"

    folder: str = ""
    position_file: str = ""
    imu_file: str = ""
    tag_file: str = ""
    accel_unit: str = "g"
    gyro_unit: str = "deg/s"
    imu_axis_signs: tuple[float, ...] = (-1.0, -1.0, 1.0)
    mounting_yaw_deg: float = 5.35
    mounting_pitch_deg: float = -6.79
    imu_shift_s: float = -0.20
    velocity_latency_s: tuple[float, ...] = (0.125, 0.125, 0.275)
    gpst_minus_utc_s: float = GPST_MINUS_UTC_S
    accepted_quality: tuple[float, ...] = (1.0, 2.0)
    rest_s: float | None = None
    remove_gyro_bias: bool = True
    scale_accel_to_gravity: bool = True
    min_speed_mps: float = 0.5

    def __post_init__(self) -> None:
        """Check the units and the three axes."""
        if self.accel_unit not in ACCEL_UNITS:
            raise PluginError(unknown("accel_unit", self.accel_unit, ACCEL_UNITS))
        if self.gyro_unit not in GYRO_UNITS:
            raise PluginError(unknown("gyro_unit", self.gyro_unit, GYRO_UNITS))
        if len(self.velocity_latency_s) != 3:
            raise PluginError(f"velocity_latency_s is {self.velocity_latency_s}; give three: east, north, up.")
        if len(self.imu_axis_signs) != 3 or any(abs(sign) != 1 for sign in self.imu_axis_signs):
            raise PluginError(f"imu_axis_signs is {self.imu_axis_signs}; give 1 or -1 for each of x, y, z.")

    def load(self, seed: int = 0) -> Recording:
        """Return the drive; ``seed`` changes nothing.

        Raises:
            RecordingError: a file is missing or damaged, no fix is accepted, or there is no rest to calibrate in.
        """
        pos_path, imu_path, tag_path = self._paths()
        fixes, log = self._accepted(read_rtklib_pos(pos_path), pos_path), read_imu_log(imu_path, tag_path)
        zero_ns = log.start_gpst_ns + round(self.imu_shift_s * 1e9)
        t_s = ((fixes.gpst_ns - zero_ns) * 1e-9).astype(np.float64)
        rest_s = first_rest_s(t_s, fixes.speed_mps, log.t_s[-1]) if self.rest_s is None else self.rest_s
        origin = Origin(*(float(v[0]) for v in (fixes.latitude_deg, fixes.longitude_deg, fixes.height_m)))
        enu_m = geodetic_to_enu(fixes.latitude_deg, fixes.longitude_deg, fixes.height_m, origin)
        return Recording(
            name=pos_path.parent.resolve().name,
            imu=self._calibrated(self._in_body(log), rest_s),
            reference=self._reference(t_s, enu_m, fixes.speed_mps),
            position=Position(t_s, enu_m, fixes.covariance_m2),
            velocity=velocity_when_true(
                t_s, fixes.velocity_enu_mps, fixes.velocity_covariance_m2ps2, self.velocity_latency_s
            ),
            origin=origin,
            start_utc=utc_of(zero_ns, self.gpst_minus_utc_s),
            static_start_s=rest_s,
            notes=(*NOTES, *self._fitted()),
        )

    def fingerprint(self) -> str:
        """Return the SHA-256 over the bytes of the three files."""
        return fingerprint(self._paths())

    def _fitted(self) -> tuple[str, ...]:
        """What of the parameters is fitted rather than given: a note that says so, or none."""
        own = type(self)
        fitted = [what for what, names in FITTED.items() if any(getattr(self, n) == getattr(own, n) for n in names)]
        if not fitted:
            return ()
        listed = " and ".join([", ".join(fitted[:-1]), fitted[-1]] if fitted[1:] else fitted)
        was = "was" if fitted in (["mounting"], ["time shift"]) else "were"
        return (f"{listed.capitalize()} {was} fitted on this same drive.",)

    def _paths(self) -> tuple[Path, Path, Path]:
        folder = recording_folder(self.folder, "rtklib_drive_0708")
        pos = find_file(folder, self.position_file, ".pos", "position_file")
        imu = find_file(folder, self.imu_file, ".csv", "imu_file")
        return pos, imu, find_file(folder, self.tag_file or f"{imu.name}.tag", ".tag", "tag_file")

    def _accepted(self, fixes: PosSolution, path: Path) -> PosSolution:
        rows = np.isin(fixes.quality, self.accepted_quality)
        if not rows.any():
            there = ", ".join(str(q) for q in np.unique(fixes.quality))
            raise RecordingError(
                f"{path} has no fix with Q in {self.accepted_quality}; there is Q {there}: add it to accepted_quality."
            )
        return fixes.select(rows)

    def _in_body(self, log: ImuLog) -> Imu:
        turn = body_from_sensor(self.imu_axis_signs, self.mounting_yaw_deg, self.mounting_pitch_deg)
        accel_mps2 = log.accel * ACCEL_UNITS[self.accel_unit] @ turn.T
        return Imu(log.t_s, accel_mps2, log.gyro * GYRO_UNITS[self.gyro_unit] @ turn.T)

    def _calibrated(self, imu: Imu, rest_s: float) -> Imu:
        if self.remove_gyro_bias:
            imu = without_gyro_bias(imu, rest_s)
        return scaled_to_gravity(imu, rest_s) if self.scale_accel_to_gravity else imu

    def _reference(self, t_s: FloatArray, enu_m: FloatArray, speed_mps: FloatArray) -> Reference:
        return Reference(
            t_s,
            source="the receiver's own RTK fixes",
            independent=False,
            enu_m=enu_m,
            scored=speed_mps >= self.min_speed_mps,
        )
