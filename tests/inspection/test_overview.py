"""The figure and the lines, of recordings with everything and with next to nothing."""

import dataclasses

import numpy as np
import pytest

from jerkbench.datasets.field import FieldWhite
from jerkbench.inspection.facts import findings_text, overview_figure
from jerkbench.recording import Reference, Velocity
from synthetic import recording_at_rest


def bare():
    recording = recording_at_rest(20.0)
    reference = Reference(np.array([1.0, 2.0]), "nothing", independent=True)
    return dataclasses.replace(recording, position=None, velocity=None, reference=reference)


def wheeled():
    recording = recording_at_rest(20.0)
    wheel = Velocity.along_course(np.arange(100) / 5.0, np.ones(100), 0.1)
    return dataclasses.replace(recording, velocity=wheel, static_start_s=20.0, outages_s=np.array([[5.0, 8.0]]))


@pytest.mark.parametrize("make", [bare, wheeled, lambda: FieldWhite(duration_s=30.0).load(0)])
def test_every_recording_can_be_drawn_and_told(make, tmp_path):
    recording = make()
    path = tmp_path / "overview.png"
    overview_figure(recording).savefig(path, dpi=40)
    assert path.stat().st_size > 5000
    assert "imu noise" in findings_text(recording)


@pytest.mark.parametrize(("known_s", "told"), [(0.0, "no rest"), (3.0, "a rest of 3.0 s")])
def test_a_rest_that_nobody_stated_is_not_denied(known_s, told):
    """It stands still for 20 s; all that is certain is what is known of it."""
    text = findings_text(dataclasses.replace(recording_at_rest(20.0), static_start_s=known_s))
    assert f"{told} at the start is known" in text
    assert "give static_start_s" in text
    assert "imu noise over 20 s of rest" in findings_text(recording_at_rest(20.0, static_start_s=20.0))


def test_the_panels_show_the_recording():
    recording = FieldWhite(duration_s=30.0).load(0)
    figure = overview_figure(recording)
    track = {line.get_label(): line.get_xydata() for line in figure.axes[0].lines}
    np.testing.assert_array_equal(track["measured"], recording.position.enu_m[:, :2])
    np.testing.assert_array_equal(track["reference"], recording.reference.enu_m[:, :2])
    force = {line.get_label(): line.get_ydata() for line in figure.axes[2].lines}
    assert np.mean(force["up"]) == pytest.approx(9.81, abs=0.05)
