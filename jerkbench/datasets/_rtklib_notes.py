"""Sentences under every table of a drive from RTKLIB's solution."""

from jerkbench.readers.rtklib_pos import PosSolution

SAME = "The receiver's fixes are measurement and reference at once unless they are withheld from the filter."

HEIGHTS = {
    True: (),
    False: ("Heights are above mean sea level, not above the ellipsoid, as the solution's header says.",),
    None: ("The solution's header does not say what heights are above, the ellipsoid or mean sea level.",),
}
"""Notes where heights are above the ellipsoid, above mean sea level, or nobody says above what."""

FITTED = {
    "mounting": ("mounting_yaw_deg", "mounting_pitch_deg"),
    "time shift": ("imu_shift_s",),
    "latencies": ("velocity_latency_s",),
}
"""What was fitted on the public drive itself, and the parameters whose defaults it is."""


def solution_notes(solution: PosSolution) -> tuple[str, ...]:
    """Return the notes that hold for every drive whose fixes are ``solution``."""
    return (*solution.notes, *HEIGHTS[solution.ellipsoidal], SAME)


def fitted_notes(drive: object) -> tuple[str, ...]:
    """Return a note that says which parameters of ``drive`` are the defaults, fitted on the public drive; or none."""
    own = type(drive)
    fitted = [subject for subject, names in FITTED.items() if any(getattr(drive, n) == getattr(own, n) for n in names)]
    if not fitted:
        return ()
    listed = " and ".join([", ".join(fitted[:-1]), fitted[-1]] if fitted[1:] else fitted)
    singular = fitted in (["mounting"], ["time shift"])
    verbs = "is the default, which was" if singular else "are the defaults, which were"
    return (f"{listed.capitalize()} {verbs} fitted on the public drive drive_0708: for no other drive.",)
