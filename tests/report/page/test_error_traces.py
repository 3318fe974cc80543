"""Errors over time as a page carries them."""

import base64
import struct

import numpy as np
import pytest

from jerkbench.report.page.line_styles import line_styles
from jerkbench.report.page.traces import encoded, largest_of_steps


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


def test_a_filter_has_one_colour_and_an_adaptation_one_kind_of_dashes():
    names = ("jerk", "none"), ("jerk", "mtf"), ("bias", "none"), ("bias", "mtf")
    styles = line_styles({str(k): {"filter": a, "adaptation": b} for k, (a, b) in enumerate(names)})
    assert styles["0"]["colour"] == styles["1"]["colour"] != styles["2"]["colour"] == styles["3"]["colour"]
    assert styles["0"]["dash"] == styles["2"]["dash"] != styles["1"]["dash"] == styles["3"]["dash"]
