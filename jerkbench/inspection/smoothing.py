"""A better track from fixes alone: a smoother whose noises the log's own innovations choose."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure
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
from jerkbench.recording import Position, Recording, Reference
from jerkbench.report.plots.style import DOTS_PER_INCH, literal, style_axes
from jerkbench.timeline import build_timeline

MIN_FIXES = 10

FIRST_STEPS = np.array([[0.0, 0.0], [1.5, 0.0], [0.0, 1.5]])
"""Of the search, in logarithms: the walk 4.5 times as large, then the sigmas."""

FREEDOMS = (4.0, 1000.0)
"""Degrees of freedom of Student's t that are tried: heavy tails, as real receivers have them, and hardly any."""

WEIGHINGS = 10
"""So often the weights of the fixes are found anew."""

SIGMA_SCALES = (0.01, 100.0)
"""So much the sigmas of the fixes may be multiplied by."""

WALKS = {
    "constant_velocity": ("velocity_walk_mps_per_sqrt_s",),
    "acceleration": ("accel_walk_mps2_per_sqrt_s",),
    "constant_turn": ("velocity_walk_mps_per_sqrt_s", "turn_walk_radps_per_sqrt_s"),
}
"""What is chosen of each model."""

TURNS = 5
"""So many random walks of the rate of turn are tried beside the best constant velocity."""


@dataclass(frozen=True, eq=False)
class SmoothedTrack:
    """Fixes and the track through them.

    Attributes:
        recording: the fixes, with the smoothed track as the reference.
        smoother: with the noises that were chosen.
        sigma_scale: what the declared sigmas of the fixes were multiplied by.
        freedom: degrees of freedom of the fixes' errors, Student's t.
        fixes_m: (n, 3) the fixes.
        distance_m: (n,) of each fix from the track.
        error_m: RMSE of the fixes and of the track (3-D) against the log's own reference; None where it has none.
        source: what that reference is.
    """

    recording: Recording
    smoother: SmoothedFixes
    sigma_scale: float
    freedom: float
    fixes_m: FloatArray
    distance_m: FloatArray
    error_m: tuple[float, float] | None
    source: str


def smooth_fixes(recording: Recording) -> SmoothedTrack:
    """Return the track that is most likely, given all fixes; an IMU is not used.

    For each model of motion, the noise of its walk and one factor on the sigmas of the fixes minimise the mean of
    -log p(y) over the innovations y, p Student's t with nu degrees of `FREEDOMS` and the scale S = H P H' + R. The
    setting with the lowest mean is smoothed, with the errors of the fixes as Student's t, by expectation and
    maximisation: of n axes, with r the distance from the smoothed place and Ps its covariance, again and again::

        w = (nu + n) / (nu + r' R^-1 r + tr(R^-1 Ps)),    R = R / w

    Source: G. Agamennoni, J. I. Nieto, E. M. Nebot, "An outlier-robust Kalman filter", IEEE International Conference on
    Robotics and Automation, 2011, doi:10.1109/ICRA.2011.5979605, whose R is estimated too.

    Raises:
        RecordingError: there are fewer than `MIN_FIXES` fixes, or no model explains them.
    """
    position, velocity = _fixes(recording), recording.velocity
    if velocity is not None and velocity.frame != "enu":
        velocity = None  # without an attitude nothing says where it points
    own = Reference(position.t_s, "the fixes themselves", independent=False, enu_m=position.enu_m)
    alone = replace(recording, position=position, imu=None, heading=None, velocity=velocity, reference=own)
    smoother, scale, freedom = _most_likely(alone)
    estimate = _robust(alone, smoother, scale, freedom)
    distance_m = np.sqrt(np.nansum((position.enu_m - estimate.position_m) ** 2, axis=1))
    places_m, mps = estimate.position_m, estimate.velocity_mps
    source = f"smoothed by {smoother.model}"
    track = Reference(position.t_s, source, independent=False, enu_m=places_m, velocity_mps=mps)
    truth_m = truth_at(recording, "position", position.t_s, MAX_FIX_GAP_S)
    errors_m = [np.linalg.norm(places - truth_m, axis=1) for places in (position.enu_m, estimate.position_m)]
    known = np.isfinite(errors_m[0])
    fixes_m, track_m = (float(np.sqrt(np.mean(error_m[known] ** 2))) if known.any() else 0.0 for error_m in errors_m)
    error_m = (fixes_m, track_m) if fixes_m else None  # fixes that are their own reference have no error
    chosen, source = (smoother, scale, freedom), recording.reference.source
    return SmoothedTrack(replace(alone, reference=track), *chosen, position.enu_m, distance_m, error_m, source)


def _robust(alone: Recording, smoother: SmoothedFixes, scale: float, freedom: float) -> Estimate:
    """Smooth again and again, each time with the weights that the last pass gave the fixes."""
    attitude, rule, fixes = no_attitude(alone.clock_s), NoAdaptation(), _fixes(alone)
    R = scale**2 * fixes.covariance_m2
    weight = np.ones(len(R))
    for _ in range(WEIGHINGS):
        recording = _declaring(alone, R / weight[:, None, None])
        estimate = smoother.estimate_compiled(recording, attitude, rule) or smoother.estimate(recording, attitude, rule)
        if estimate.failure:
            raise RecordingError(f"{alone.name} cannot be smoothed: {estimate.failure}.")
        r = fixes.enu_m - estimate.position_m
        spread = np.nan_to_num(r[:, :, None] * r[:, None, :]) + estimate.covariance[:, :3, :3]
        distance = np.trace(np.linalg.solve(R, spread), axis1=1, axis2=2)
        weight = (freedom + np.isfinite(r).sum(axis=1)) / (freedom + distance)
    return estimate


def _fixes(recording: Recording) -> Position:
    """The fixes from the first one with all axes on, where a filter starts."""
    position = recording.position
    if position is not None:
        first = int(np.argmax(np.isfinite(position.enu_m).all(axis=1)))
        parts = {name: values[first:] for name, values in vars(position).items() if values is not None}
        position = Position(**parts)
    if position is None or len(position.t_s) < MIN_FIXES:
        raise RecordingError(f"{recording.name} has fewer than {MIN_FIXES} fixes: there is no track to smooth.")
    return position


def _declaring(alone: Recording, covariance_m2: FloatArray) -> Recording:
    """The same fixes with other covariances."""
    return replace(alone, position=replace(_fixes(alone), covariance_m2=covariance_m2))


TrackSetting = tuple[SmoothedFixes, float, float]
"""The smoother, the factor on the sigmas, and the degrees of freedom."""


def _most_likely(alone: Recording) -> TrackSetting:
    """The setting whose innovations are the most likely."""
    tried: list[TrackSetting] = []
    for freedom in FREEDOMS:
        straight, scale, _ = _searched(alone, "constant_velocity", freedom)
        walks = [TURN_WALK.value(share) for share in np.linspace(0.0, 1.0, TURNS).tolist()]
        turning = [replace(straight, model="constant_turn", turn_walk_radps_per_sqrt_s=walk) for walk in walks]
        tried += [(smoother, scale, freedom) for smoother in (straight, *turning)]
        tried.append(_searched(alone, "acceleration", freedom))
    return min(tried, key=lambda setting: _surprise(alone, *setting))


def _searched(alone: Recording, model: str, freedom: float) -> TrackSetting:
    """The best walk of a model, and the best factor on the sigmas beside it (Nelder and Mead, over logarithms)."""
    (walk,) = WALKS[model]
    bounds = ranges_of(SmoothedFixes)[walk]

    def setting(logs: FloatArray) -> TrackSetting:
        walk_value, scale = np.exp(logs).tolist()
        return SmoothedFixes(model=model, **{walk: walk_value}), scale, freedom

    start = np.array([np.log(getattr(SmoothedFixes(), walk)), 0.0])
    found = minimize(
        lambda logs: _surprise(alone, *setting(logs)),
        start,
        method="Nelder-Mead",
        bounds=np.log([(bounds.low, bounds.high), SIGMA_SCALES]),
        options={"initial_simplex": start + FIRST_STEPS, "xatol": 0.03, "fatol": 1e-4},
    )
    return setting(found.x)


def _surprise(alone: Recording, smoother: SmoothedFixes, scale: float, freedom: float) -> float:
    """The mean of -log p over the innovations of the forward pass; infinite where it stops."""
    recording = _declaring(alone, scale**2 * _fixes(alone).covariance_m2)
    timeline, model = build_timeline(recording, no_attitude(recording.clock_s)), smoother.kinematic_filter()
    rule = plugins.create("adaptation", {"name": "student_t_r", "nu": freedom})
    if isinstance(model, ConstantTurn):
        estimate = model.filtered(timeline, rule)
    else:
        estimate = CompiledEngine().run(timeline, model, rule)
    return np.inf if estimate.failure else float(np.mean(surprises(estimate.updates, freedom)))


def surprises(updates: Updates, nu: float) -> FloatArray:
    """Return (m,) -log p of each innovation y, Student's t of d = len(y) rows and nu degrees of freedom.

    1/2 log det S + (nu + d)/2 log(1 + y' S^-1 y / nu) + d/2 log(nu pi) + log Gamma(nu/2) - log Gamma((nu + d)/2)
    """
    d = updates.rows
    constant = 0.5 * d * np.log(nu * np.pi) + gammaln(0.5 * nu) - gammaln(0.5 * (nu + d))
    return np.asarray(0.5 * updates.log_det + 0.5 * (nu + d) * np.log1p(updates.nis / nu) + constant)


# What is printed and drawn of it.


def track_lines(track: SmoothedTrack) -> Iterator[str]:
    """Yield what was chosen, which fixes are far from the track, and how much better it is."""
    smoother, distance_m = track.smoother, track.distance_m
    noises = ", ".join(f"filter.{name}={getattr(smoother, name):.3g}" for name in WALKS[smoother.model])
    chosen = f"filter.model={smoother.model}, {noises}, r_scale.position={track.sigma_scale**2:.3g}"
    tails = "heavy tails" if track.freedom == FREEDOMS[0] else "no heavy tails"
    yield f"Most likely over {len(distance_m)} fixes: {chosen}, {tails}."
    yield f"The fixes are {np.median(distance_m):.3g} m from the track in the median, {distance_m.max():.3g} m at most."
    if track.error_m is not None:
        fixes_m, track_m = track.error_m
        yield f"Against {track.source}: fixes {fixes_m:.3g} m, track {track_m:.3g} m (RMSE, 3-D)."


def track_figure(track: SmoothedTrack) -> Figure:
    """Draw the fixes and the track from above, and how far each fix is from the track."""
    figure = Figure(figsize=(9.0, 4.5), dpi=DOTS_PER_INCH, layout="constrained")
    plane, distance = figure.subplots(1, 2)
    places = np.asarray(track.recording.reference.enu_m)
    low, high = places.min(axis=0), places.max(axis=0)  # a wild fix shall not make the track a dot
    room = 0.1 * (high - low).max() + 1.0
    plane.plot(*track.fixes_m.T[:2], linestyle="none", marker=".", markersize=2.5, color="0.6", label="fixes")
    plane.plot(*places.T[:2], linewidth=1.2, label="track")
    plane.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room), aspect="equal")
    plane.set(xlabel="East [m]", ylabel="North [m]")
    plane.legend(frameon=False, fontsize="small")
    distance.semilogy(track.recording.reference.t_s, track.distance_m, linestyle="none", marker=".", markersize=2.5)
    distance.set(xlabel="Time [s]", ylabel="Distance of a fix from the track [m]")
    for axes in (plane, distance):
        style_axes(axes)
    figure.suptitle(literal(track.recording.name))
    return figure
