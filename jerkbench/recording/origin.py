"""The origin of a recording's coordinates."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Origin:
    """Origin of the local tangent plane (WGS-84).

    Attributes:
        latitude_deg: geodetic latitude.
        longitude_deg: longitude.
        height_m: height above the ellipsoid (or above the datum that the recording's heights use).
    """

    latitude_deg: float
    longitude_deg: float
    height_m: float
