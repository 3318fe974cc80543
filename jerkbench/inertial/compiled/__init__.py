"""The error-state inertial navigation, compiled; `jerkbench.inertial.run` is the definition of right.

All of a run lies in one array m of numbers, at the places of `layout`; w is the same array seen as vectors of eight.
The covariance is a square of rows: navigation (position, velocity, attitude: numbers 0 to 8), then, from number 16 on,
what is known of the sensors. A row is ROW vectors long, and what does not belong to a state is zero.
"""
