"""Errors over time as a page carries them."""

import base64
import struct

import numpy as np
import pytest

from jerkbench.report.page_content import encoded, largest_of_steps


def test_of_each_step_the_largest_is_kept():
    t_s = np.array([0.0, 0.4, 0.9, 1.0, 1.5, 2.6, 3.0])
    error_m = np.array([1.0, 5.0, 2.0, 3.0, np.nan, 4.0, 7.0])
    assert largest_of_steps(t_s, error_m, np.arange(4.0)).tolist() == [5.0, 3.0, 7.0]
    empty = largest_of_steps(t_s[4:5], error_m[4:5], np.arange(4.0))
    assert np.isnan(empty).all()


def test_an_error_comes_back_to_a_thousandth_and_what_is_missing_is_missing():
    error_m = np.array([3.2e-6, 0.0171, 0.0172, 1.0, 295.0, 1e7, np.nan, np.inf])
    raw = base64.b64decode(encoded(error_m))
    steps = struct.unpack(f"<{len(error_m)}H", raw)
    back = [1e-9 * 10 ** (18 * (step - 1) / 65534) for step in steps[:-2]]
    assert back == pytest.approx(error_m[:-2].tolist(), rel=1e-3)
    assert steps[-2:] == (0, 65535)
