"""What a check requires, its report as JUnit XML, and what plugins are tried on: a recording, updates of all kinds."""

import copy
import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import FrozenInstanceError
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.contracts import Estimator, Filter
from jerkbench.errors import article
from jerkbench.estimate import Attitude
from jerkbench.geometry import dcm_from_euler
from jerkbench.plugins.optional import REQUIRED
from jerkbench.random_streams import stream
from jerkbench.recording import GRAVITY_MPS2, Heading, Imu, Origin, Position, Recording, Reference, Velocity
from jerkbench.timeline import Timeline, build_timeline

Plugin = Any
"""A plugin of any kind, which is asked what it is."""


class Unfit(AssertionError):  # noqa: N818 - pytest shows an assertion's sentence best
    """Something that a plugin promises and does not keep; other assertions are the plugin's own."""


def require_that(ok: object, sentence: str) -> None:
    """Raise an `Unfit` with ``sentence`` unless ``ok``; unlike `assert` also under ``python -O``."""
    if not ok:
        raise Unfit(sentence)


def require_is(kind: type, call: str, value: object) -> None:
    """Raise an `Unfit` unless a ``call`` has given a ``value`` of some ``kind``."""
    name = "dictionary" if kind is dict else kind.__name__
    require_that(
        isinstance(value, kind), f"{call} gives a {type(value).__name__}; it must be {article(name.lower())} {name}."
    )


def changes_itself(plugin: object, error: FrozenInstanceError) -> str:
    """Return the sentence about a plugin that sets an attribute of its own while it runs."""
    name = str(error).rpartition(" ")[2].strip("'")
    return (
        f"{type(plugin).__name__} sets self.{name} while it runs, but a plugin never changes; what an adaptation keeps"
        " from one update to the next stands in memory, all else in local variables."
    )


# The comparison of two results to the bit, and copies to compare with later.


def identical(a: Any, b: Any) -> bool:  # noqa: ANN401 - whatever a plugin takes or returns
    """Return whether ``a`` and ``b`` are equal: dataclasses field by field, arrays to the bit, NaN equal to NaN."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return a.shape == b.shape and a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if dataclasses.is_dataclass(a):
        return all(identical(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, dict):
        return list(a) == list(b) and all(identical(a[key], b[key]) for key in a)
    if isinstance(a, (tuple, list)):
        return len(a) == len(b) and all(map(identical, a, b))
    return bool(a == b) or (a != a and b != b)  # noqa: PLR0124 - only NaN is unequal to itself


def pure_result(subject: str, call: Callable[..., Any], *arguments: Any) -> Any:  # noqa: ANN401 - as above
    """Return ``call(*arguments)``, called twice.

    Raises:
        AssertionError: it changes its arguments, gives another result the second time, or draws from NumPy's
            global random numbers.
    """
    before, state = copy.deepcopy(arguments), _global_random_state()
    first = call(*arguments)
    second = call(*arguments)
    require_that(identical(before, arguments), f"{subject} changes its input in place; it must work on a copy.")
    require_that(identical(first, second), f"{subject} gives another result the second time with the same input.")
    require_that(
        state == _global_random_state(),
        f"{subject} draws from NumPy's global random numbers; they must come from jerkbench.random_streams.stream.",
    )
    return first


def _global_random_state() -> str:
    name, keys, place, *_ = np.random.get_state()  # noqa: NPY002 - it is looked at, not used
    return f"{name} {hash(np.asarray(keys).tobytes())} {place}"


# Checks of arrays: shape, finite, covariance.

_TOLERANCE = 1e-8
"""Of symmetry and of eigenvalues, with the diagonal scaled to one."""


def require_shape(
    subject: str,
    array: Any,  # noqa: ANN401 - what a plugin returned
    shape: tuple[int, ...],
) -> None:
    """Raise an AssertionError unless ``array`` is a float64 array of ``shape``."""
    require_that(isinstance(array, np.ndarray), f"{subject} is a {type(array).__name__}; it must be a NumPy array.")
    require_that(array.dtype == np.float64, f"{subject} is of {array.dtype}; it must be float64.")
    require_that(array.shape == shape, f"{subject} has shape {array.shape}; it must be {shape}.")


def require_finite(subject: str, array: FloatArray) -> None:
    """Raise an AssertionError where ``array`` holds NaN or infinity."""
    require_that(np.isfinite(array).all(), f"{subject} holds NaN or infinity.")


def require_covariance(subject: str, matrix: FloatArray) -> None:
    """Raise an AssertionError unless ``matrix`` is finite, symmetric and positive semidefinite."""
    require_finite(subject, matrix)
    variances = np.diag(matrix)
    require_that((variances >= 0).all(), f"{subject} has a negative variance, {variances.min(initial=0.0):.3g}.")
    sigma = np.sqrt(np.where(variances > 0, variances, 1.0))
    scaled = matrix / np.outer(sigma, sigma)
    require_that(np.abs(scaled - scaled.T).max(initial=0.0) <= _TOLERANCE, f"{subject} is not symmetric.")
    lowest = np.linalg.eigvalsh(scaled).min(initial=0.0)
    require_that(
        lowest >= -_TOLERANCE * len(matrix), f"{subject} is not positive semidefinite (eigenvalue {lowest:.3g})."
    )


# The methods and attributes that a plugin of each kind cannot do without.


def require_methods(kind: str, plugin: Plugin) -> str:
    """Check that ``plugin`` has the methods of its ``kind``; a filter those of one of the two sorts.

    Returns:
        The name of its class.

    Raises:
        AssertionError: one is not there.
    """
    subject = type(plugin).__name__
    sorts = {kind: REQUIRED[kind][0]} if kind != "filter" else {"kinematic filter": Filter, "estimator": Estimator}
    having = [sort for sort, contract in sorts.items() if kind != "filter" or hasattr(plugin, _methods(contract)[0])]
    require_that(having, f"{subject} has neither axis_model() nor estimate(); it needs one of them.")
    sort = having[0]
    for name in _methods(sorts[sort]):
        has = callable(getattr(plugin, name, None))
        require_that(
            has, f"{subject} has no method {name}(); {article(sort)} {sort} needs it (see jerkbench.contracts)."
        )
    if sort in ("dataset", "disturbance"):
        seeded = getattr(plugin, "seeded", None)
        require_that(isinstance(seeded, bool), f"{subject}.seeded is {seeded!r}; it must be True or False.")
    if sort == "estimator":
        require_that(
            hasattr(plugin, "adaptations"), f"{subject} has no adaptations; it must name those that it accepts."
        )
    return subject


def _methods(contract: type) -> list[str]:
    return [name for name, value in vars(contract).items() if callable(value) and not name.startswith("_")]


# Results of checks as JUnit XML, which machines that build software read.


class JunitCase(NamedTuple):
    """One thing that was checked.

    Attributes:
        group: what it belongs to.
        name: of it.
        failures: sentences; none: it went well.
        remarks: sentences that are no failure.
    """

    group: str
    name: str
    failures: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


def junit(suite: str, cases: Sequence[JunitCase]) -> str:
    """Return the text of a JUnit file with one suite."""
    failed = sum(bool(case.failures) for case in cases)
    root = ET.Element("testsuite", name=suite, tests=str(len(cases)), failures=str(failed), errors="0")
    for case in cases:
        element = ET.SubElement(root, "testcase", classname=case.group, name=case.name)
        for sentence in case.failures:
            ET.SubElement(element, "failure", message=sentence).text = sentence
        if case.remarks:
            ET.SubElement(element, "system-out").text = "\n".join(case.remarks)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


# What plugins are tried on: a small recording that has everything.


_RADIUS_M, _RATE_RADPS, STAND_S, RAMP_S = 8.0, 0.25, 4.0, 4.0
IMU_RATE_HZ, GNSS_RATE_HZ = 50, 5


def small_recording(duration_s: float = 24.0) -> Recording:
    """Return a level body that stands for 4 s and then drives in a circle, with noise on everything; all in ENU."""
    noise = stream(0, "conformance")
    t = np.arange(1, round(duration_s * IMU_RATE_HZ) + 1) / IMU_RATE_HZ
    fix = t[IMU_RATE_HZ // GNSS_RATE_HZ - 1 :: IMU_RATE_HZ // GNSS_RATE_HZ]
    enu, velocity, euler, specific_force = _circle(t)
    gyro = np.column_stack([0 * t, 0 * t, _angle(t)[1]])
    at_fix = _circle(fix)
    p = at_fix[0] + 0.02 * noise.normal(size=(len(fix), 3))
    p[len(fix) // 2, 2] = np.nan  # an axis that is not there
    return Recording(
        name="conformance",
        imu=Imu(t, specific_force + 0.02 * noise.normal(size=(len(t), 3)), gyro + 1e-3 * noise.normal(size=gyro.shape)),
        reference=Reference(
            t, "made for the checks", independent=True, enu_m=enu, velocity_mps=velocity, euler_rad=euler
        ),
        position=Position(fix, p, _covariances(len(fix), 0.02)),
        velocity=Velocity(fix, at_fix[1] + 0.03 * noise.normal(size=(len(fix), 3)), _covariances(len(fix), 0.03)),
        heading=Heading(fix, at_fix[2][:, 2] + 0.01 * noise.normal(size=len(fix)), np.full(len(fix), 0.01)),
        origin=Origin(48.0, 11.0, 500.0),
        static_start_s=STAND_S,
        outages_s=np.array([[14.0, 16.0]]),
    )


def true_attitude(recording: Recording) -> Attitude:
    """Return the attitude of the reference, with the acceleration that belongs to it."""
    euler = np.asarray(recording.reference.euler_rad)
    dcm = dcm_from_euler(euler)
    u = np.einsum("nij,nj->ni", dcm, recording.inertial.accel_mps2) - [0.0, 0.0, GRAVITY_MPS2]
    return Attitude(recording.inertial.t_s, dcm, euler.copy(), u, np.zeros(len(euler), dtype=bool))


def small_timeline(duration_s: float = 24.0) -> tuple[Recording, Timeline]:
    """Return the recording, and its timeline with the attitude of the reference."""
    recording = small_recording(duration_s)
    return recording, build_timeline(recording, true_attitude(recording))


def _angle(t_s: FloatArray) -> FloatArray:
    """Angle on the circle and its two derivatives; the rate grows linearly over the ramp."""
    on = np.clip(t_s - STAND_S, 0.0, RAMP_S)
    after = np.maximum(t_s - STAND_S - RAMP_S, 0.0)
    slope = _RATE_RADPS / RAMP_S
    angle = 0.5 * slope * on**2 + _RATE_RADPS * after
    return np.array([angle, slope * on, np.where((on > 0) & (after <= 0), slope, 0.0)])


def _circle(t_s: FloatArray) -> list[FloatArray]:
    """Position, velocity, Euler angles and specific force in the body, level, heading along the circle."""
    angle, rate, change = _angle(t_s)
    zero = 0 * angle
    position = _RADIUS_M * np.column_stack([np.sin(angle), 1.0 - np.cos(angle), zero])
    velocity = _RADIUS_M * np.column_stack([rate * np.cos(angle), rate * np.sin(angle), zero])
    euler = np.column_stack([zero, zero, np.arctan2(np.sin(angle), np.cos(angle))])
    force = np.column_stack([_RADIUS_M * change, _RADIUS_M * rate**2, zero + GRAVITY_MPS2])
    return [position, velocity, euler, force]


def _covariances(n: int, sigma: float) -> FloatArray:
    return np.tile(sigma**2 * np.eye(3), (n, 1, 1))


# Updates to try an adaptation on.

ROWS = ((0, 1, 2, 3, 4, 5), (0, 1, 2), (3, 4, 5), (4,), (2,), (0, 1, 4))
"""Rows that may be there."""

COVARIANCE_SCALES = ((1.0, 1.0), (1.0, 1e-6), (1e-4, 1e12), (1e6, 1e-6))
"""Of H P- H' and of R: ordinary, a tiny R, an R that is all but infinite, a prior that knows nothing."""

TRIED_STATES = 9
"""Of the filter: three quantities on three axes."""

TRIED_SIGMAS = (0.0, 1.0, 1.0, 100.0)
"""Size of the innovation in standard deviations; the last is an outlier."""


class Update(NamedTuple):
    """The input of `adapt` in one update, besides its memory."""

    innovation: FloatArray
    HPHt: FloatArray
    R: FloatArray
    rows: IntArray


class Prior(NamedTuple):
    """The state before an update, as `adapt_prior` sees it."""

    x: FloatArray
    P: FloatArray
    F: FloatArray
    Q: FloatArray


def every_kind() -> Iterator[tuple[Update, Prior]]:
    """Updates with rows that come and go, outliers, a tiny and a huge R; in the end many of one kind."""
    random = stream(0, "conformance", "adaptation")
    for scales in COVARIANCE_SCALES:
        for sigma in TRIED_SIGMAS:
            for rows in ROWS:
                yield _update(random, rows, scales, sigma)
    for _ in range(40):  # long enough for every window and every counter
        yield _update(random, ROWS[0], COVARIANCE_SCALES[0], 100.0)


def ordinary(random: np.random.Generator, rows: tuple[int, ...], sigma: float) -> tuple[Update, Prior]:
    """An update whose prior and R are of the same size, off by ``sigma`` standard deviations."""
    return _update(random, rows, COVARIANCE_SCALES[0], sigma)


def _update(
    random: np.random.Generator, rows: tuple[int, ...], scales: tuple[float, float], sigma: float
) -> tuple[Update, Prior]:
    m, measured = len(rows), np.array(rows)
    prior = _prior(random, scales[0])
    half = random.normal(size=(m, 2 * m)) / np.sqrt(2 * m)
    HPHt, R = prior.P[np.ix_(measured, measured)], scales[1] * half @ half.T
    innovation = sigma * np.sqrt(np.diag(HPHt + R)) * random.choice([-1.0, 1.0], size=m)
    return Update(innovation, HPHt, 0.5 * (R + R.T), measured), prior


def _prior(random: np.random.Generator, scale: float) -> Prior:
    """A step of a second from a full covariance."""
    half, noise = random.normal(size=(2, TRIED_STATES, 2 * TRIED_STATES)) / np.sqrt(2 * TRIED_STATES)
    F = np.eye(TRIED_STATES) + 0.1 * np.eye(TRIED_STATES, k=3)
    Q = 0.1 * scale * noise @ noise.T
    P = scale * F @ half @ half.T @ F.T + Q
    return Prior(random.normal(size=TRIED_STATES), 0.5 * (P + P.T), F, 0.5 * (Q + Q.T))
