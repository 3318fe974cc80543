"""Two functions (timeline, model, runs) -> function that returns the positions [m] of a batch, for dynamax.

JAX compiles both functions in double precision before they are returned, and vectorises them over the runs. Run r uses
input and measurement i + r as its input and measurement i.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from plain_loops import full_model, start

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Filter
from jerkbench.timeline import Timeline

Run = Callable[[], FloatArray]


def lgssm_filter_runs(timeline: Timeline, model: Filter, runs: int) -> Run:
    """Return a batch that uses `lgssm_filter`, with H = 0 in each step without a measurement."""
    from dynamax.linear_gaussian_ssm.inference import lgssm_filter, make_lgssm_params

    F, B, Q, m0, P0, u, z, R = on_device(timeline, model)
    measured = (timeline.update >= 0)[:, None, None]
    (H,) = double(np.where(measured, np.eye(6, len(F)), 0.0))

    def one(u: Any, z: Any, R: Any) -> Any:  # noqa: ANN401 - JAX arrays
        parameters = make_lgssm_params(m0, P0, F, Q, H, R, dynamics_input_weights=B)
        return lgssm_filter(parameters, z, inputs=u).filtered_means[:, :3]

    shift = np.arange(runs)[:, None]
    i, j = (timeline.sample + shift) % len(u), (timeline.update + shift) % len(z)
    return compiled(one, u[i], z[j], R[j])


def scan_runs(timeline: Timeline, model: Filter, runs: int) -> Run:
    """Return a batch that uses the prediction and update of dynamax in a scan, with updates only at measurements."""
    from dynamax.linear_gaussian_ssm.inference import _condition_on, _predict
    from jax import lax

    F, B, Q, m0, P0, u, z, R = on_device(timeline, model)
    H, b, D, d = double(np.eye(6, len(F)), np.zeros(len(F)), np.zeros((6, 3)), np.zeros(6))

    def one(shift: Any) -> Any:  # noqa: ANN401 - JAX arrays
        def step(state: Any, event: Any) -> Any:  # noqa: ANN401 - JAX arrays
            dt, i, j = event
            given, k = u[(i + shift) % len(u)], (j + shift) % len(z)
            moved = lax.cond(dt > 0, lambda: tuple(_predict(*state, F, B, b, Q, given)), lambda: state)
            after = lax.cond(j >= 0, lambda: tuple(_condition_on(*moved, H, D, d, R[k], given, z[k])), lambda: moved)
            return after, after[0][:3]

        return lax.scan(step, (m0, P0), (timeline.dt_s, timeline.sample, timeline.update))[1]

    (shifts,) = double(np.arange(runs))
    return compiled(one, shifts)


def on_device(timeline: Timeline, model: Filter) -> list[Any]:
    """Return F, B, Q, the initial state and covariance, inputs, measurements and their R."""
    given = timeline.measurements
    return double(*full_model(timeline, model), *start(timeline, model), timeline.accel_enu_mps2, given.z, given.R)


def double(*arrays: Any) -> list[Any]:  # noqa: ANN401 - any array type
    """Return the arrays as JAX arrays in double precision."""
    import jax

    jax.config.update("jax_enable_x64", True)  # noqa: FBT003 - signature of JAX
    return [jax.device_put(array) for array in arrays]


def compiled(function: Callable[..., Any], *stacks: Any) -> Run:  # noqa: ANN401 - JAX arrays
    """Compile ``function`` for a batch of all rows of the stacks."""
    import jax

    many = jax.jit(jax.vmap(function)).lower(*stacks).compile()
    return lambda: np.asarray(many(*stacks))
