"""Eight runs of the error-state navigation side by side, over the kernel of kinematic filters.

The error state has five quantities on three axes, in the kernel's order, and position and velocity in ENU of the IMU
are its first six: innovation, adaptation, update and sums are the kernel's own. The first six places of its state hold
the nominal position and velocity, the others the estimated error until it is put into the nominal state.

What has another H (lever arms, velocity of the body, constraints), more states or another Earth goes one run at a time
(`jerkbench.inertial.compiled`).

    runs          Python: what is run, and what came out
    loop          the steps: mechanise, propagate, the kernel's update, take_heading, feed_back
"""
