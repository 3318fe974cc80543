"""Parts of an error-state inertial navigation system: pure functions on small arrays, put together by the filters.

Nominal state: position p and velocity v of the IMU in ENU, attitude C (body FLU -> ENU), gyro bias b_g and
accelerometer bias b_a. The error state is truth less estimate, in this order, three each::

    dx = [dp, dv, phi, db_g, db_a],    p = p^ + dp,  v = v^ + dv,  C = Exp(phi) C^,  b = b^ + db

with phi in ENU. All units are SI.
"""
