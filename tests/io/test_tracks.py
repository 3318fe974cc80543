"""NMEA and GPX are read as positions, as people's receivers write them."""

from functools import reduce

import numpy as np
import pytest

from jerkbench.datasets.table import Tables
from jerkbench.errors import RecordingError

# The first two are the example of the NMEA documents, with the checksum printed there.
PRINTED = """\
$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47
$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A
"""

GPX = """\
<?xml version="1.0"?>
<gpx version="1.1" creator="a phone" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>
<trkpt lat="48.1173" lon="11.5167"><ele>545.4</ele><time>2024-05-14T12:35:19Z</time><hdop>0.9</hdop></trkpt>
<trkpt lat="48.1174" lon="11.5167"><time>2024-05-14T12:35:20.500Z</time></trkpt>
<trkpt lat="48.1175" lon="11.5167"/>
</trkseg></trk></gpx>
"""


def nmea(body):
    return f"${body}*{reduce(lambda a, b: a ^ b, body.encode(), 0):02X}\n"


def loaded(folder, name, **parameters):
    return Tables(str(folder), imu_file="", position_file=name, **parameters).load(0)


def test_the_printed_example_of_nmea_is_the_place_the_time_and_the_speed_that_it_says(tmp_path):
    later = nmea("GNGGA,123520.500,4807.038,S,01131.000,W,2,08,0.9,545.4,M,46.9,M,,")
    (tmp_path / "log.nmea").write_text(PRINTED + nmea("GPGST,123519,,,,,1.5,2.5,4,") + later)
    velocity = {"velocity_file": "log.nmea", "velocity_columns": ("ve", "vn", "3")}
    table = loaded(tmp_path, "log.nmea", position_sigma=("sigma_east", "sigma_north", "sigma_up"), drop_leaps=False,
                   origin=(48 + 7.038 / 60, 11 + 31 / 60, 545.4 + 46.9), **velocity)  # fmt: skip

    assert table.start_utc.isoformat() == "2094-03-23T12:35:19+00:00"
    np.testing.assert_allclose(table.position.t_s, [0.0, 1.5])
    np.testing.assert_allclose(table.position.enu_m[0], 0, atol=1e-6)
    np.testing.assert_allclose(np.diag(table.position.covariance_m2[0]), [2.5**2, 1.5**2, 4.0**2])
    knots = 22.4 * 1852 / 3600
    expected = knots * np.array([np.sin(np.radians(84.4)), np.cos(np.radians(84.4))])
    np.testing.assert_allclose(table.velocity.mps[0, :2], expected, rtol=1e-12)


def test_a_damaged_sentence_is_dropped_and_counted_and_a_log_goes_on_over_midnight(tmp_path):
    wrong = nmea("GPGGA,123520,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,").replace("4807", "4907")
    lost = nmea("GPGGA,123521,,,,,0,,,,M,,M,,")
    good = nmea("GPGGA,123522,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,")
    (tmp_path / "log.txt").write_text(PRINTED + wrong + lost + good)
    recording = loaded(tmp_path, "log.txt")
    np.testing.assert_allclose(recording.position.t_s, [0.0, 3.0])
    assert "log.txt: 1 sentences have a wrong checksum and are dropped." in recording.notes
    assert "log.txt: 1 of 3 reports have no fix or no time and are dropped." in recording.notes
    times = ("235959.000", "000000.500", "000001.000")
    lines = [nmea(f"GPGGA,{time},4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,") for time in times]
    lines.insert(2, nmea("GPZDA,000000.500,29,02,2024,,"))
    (tmp_path / "log.nmea").write_text("".join(lines))
    recording = loaded(tmp_path, "log.nmea")
    np.testing.assert_allclose(recording.position.t_s, [0.0, 1.5, 2.0])
    assert recording.start_utc.isoformat() == "2024-02-28T23:59:59+00:00"


def test_a_gpx_track_is_read(tmp_path):
    (tmp_path / "track.gpx").write_text(GPX)
    recording = loaded(tmp_path, "track.gpx", origin=(48.1173, 11.5167, 545.4))
    np.testing.assert_allclose(recording.position.t_s, [0.0, 1.5])
    np.testing.assert_allclose(recording.position.enu_m[0], 0, atol=1e-6)
    assert recording.start_utc.isoformat() == "2024-05-14T12:35:19+00:00"
    assert any("1 of 3 reports" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.nmea", PRINTED.splitlines()[0], "has no date"),
        ("a.gpx", "<gpx><trk>", "cannot be read as GPX"),
        ("a.gpx", "<gpx></gpx>", "no report has both a position and a time"),
        ("a.gpx", "<!DOCTYPE a [<!ENTITY b 'c'>]><gpx></gpx>", "has XML entities"),
    ],
)
def test_what_is_no_track_is_a_sentence(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)

    with pytest.raises(RecordingError, match=said):
        loaded(tmp_path, name)


@pytest.mark.parametrize("epoch", ["gps", "unix"])
def test_stamps_as_dates_as_week_and_time_and_as_seconds_are_the_same(tmp_path, epoch):
    tow_s = 243_258.5 + np.arange(4)
    gps_s = 2374 * 604_800 + tow_s
    dates = np.datetime64("1980-01-06", "ns") + np.round((gps_s - 18) * 1e9).astype("timedelta64[ns]")
    stamps = {
        "both": [f"2374:{t}" for t in tow_s],
        "dates": [f"{date}Z" for date in dates.astype("datetime64[ms]")],
        "seconds": gps_s if epoch == "gps" else (dates - np.datetime64(0, "s")) / np.timedelta64(1, "s"),
    }
    for name, column in stamps.items():
        rows = [f"{t},48.1,11.5,{500 + k}" for k, t in enumerate(column)]
        (tmp_path / f"{name}.csv").write_text("\n".join(["t,latitude,longitude,height", *rows]))
    recordings = [loaded(tmp_path, f"{name}.csv", epoch=epoch) for name in stamps]

    assert len({recording.start_utc for recording in recordings}) == 1
    for recording in recordings:
        np.testing.assert_allclose(recording.position.t_s, np.arange(4), atol=1e-6)


def test_a_file_without_names_and_a_reference_with_sigmas_of_zero_are_taken(tmp_path):
    (tmp_path / "imu.csv").write_text("\n".join(f"{k / 100},0,0,9.8,0,0,0" for k in range(200)))
    (tmp_path / "fix.csv").write_text("t,latitude,longitude,height\n" + "\n".join(f"{k},48,11,5" for k in range(2)))
    columns = {"imu_time": "1", "imu_accel": ("2", "3", "4"), "imu_gyro": ("5", "6", "7")}
    recording = Tables(str(tmp_path), position_file="fix.csv", **columns).load(0)
    assert (len(recording.imu.t_s), len(recording.position.t_s)) == (200, 2)
    header = "% GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age ratio"
    rows = [f"2024/05/14 12:35:{19 + k}.000 48.1 11.5 500 1 9 0 0 0 0 0 0 0 0" for k in range(3)]
    (tmp_path / "truth.pos").write_text("\n".join([header, *rows]))
    dates = "\n".join(f"2024-05-14T12:35:0{k}Z,48.1,11.5,500" for k in range(3))
    (tmp_path / "fix.csv").write_text("t,latitude,longitude,height\n" + dates)
    recording = loaded(tmp_path, "fix.csv", reference_file="truth.pos")
    np.testing.assert_allclose(recording.reference.enu_m, 0, atol=1e-6)


def test_gns_has_heights_and_sentences_are_found_between_binary_messages(tmp_path):
    text = "".join(
        nmea(f"GNGNS,1235{k:02},4807.{k:03},N,01131.000,E,RAN,12,0.9,545.4,46.9,,")
        + nmea(f"GNRMC,1235{k:02},A,4807.{k:03},N,01131.000,E,0.0,,140524,,")
        for k in range(9)
    )
    binary = b"".join(b"\xb5b\x01\x07\x00$\x00" + line.encode() for line in text.splitlines(keepends=True))
    (tmp_path / "log.ubx").write_bytes(binary)
    (tmp_path / "log.nmea").write_text(text)
    for name in ("log.ubx", "log.nmea"):
        recording = loaded(tmp_path, name)
        assert len(recording.position.t_s) == 9
        assert recording.origin.height_m == pytest.approx(545.4 + 46.9)
