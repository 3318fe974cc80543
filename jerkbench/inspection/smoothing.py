"""Smoothing of a track of fixes. The noise parameters of the smoother are estimated from the innovations."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize
from scipy.special import gammaln

from jerkbench import plugins
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.arrays import FloatArray
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.errors import RecordingError
from jerkbench.estimate import Estimate, Updates, no_attitude
from jerkbench.filters.constant_turn import TURN_WALK, ConstantTurn
from jerkbench.filters.rts import SmoothedFixes
from jerkbench.inspection.noise import MAX_FIX_GAP_S, truth_at
from jerkbench.parameters import ranges_of
from jerkbench.recording import THE_FIXES, Position, Recording, Reference
from jerkbench.timeline import build_timeline

MIN_FIXES = 10

FIRST_STEPS = np.array([[0.0, 0.0], [1.5, 0.0], [0.0, 1.5]])
"""Initial simplex of the search, relative to the logarithms of the start values: the start, a factor of 4.5 on the
random walk, and a factor of 4.5 on the sigmas."""

FREEDOMS = (4.0, 1000.0)
"""Tested degrees of freedom of Student's t: heavy tails, as for real receivers, and a nearly normal distribution."""

WEIGHINGS = 10
"""Number of iterations in which the weights of the fixes are computed."""

SIGMA_SCALES = (0.01, 100.0)
"""Range of the factor on the sigmas of the fixes."""

WALKS = {
    "constant_velocity": ("velocity_walk_mps_per_sqrt_s",),
    "acceleration": ("accel_walk_mps2_per_sqrt_s",),
    "constant_turn": ("velocity_walk_mps_per_sqrt_s", "turn_walk_radps_per_sqrt_s"),
}
"""Estimated parameters of each model."""

TURNS = 5
"""Number of values of the random walk of the turn rate that are tested with the best constant velocity model."""


@dataclass(frozen=True, eq=False)
class SmoothedTrack:
    """Fixes of a recording and the smoothed track.

    Attributes:
        recording: recording with the fixes as position and the smoothed track as reference.
        smoother: the smoother with the estimated noise parameters.
        sigma_scale: estimated factor on the declared sigmas of the fixes.
        freedom: degrees of freedom of Student's t distribution of the errors of the fixes.
        distance_m: (n,) distance of each fix from the smoothed track [m].
        error_m: 3-D RMSE of the fixes and of the track relative to the reference of the log [m]; None without a
            reference.
        source: source of the reference of the log.
    """

    recording: Recording
    smoother: SmoothedFixes
    sigma_scale: float
    freedom: float
    distance_m: FloatArray
    error_m: tuple[float, float] | None
    source: str


def smooth_fixes(recording: Recording) -> SmoothedTrack:
    """Return the most likely track for all fixes of a recording. An IMU is not used.

    The random walks of the motion models and one factor on the sigmas of the fixes are estimated. The estimates
    minimise the mean of -log p(y) over the innovations y, where p is Student's t distribution with nu degrees of
    freedom (`FREEDOMS`) and the scale S = H P H' + R. Expectation maximisation smooths the fixes with the best setting
    and with Student's t distribution of the errors. For a fix with n axes, the distance r from the smoothed position
    with the covariance Ps determines a weight w::

        w = (nu + n) / (nu + r' R^-1 r + tr(R^-1 Ps)),    R = R / w

    Source: G. Agamennoni, J. I. Nieto, E. M. Nebot, "An outlier-robust Kalman filter", IEEE International Conference on
    Robotics and Automation, 2011, doi:10.1109/ICRA.2011.5979605. The paper also estimates R, which is not estimated
    here.

    Raises:
        RecordingError: the recording has fewer than `MIN_FIXES` fixes, or the smoother fails.
    """
    position, velocity = _fixes(recording), recording.velocity
    if velocity is not None and velocity.frame != "enu":
        velocity = None  # without an attitude, the direction of the velocity is unknown
    reference = Reference(position.t_s, THE_FIXES, independent=False, enu_m=position.enu_m)
    fixes_only = replace(recording, position=position, imu=None, heading=None, velocity=velocity, reference=reference)
    smoother, scale, freedom = _most_likely(fixes_only)
    estimate = _robust(fixes_only, smoother, scale, freedom)
    distance_m = np.sqrt(np.nansum((position.enu_m - estimate.position_m) ** 2, axis=1))
    places_m, mps = estimate.position_m, estimate.velocity_mps
    source = f"smoothed by {smoother.model}"
    track = Reference(position.t_s, source, independent=False, enu_m=places_m, velocity_mps=mps)
    truth_m = truth_at(recording, "position", position.t_s, MAX_FIX_GAP_S)
    errors_m = [np.linalg.norm(places - truth_m, axis=1) for places in (position.enu_m, estimate.position_m)]
    known = np.isfinite(errors_m[0])
    fixes_m, track_m = (float(np.sqrt(np.mean(error_m[known] ** 2))) if known.any() else 0.0 for error_m in errors_m)
    error_m = (fixes_m, track_m) if fixes_m else None  # None if the reference is a copy of the fixes
    setting, source = (smoother, scale, freedom), recording.reference.source
    return SmoothedTrack(replace(fixes_only, reference=track), *setting, distance_m, error_m, source)


def _robust(fixes_only: Recording, smoother: SmoothedFixes, scale: float, freedom: float) -> Estimate:
    """Smooth the fixes repeatedly. Each pass uses weights of the fixes that are computed from the previous pass."""
    attitude, rule, fixes = no_attitude(fixes_only.clock_s), NoAdaptation(), _fixes(fixes_only)
    R = scale**2 * fixes.covariance_m2
    weight = np.ones(len(R))
    for _ in range(WEIGHINGS):
        recording = _declaring(fixes_only, R / weight[:, None, None])
        estimate = smoother.estimate_compiled(recording, attitude, rule) or smoother.estimate(recording, attitude, rule)
        if estimate.failure:
            raise RecordingError(f"{fixes_only.name} cannot be smoothed: {estimate.failure}.")
        r = fixes.enu_m - estimate.position_m
        spread = np.nan_to_num(r[:, :, None] * r[:, None, :]) + estimate.covariance[:, :3, :3]
        distance = np.trace(np.linalg.solve(R, spread), axis1=1, axis2=2)
        weight = (freedom + np.isfinite(r).sum(axis=1)) / (freedom + distance)
    return estimate


def _fixes(recording: Recording) -> Position:
    """Return the fixes from the first complete fix on, because the filter starts at a complete fix."""
    position = recording.position
    if position is not None:
        first = int(np.argmax(np.isfinite(position.enu_m).all(axis=1)))
        parts = {name: values[first:] for name, values in vars(position).items() if values is not None}
        position = Position(**parts)
    if position is None or len(position.t_s) < MIN_FIXES:
        raise RecordingError(f"{recording.name} has fewer than {MIN_FIXES} fixes; a smoothed track needs more fixes.")
    return position


def _declaring(fixes_only: Recording, covariance_m2: FloatArray) -> Recording:
    return replace(fixes_only, position=replace(_fixes(fixes_only), covariance_m2=covariance_m2))


TrackSetting = tuple[SmoothedFixes, float, float]
"""The smoother, the factor on the sigmas, and the degrees of freedom."""


def _most_likely(fixes_only: Recording) -> TrackSetting:
    """Return the setting with the lowest mean of -log p over the innovations."""
    tried: list[TrackSetting] = []
    for freedom in FREEDOMS:
        straight, scale, _ = _searched(fixes_only, "constant_velocity", freedom)
        walks = [TURN_WALK.value(share) for share in np.linspace(0.0, 1.0, TURNS).tolist()]
        turning = [replace(straight, model="constant_turn", turn_walk_radps_per_sqrt_s=walk) for walk in walks]
        tried += [(smoother, scale, freedom) for smoother in (straight, *turning)]
        tried.append(_searched(fixes_only, "acceleration", freedom))
    return min(tried, key=lambda setting: _surprise(fixes_only, *setting))


def _searched(fixes_only: Recording, model: str, freedom: float) -> TrackSetting:
    """Search the most likely random walk and factor on the sigmas of a motion model (Nelder-Mead in logarithms)."""
    (walk,) = WALKS[model]
    bounds = ranges_of(SmoothedFixes)[walk]

    def setting(logs: FloatArray) -> TrackSetting:
        walk_value, scale = np.exp(logs).tolist()
        return SmoothedFixes(model=model, **{walk: walk_value}), scale, freedom

    start = np.array([np.log(getattr(SmoothedFixes(), walk)), 0.0])
    found = minimize(
        lambda logs: _surprise(fixes_only, *setting(logs)),
        start,
        method="Nelder-Mead",
        bounds=np.log([(bounds.low, bounds.high), SIGMA_SCALES]),
        options={"initial_simplex": start + FIRST_STEPS, "xatol": 0.03, "fatol": 1e-4},
    )
    return setting(found.x)


def _surprise(fixes_only: Recording, smoother: SmoothedFixes, scale: float, freedom: float) -> float:
    """Return the mean of -log p over the innovations of the forward pass, or infinity if the filter fails."""
    recording = _declaring(fixes_only, scale**2 * _fixes(fixes_only).covariance_m2)
    timeline, model = build_timeline(recording, no_attitude(recording.clock_s)), smoother.kinematic_filter()
    rule = plugins.create("adaptation", {"name": "student_t_r", "nu": freedom})
    if isinstance(model, ConstantTurn):
        estimate = model.filtered(timeline, rule)
    else:
        estimate = CompiledEngine().run(timeline, model, rule)
    return np.inf if estimate.failure else float(np.mean(surprises(estimate.updates, freedom)))


def surprises(updates: Updates, nu: float) -> FloatArray:
    """Return -log p (m,) of each innovation y for Student's t distribution with nu degrees of freedom.

    An innovation y with d rows and the scale S has the negative log density::

        1/2 log det S + (nu + d)/2 log(1 + y' S^-1 y / nu) + d/2 log(nu pi) + log Gamma(nu/2) - log Gamma((nu + d)/2)
    """
    d = updates.rows
    constant = 0.5 * d * np.log(nu * np.pi) + gammaln(0.5 * nu) - gammaln(0.5 * (nu + d))
    return np.asarray(0.5 * updates.log_det + 0.5 * (nu + d) * np.log1p(updates.nis / nu) + constant)


# Text about a smoothed track.


def track_lines(track: SmoothedTrack) -> Iterator[str]:
    """Yield lines of text: estimated parameters, distances of the fixes from the track, errors of fixes and track."""
    smoother, distance_m = track.smoother, track.distance_m
    noises = ", ".join(f"filter.{name}={getattr(smoother, name):.3g}" for name in WALKS[smoother.model])
    parameters = f"filter.model={smoother.model}, {noises}, r_scale.position={track.sigma_scale**2:.3g}"
    tails = "heavy tails" if track.freedom == FREEDOMS[0] else "no heavy tails"
    yield f"Most likely over {len(distance_m)} fixes: {parameters}, {tails}."
    yield f"Distance of the fixes from the track: median {np.median(distance_m):.3g} m, max {distance_m.max():.3g} m."
    if track.error_m is not None:
        fixes_m, track_m = track.error_m
        yield f"3-D RMSE against {track.source}: fixes {fixes_m:.3g} m, track {track_m:.3g} m."
