"""Error-state inertial navigation: functions on small arrays, from which the inertial filters are built.

The nominal state consists of position p and velocity v of the IMU in ENU, attitude C (rotation from the body frame FLU
to ENU), gyro bias b_g and accelerometer bias b_a. The error state is the truth minus the estimate. The error state
consists of five vectors with three components each, and its attitude error phi is in ENU::

    dx = [dp, dv, phi, db_g, db_a],    p = p^ + dp,  v = v^ + dv,  C = Exp(phi) C^,  b = b^ + db

All quantities are in SI units. The package contains these modules::

    run_inputs             the inputs of a run: events, settings and initial state
    state                  the nominal state, its propagation, and the propagation of the error state
    update                 measurement functions and the correction
    run                    the reference implementation of the filter and of the smoother in NumPy
    compiled_runs          compiled runs, based on strapdown (propagation) and aiding (updates)
"""
