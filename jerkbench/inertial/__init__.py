"""Parts of an error-state inertial navigation system: pure functions on small arrays, put together by the filters.

Nominal state: position p and velocity v of the IMU in ENU, attitude C (body FLU -> ENU), gyro bias b_g and
accelerometer bias b_a. The error state is truth less estimate, in this order, three each::

    dx = [dp, dv, phi, db_g, db_a],    p = p^ + dp,  v = v^ + dv,  C = Exp(phi) C^,  b = b^ + db

with phi in ENU. All units are SI.

    run                    the definition, a step at a time, of state, mechanisation and update; run_inputs
    compiled_runs          the same compiled, from Python: one run with its trajectory, or many side by side
    kernel                 its loop, over strapdown and aiding (what is measured, and what a correction leaves)
    smoother               the smoother of the same parts
"""
