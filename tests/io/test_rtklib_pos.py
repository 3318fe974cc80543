from datetime import UTC, datetime

import numpy as np
import pymap3d
import pytest

from jerkbench.errors import RecordingError
from jerkbench.io.columns import TextFormat
from jerkbench.io.readers import read_columns
from jerkbench.io.tracks import (
    _POS_HEADER,
    POS_COVARIANCE,
    POS_POSITION,
    POS_VELOCITY,
    POS_VELOCITY_COVARIANCE,
    read_pos,
)

HEADER = f"% program : RTKLIB\n%  {_POS_HEADER.replace(' ', '   ')}\n"
ROW = (
    "2025/07/08 19:34:18.{ms} 40.5 -105.25 1601.5 2 21 0.02 0.01 0.04 -0.005 0.003 -0.002 0 0"
    " 1.5 -2.5 0.25 0.3 0.2 0.4 0.05 -0.06 0.07\n"
)


def written(tmp_path, text):
    path = tmp_path / "drive.pos"
    path.write_text(text)
    return path


def read(path):
    return read_columns((path,), TextFormat())


def stamps_ns(columns):
    return columns.dates_ns("t", 18.0).tolist()


def covariances(columns, names=POS_COVARIANCE):
    return columns.numbers(names)[:, [0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(-1, 3, 3)


def test_north_east_up_becomes_east_north_up_and_roots_have_signs(tmp_path):
    solution = read(written(tmp_path, HEADER + ROW.format(ms=499) + ROW.format(ms=749)))
    start = datetime(2025, 7, 8, 19, 34, 0, 499000, tzinfo=UTC)
    first = int(start.timestamp() * 1000) * 10**6
    assert stamps_ns(solution) == [first, first + 250 * 10**6]
    np.testing.assert_array_equal(solution.numbers(POS_POSITION)[0], [40.5, -105.25, 1601.5])
    assert solution.numbers(["quality"]).ravel().tolist() == [2, 2]
    np.testing.assert_array_equal(solution.numbers(POS_VELOCITY)[0], [-2.5, 1.5, 0.25])
    solution = read(written(tmp_path, HEADER + ROW.format(ms=499)))
    # written out by hand: ee, nn, uu squared; ne = -.005^2, eu = .003^2, un = -.002^2
    position = [[1e-4, -25e-6, 9e-6], [-25e-6, 4e-4, -4e-6], [9e-6, -4e-6, 16e-4]]
    velocity = [[0.04, 0.0025, -0.0036], [0.0025, 0.09, 0.0049], [-0.0036, 0.0049, 0.16]]
    np.testing.assert_allclose(covariances(solution)[0], position, rtol=1e-12)
    np.testing.assert_allclose(covariances(solution, POS_VELOCITY_COVARIANCE)[0], velocity, rtol=1e-12)


AT = (40.0, -105.0, 1600.0)
NEAR = [(0.0, 0.0, 0.0), (10.0, -20.0, 0.5), (300.0, 400.0, -3.0)]
SD, SDV = [0.02, 0.01, 0.04, -0.005, 0.003, -0.002], [0.3, 0.2, 0.4, 0.05, -0.06, 0.07]


def solution_text(kind, time="GPST", separator=" ", velocity=True):
    """Three fixes near AT, a second apart, as RTKLIB's options write them."""
    position, axes = {
        "deg": ("latitude(deg) longitude(deg) height(m)", "neu"),
        "ecef": ("x-ecef(m) y-ecef(m) z-ecef(m)", "xyz"),
    }[kind]
    sds = [*axes, *(axes[k] + axes[(k + 1) % 3] for k in range(3))]
    names = [time.split()[0], *position.split(), "Q", "ns", *(f"sd{s}(m)" for s in sds), "age(s)", "ratio"]
    names += [f"v{a}(m/s)" for a in axes] + [f"sdv{s}" for s in sds] if velocity else []
    lines = [f"% ref pos   : {AT[0]} {AT[1]} {AT[2]}", "%  " + separator.join(names)]
    for second, enu in enumerate(NEAR):
        stamp = {
            "GPST": f"2025/07/08 19:34:{18 + second}.500",
            "UTC": f"2025/07/08 19:34:{second:02}.500",
            "GPST week": f"2374{separator}{243258.5 + second}",
        }[time]
        lat, lon, height = (float(v) for v in pymap3d.enu2geodetic(*enu, *AT))
        ecef = pymap3d.enu2ecef(*enu, *AT)
        where = {
            "deg": f"{lat:.12f} {lon:.12f} {height:.6f}",
            "ecef": " ".join(f"{v:.6f}" for v in ecef),
        }[kind]
        v = (1.5, -2.5, 0.25) if axes == "neu" else pymap3d.enu2uvw(-2.5, 1.5, 0.25, *AT[:2])
        rest = [where, "1 9", *map(str, SD), "0 0", *(map(str, [*v, *SDV]) if velocity else [])]
        lines.append(stamp + separator + separator.join(" ".join(rest).split()))
    return "\n".join([*lines, ""])


@pytest.mark.parametrize("separator", [" ", ",", "  ;", "\t"])
@pytest.mark.parametrize("time", ["GPST", "UTC", "GPST week"])
@pytest.mark.parametrize("kind", ["deg", "ecef"])
def test_whatever_rtklib_was_told_to_write_is_the_same_solution(tmp_path, kind, time, separator):
    solution = read(written(tmp_path, solution_text(kind, time, separator)))
    start = datetime(2025, 7, 8, 19, 34, 0, 500000, tzinfo=UTC)
    assert stamps_ns(solution) == [int(start.timestamp() * 10) * 10**8 + k * 10**9 for k in range(3)]
    enu = np.column_stack(pymap3d.geodetic2enu(*solution.numbers(POS_POSITION).T, *AT))
    np.testing.assert_allclose(enu, NEAR, atol=5e-6)
    np.testing.assert_allclose(solution.numbers(POS_VELOCITY), [[-2.5, 1.5, 0.25]] * 3, atol=5e-4)  # at each fix


def test_covariances_of_every_frame(tmp_path):
    """The same six roots mean other axes in each; turned by hand with the rotation of the place."""
    a, b, c, ab, bc, ca = (s * abs(s) for s in SD)
    own = np.array([[a, ab, ca], [ab, b, bc], [ca, bc, c]])
    columns = [pymap3d.ecef2enu(*(np.array(pymap3d.geodetic2ecef(*AT)) + axis), *AT) for axis in np.eye(3)]
    turns = {"deg": np.eye(3)[[1, 0, 2]], "ecef": np.array(columns).T}
    for kind, turn in turns.items():
        solution = read(written(tmp_path, solution_text(kind)))
        np.testing.assert_allclose(covariances(solution)[0], turn @ own @ turn.T, atol=1e-11)


def cut(tmp_path, kind, *parts, **how):
    """The three fixes of a solution in files of their own: those of ``parts`` in a.pos, b.pos, ..."""
    head, rows = solution_text(kind, **how).splitlines()[:2], solution_text(kind, **how).splitlines()[2:]
    paths = [tmp_path / f"{'abc'[k]}.pos" for k in range(len(parts))]
    for path, part in zip(paths, parts, strict=True):
        path.write_text("\n".join([*head, *(rows[row] for row in part)]))
    return paths


@pytest.mark.parametrize("kind", ["deg", "ecef"])
@pytest.mark.parametrize("parts", [([0, 1], [2]), ([0], [1], [2]), ([0, 1, 2],)])
def test_files_one_after_the_other_are_the_whole_solution(tmp_path, kind, parts):
    joined = read_columns(cut(tmp_path, kind, *parts), TextFormat())
    whole = read(written(tmp_path, solution_text(kind)))
    assert stamps_ns(joined) == stamps_ns(whole)
    names = whole.names[1:]
    np.testing.assert_allclose(joined.numbers(names), whole.numbers(names), atol=1e-10)


def test_files_that_cannot_be_joined_are_a_sentence(tmp_path):
    first, _ = cut(tmp_path, "deg", [0, 1], [2])
    text = solution_text("deg", velocity=False).splitlines()
    (tmp_path / "b.pos").write_text("\n".join([*text[:2], text[4]]))
    with pytest.raises(RecordingError, match="different numbers of columns"):
        read_columns((first, tmp_path / "b.pos"), TextFormat())


GOOD = ROW.format(ms=499)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        (GOOD, "line 1: the header is 'no line that starts with %'"),
        (HEADER.replace("GPST", "JST") + GOOD, "line 2: the header is '% JST latitude(deg)"),
        (HEADER.replace("latitude(deg)", "e-baseline(m)") + GOOD, "positions in ECEF or"),
        (
            HEADER.replace("latitude(deg)", "x-ecef(m)") + GOOD,
            "line 2: the header lacks y-ecef(m), z-ecef(m), sdx(m), ",
        ),
        (HEADER.replace(" Q ", " ") + GOOD, "line 2: the header lacks Q; let RTKLIB write"),
        (HEADER, "has no rows of data"),
        (
            HEADER + GOOD + "2025/07/08 19:34:18.749 40.5 -105.25\n",
            "row 2, column height(m): 'nan' is not a finite number",
        ),
        (HEADER + GOOD + "2025/07/08\n", "row 2, column t: 'nan' is not a date"),
        (HEADER + GOOD.replace("40.5", "nan"), "row 1, column latitude(deg): 'nan' is not a finite number"),
        (HEADER + GOOD.replace("1601.5", "16#1.5"), "row 1, column height(m): '16#1.5' is not a number"),
        (HEADER + GOOD.replace("19:34", "19:99"), "row 1, column t: '2025-07-08 19:99:18.499' is not a date"),
        (HEADER + GOOD.replace("2025/07/08", "July"), "the first columns are not GPST stamps"),
        (
            HEADER.replace("latitude(deg)", "latitude(d'\")") + GOOD,
            "decimal degrees (out-degform=deg)",
        ),
        (HEADER + GOOD + GOOD, "row 2: the time is not later than in the row above"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, said):
    path = written(tmp_path, text)
    with pytest.raises(RecordingError) as error:
        read_pos(path)
    assert said in str(error.value)
    assert str(path) in str(error.value)
