from datetime import UTC, datetime

import numpy as np
import pytest

from jerkbench.errors import RecordingError
from jerkbench.readers.rtklib_pos import COLUMNS, read_rtklib_pos

HEADER = f"% program : RTKLIB\n%  {COLUMNS.replace(' ', '   ')}\n"
ROW = (
    "2025/07/08 19:34:18.{ms} 40.5 -105.25 1601.5 2 21 0.02 0.01 0.04 -0.005 0.003 -0.002 0 0"
    " 1.5 -2.5 0.25 0.3 0.2 0.4 0.05 -0.06 0.07\n"
)


def written(tmp_path, text):
    path = tmp_path / "drive.pos"
    path.write_text(text)
    return path


def test_north_east_up_of_the_file_becomes_east_north_up(tmp_path):
    solution = read_rtklib_pos(written(tmp_path, HEADER + ROW.format(ms=499) + ROW.format(ms=749)))
    start = datetime(2025, 7, 8, 19, 34, 18, 499000, tzinfo=UTC)
    assert solution.gpst_ns.tolist() == [
        int(start.timestamp() * 1000) * 10**6,
        int(start.timestamp() * 1000 + 250) * 10**6,
    ]
    assert (solution.latitude_deg[0], solution.longitude_deg[0], solution.height_m[0]) == (40.5, -105.25, 1601.5)
    assert solution.quality.tolist() == [2, 2]
    np.testing.assert_array_equal(solution.velocity_enu_mps[0], [-2.5, 1.5, 0.25])
    assert solution.speed_mps[0] == pytest.approx(8.5**0.5)


def test_covariances_take_sign_and_square_of_the_roots(tmp_path):
    solution = read_rtklib_pos(written(tmp_path, HEADER + ROW.format(ms=499)))
    # written out by hand: ee, nn, uu squared; ne = -.005^2, eu = .003^2, un = -.002^2
    position = [[1e-4, -25e-6, 9e-6], [-25e-6, 4e-4, -4e-6], [9e-6, -4e-6, 16e-4]]
    velocity = [[0.04, 0.0025, -0.0036], [0.0025, 0.09, 0.0049], [-0.0036, 0.0049, 0.16]]
    np.testing.assert_allclose(solution.covariance_m2[0], position, rtol=1e-12)
    np.testing.assert_allclose(solution.velocity_covariance_m2ps2[0], velocity, rtol=1e-12)


def test_rows_can_be_selected(tmp_path):
    solution = read_rtklib_pos(written(tmp_path, HEADER + ROW.format(ms=499) + ROW.format(ms=749)))
    second = solution.select(np.array([False, True]))
    assert second.gpst_ns.tolist() == [solution.gpst_ns[1]]
    assert second.covariance_m2.shape == (1, 3, 3)


GOOD = ROW.format(ms=499)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        (GOOD, "line 1: the header is 'no line that begins with %'"),
        (HEADER.replace("GPST", "UTC") + GOOD, "line 2: the header is '% UTC latitude(deg)"),
        (HEADER.replace("latitude(deg)", "x-ecef(m)") + GOOD, "line 2: the header is '% GPST x-ecef(m)"),
        (HEADER, "has no rows of data"),
        (HEADER + GOOD + "2025/07/08 19:34:18.749 40.5 -105.25\n", "line 4 has 2 fields; it must have 22"),
        (HEADER + GOOD + "2025/07/08\n", "line 4 has 0 fields"),
        (HEADER + GOOD.replace("40.5", "nan"), "line 3, field 1 is 'nan'"),
        (HEADER + GOOD.replace("1601.5", "16#1.5"), "line 3, field 3 is '16#1.5'"),
        (HEADER + GOOD.replace("19:34", "19:99"), "line 3: '2025/07/08 19:99:18.499' is no GPST stamp"),
        (HEADER + GOOD.replace("2025/07/08 19:34:18.499", "2374 243258.499"), "line 3: '2374 243258.499' is no GPST"),
        (HEADER + GOOD + GOOD, "line 4: the time does not increase"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, said):
    path = written(tmp_path, text)
    with pytest.raises(RecordingError) as error:
        read_rtklib_pos(path)
    assert said in str(error.value)
    assert str(path) in str(error.value)
