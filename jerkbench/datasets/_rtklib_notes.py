"""What has to be said under every table of a drive from RTKLIB's solution."""

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


def fitted_notes(drive: object) -> tuple[str, ...]:
    """Return a note that says which parameters of ``drive`` are fitted rather than given, or none."""
    own = type(drive)
    fitted = [what for what, names in FITTED.items() if any(getattr(drive, n) == getattr(own, n) for n in names)]
    if not fitted:
        return ()
    listed = " and ".join([", ".join(fitted[:-1]), fitted[-1]] if fitted[1:] else fitted)
    was = "was" if fitted in (["mounting"], ["time shift"]) else "were"
    return (f"{listed.capitalize()} {was} fitted on this same drive.",)
