"""The fixed-interval smoother of a kinematic filter, by adjoints.

Forward the filter itself. Backward (Bierman's form of the smoother of Rauch, Tung and Striebel) an adjoint of n numbers
and one of n by n, both zero at the end, from which the smoothed state follows wherever the filtered one is known::

    xs = x - P lambda,                              Ps = P - P Lambda P
    over an update, C = I - K H:
    lambda = C' lambda - H' S^-1 y,                 Lambda = C' Lambda C + H' S^-1 H
    over a step:
    lambda = F' lambda,                             Lambda = F' Lambda F

No covariance is inverted but S, which the filter has factors of. F' Lambda F is the same product for each pair of axes,
as F P F' is. An adaptation that fades P is one that had a larger Q in the step before, and asks for nothing else.

What the backward pass needs stands on a tape: the state after each update, and after so many steps without one. The
states in between are predicted once more from there, and lie in the cache then.

    runs          Python: what is run, and what came out
    loop          the steps, forward and backward: tape, adjoint, smoothed

Source: G. J. Bierman, "Fixed interval smoothing with discrete measurements", International Journal of Control 18(1),
1973, doi:10.1080/00207177308932487.
"""
