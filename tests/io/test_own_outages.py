"""Gaps of the fixes that a log has itself are outages, of a table and of a bag."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from jerkbench.datasets.rosbag import RosBag
from jerkbench.datasets.table import Tables
from jerkbench.errors import PluginError, RecordingError
from jerkbench.io.bag_writing import write_bag
from jerkbench.io.sanitiser import with_recorded_outages

FIX_S = np.concatenate([np.arange(0, 20, 0.5), np.arange(28, 40, 0.5), np.arange(46, 60, 0.5)])
START_S = 1_715_695_200
GAPS_S = [[19.5, 28.0], [39.5, 46.0]]


@pytest.fixture
def log(tmp_path):
    """Fixes at 2 Hz with gaps of 8.5 and 6.5 s, beside an IMU and a truth that has none."""
    t_s = np.arange(6000) / 100
    imu = np.column_stack([START_S + t_s, np.random.default_rng(0).normal([0, 0, 9.8, 0, 0, 0], 0.1, (len(t_s), 6))])
    pd.DataFrame(imu, columns=["t", "ax", "ay", "az", "gx", "gy", "gz"]).to_csv(tmp_path / "imu.csv", index=False)
    for name, stamps_s in (("fix", FIX_S), ("truth", t_s[::10])):
        places = {"latitude": 48 + 1e-6 * stamps_s, "longitude": 11 + 0 * stamps_s, "height": 5.0}
        pd.DataFrame({"t": START_S + stamps_s, **places}).to_csv(tmp_path / f"{name}.csv", index=False)
    reference = {"reference_file": "truth.csv", "reference_frame": "geodetic"}
    reference["reference_position"] = ("latitude", "longitude", "height")
    return Tables(str(tmp_path), position_file="fix.csv", **reference)


@pytest.mark.parametrize(("shortest_s", "gaps_s"), [(0.0, []), (5.0, GAPS_S), (7.0, GAPS_S[:1]), (9.0, [])])
def test_gaps_that_are_longer_are_outages(log, shortest_s, gaps_s):
    recording = dataclasses.replace(log, outage_s=shortest_s).load()

    np.testing.assert_allclose(recording.outages_s, np.reshape(gaps_s, (-1, 2)), atol=1e-6)


def test_those_of_a_bag_too_and_none_is_counted_twice(log, tmp_path):
    write_bag(log.load(), tmp_path / "plain.bag")
    write_bag(dataclasses.replace(log, outage_s=5.0).load(), tmp_path / "told.bag")
    for name in ("plain", "told"):
        recording = RosBag(str(tmp_path / f"{name}.bag"), outage_s=5.0).load(0)
        np.testing.assert_allclose(recording.outages_s, GAPS_S, atol=1e-6)


def test_gaps_in_which_the_reference_knows_nothing_and_negative_gaps_are_refused(log):
    own = dataclasses.replace(log, reference_file="", reference_position=())
    with pytest.raises(RecordingError, match="the reference has no position in any of the 2 gaps"):
        with_recorded_outages(own.load(), 5.0)
    with pytest.raises(PluginError, match="outage_s"):
        dataclasses.replace(log, outage_s=-1.0)
