from datetime import UTC, datetime

import numpy as np
import pymap3d
import pytest

from jerkbench.errors import RecordingError
from jerkbench.io.rtklib import _COLUMNS, read_pos_files, read_rtklib_pos

HEADER = f"% program : RTKLIB\n%  {_COLUMNS.replace(' ', '   ')}\n"
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


PLACE = (40.0, -105.0, 1600.0)
NEAR = [(0.0, 0.0, 0.0), (10.0, -20.0, 0.5), (300.0, 400.0, -3.0)]
SD, SDV = [0.02, 0.01, 0.04, -0.005, 0.003, -0.002], [0.3, 0.2, 0.4, 0.05, -0.06, 0.07]


def dms(degrees):
    size = abs(degrees)
    minutes = (size - int(size)) * 60
    sign = "-" if degrees < 0 else ""
    return f"{sign}{int(size)} {int(minutes)} {(minutes - int(minutes)) * 60:.9f}"


def solution_text(kind, time="GPST", separator=" ", velocity=True):
    """Three fixes near PLACE, a second apart, as RTKLIB's options write them."""
    position, axes = {
        "deg": ("latitude(deg) longitude(deg) height(m)", "neu"),
        "dms": ("latitude(d'\") longitude(d'\") height(m)", "neu"),
        "ecef": ("x-ecef(m) y-ecef(m) z-ecef(m)", "xyz"),
        "baseline": ("e-baseline(m) n-baseline(m) u-baseline(m)", "enu"),
    }[kind]
    sds = [*axes, *(axes[k] + axes[(k + 1) % 3] for k in range(3))]
    names = [time.split()[0], *position.split(), "Q", "ns", *(f"sd{s}(m)" for s in sds), "age(s)", "ratio"]
    names += [f"v{a}(m/s)" for a in axes] + [f"sdv{s}" for s in sds] if velocity else []
    lines = [f"% ref pos   : {PLACE[0]} {PLACE[1]} {PLACE[2]}", "%  " + separator.join(names)]
    for second, enu in enumerate(NEAR):
        stamp = {
            "GPST": f"2025/07/08 19:34:{18 + second}.500",
            "UTC": f"2025/07/08 19:34:{second:02}.500",
            "JST": f"2025/07/09 04:34:{second:02}.500",
            "GPST week": f"2374{separator}{243258.5 + second}",
        }[time]
        lat, lon, height = (float(v) for v in pymap3d.enu2geodetic(*enu, *PLACE))
        ecef = pymap3d.enu2ecef(*enu, *PLACE)
        where = {
            "deg": f"{lat:.12f} {lon:.12f} {height:.6f}",
            "dms": f"{dms(lat)} {dms(lon)} {height:.6f}",
            "ecef": " ".join(f"{v:.6f}" for v in ecef),
            "baseline": " ".join(map(str, enu)),
        }[kind]
        v = {"neu": (1.5, -2.5, 0.25), "enu": (-2.5, 1.5, 0.25)}.get(axes) or pymap3d.enu2uvw(
            -2.5, 1.5, 0.25, *PLACE[:2]
        )
        rest = [where, "1 9", *map(str, SD), "0 0", *(map(str, [*v, *SDV]) if velocity else [])]
        lines.append(stamp + separator + separator.join(" ".join(rest).split()))
    return "\n".join([*lines, ""])


@pytest.mark.parametrize("separator", [" ", ",", "  ;", "\t"])
@pytest.mark.parametrize("time", ["GPST", "UTC", "JST", "GPST week"])
@pytest.mark.parametrize("kind", ["deg", "dms", "ecef", "baseline"])
def test_whatever_rtklib_was_told_to_write_is_the_same_solution(tmp_path, kind, time, separator):
    solution = read_rtklib_pos(written(tmp_path, solution_text(kind, time, separator)))
    start = datetime(2025, 7, 8, 19, 34, 18, 500000, tzinfo=UTC)
    assert solution.gpst_ns.tolist() == [int(start.timestamp() * 10) * 10**8 + k * 10**9 for k in range(3)]
    geodetic = (solution.latitude_deg, solution.longitude_deg, solution.height_m)
    enu = np.column_stack(pymap3d.geodetic2enu(*geodetic, *PLACE))
    np.testing.assert_allclose(enu, NEAR, atol=5e-6)
    np.testing.assert_allclose(solution.velocity_enu_mps, [[-2.5, 1.5, 0.25]] * 3, atol=1e-9)


def test_covariances_of_every_frame(tmp_path):
    """The same six roots mean other axes in each; turned by hand with the rotation of the place."""
    a, b, c, ab, bc, ca = (s * abs(s) for s in SD)
    own = np.array([[a, ab, ca], [ab, b, bc], [ca, bc, c]])
    columns = [pymap3d.ecef2enu(*(np.array(pymap3d.geodetic2ecef(*PLACE)) + axis), *PLACE) for axis in np.eye(3)]
    turns = {"deg": np.eye(3)[[1, 0, 2]], "baseline": np.eye(3), "ecef": np.array(columns).T}
    for kind, turn in turns.items():
        solution = read_rtklib_pos(written(tmp_path, solution_text(kind)))
        np.testing.assert_allclose(solution.covariance_m2[0], turn @ own @ turn.T, atol=1e-11)


def test_vectors_of_ecef_are_along_the_axes_of_the_first_fix_that_is_selected(tmp_path):
    """The first line is on the other side of the Earth; its axes are not those of the others."""
    lines = solution_text("ecef").splitlines()
    far = " ".join(f"{v:.6f}" for v in pymap3d.geodetic2ecef(-40.0, 75.0, 0.0))
    there = " ".join(f"{v:.6f}" for v in pymap3d.enu2ecef(*NEAR[0], *PLACE))
    damaged = [lines[0], lines[1], lines[2].replace(there, far), *lines[3:]]
    solution = read_rtklib_pos(written(tmp_path, "\n".join(damaged))).select(np.array([False, True, True]))
    second = [float(v) for v in pymap3d.enu2geodetic(*NEAR[1], *PLACE)]
    axes = [pymap3d.ecef2enuv(*axis, *second[:2]) for axis in np.eye(3)]
    a, b, c, ab, bc, ca = (s * abs(s) for s in SD)
    own, turn = np.array([[a, ab, ca], [ab, b, bc], [ca, bc, c]]), np.array(axes).T
    np.testing.assert_allclose(solution.covariance_m2, [turn @ own @ turn.T] * 2, atol=1e-12)
    velocity = turn @ np.array(pymap3d.enu2uvw(-2.5, 1.5, 0.25, *PLACE[:2]))
    np.testing.assert_allclose(solution.velocity_enu_mps, [velocity] * 2, atol=1e-9)
    assert (solution.axes_at.latitude_deg, solution.axes_at.longitude_deg) == pytest.approx(tuple(second[:2]))


def cut(tmp_path, kind, *parts, **how):
    """The three fixes of a solution in files of their own: those of ``parts`` in a.pos, b.pos, ..."""
    head, rows = solution_text(kind, **how).splitlines()[:2], solution_text(kind, **how).splitlines()[2:]
    paths = [tmp_path / f"{'abc'[k]}.pos" for k in range(len(parts))]
    for path, part in zip(paths, parts, strict=True):
        path.write_text("\n".join([*head, *(rows[row] for row in part)]))
    return paths


@pytest.mark.parametrize("kind", ["deg", "dms", "ecef", "baseline"])
@pytest.mark.parametrize("parts", [([0, 1], [2]), ([0], [1], [2]), ([0, 1, 2],)])
def test_files_one_after_the_other_are_the_whole_solution(tmp_path, kind, parts):
    joined = read_pos_files(cut(tmp_path, kind, *parts))
    whole = read_rtklib_pos(written(tmp_path, solution_text(kind)))
    for name, values in vars(whole).items():
        if isinstance(values, np.ndarray):
            np.testing.assert_allclose(getattr(joined, name), values, atol=1e-10, err_msg=name)
    assert joined.axes_at == whole.axes_at


def test_files_that_cannot_be_joined_are_a_sentence(tmp_path):
    with pytest.raises(RecordingError, match=r"b\.pos begins before .*a\.pos"):
        read_pos_files(cut(tmp_path, "deg", [1, 2], [0]))
    with pytest.raises(RecordingError, match=r"b\.pos begins before .*a\.pos ends"):
        read_pos_files(cut(tmp_path, "deg", [0, 1], [1, 2]))
    first, _ = cut(tmp_path, "deg", [0, 1], [2])
    text = solution_text("deg", velocity=False).splitlines()
    (tmp_path / "b.pos").write_text("\n".join([*text[:2], text[4]]))
    with pytest.raises(RecordingError, match="velocities"):
        read_pos_files((first, tmp_path / "b.pos"))


def test_south_of_the_equator_minutes_go_south_too(tmp_path):
    text = solution_text("dms").replace(dms(PLACE[0]), "-0 30 36.0")
    assert read_rtklib_pos(written(tmp_path, text)).latitude_deg[0] == pytest.approx(-0.51, abs=1e-12)


def test_a_baseline_from_nowhere_says_what_to_write(tmp_path):
    text = solution_text("baseline").split("\n", 1)[1]
    with pytest.raises(RecordingError, match="degrees or ECEF"):
        read_rtklib_pos(written(tmp_path, text))


GOOD = ROW.format(ms=499)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        (GOOD, "line 1: the header is 'no line that begins with %'"),
        (HEADER.replace("GPST", "BDT") + GOOD, "line 2: the header is '% BDT latitude(deg)"),
        (
            HEADER.replace("latitude(deg)", "x-ecef(m)") + GOOD,
            "line 2: the header lacks y-ecef(m), z-ecef(m), sdx(m), ",
        ),
        (HEADER.replace(" Q ", " ") + GOOD, "line 2: the header lacks Q; let RTKLIB write"),
        (HEADER, "has no rows of data"),
        (HEADER + GOOD + "2025/07/08 19:34:18.749 40.5 -105.25\n", "line 4 has 2 fields; it must have 22"),
        (HEADER + GOOD + "2025/07/08\n", "line 4 has 0 fields"),
        (HEADER + GOOD.replace("40.5", "nan"), "line 3, field 1 is 'nan'"),
        (HEADER + GOOD.replace("1601.5", "16#1.5"), "line 3, field 3 is '16#1.5'"),
        (HEADER + GOOD.replace("19:34", "19:99"), "line 3: '2025/07/08 19:99:18.499' is no GPST stamp"),
        (HEADER + GOOD.replace("2025/07/08 19:34:18.499", "2374 8e5"), "line 3: '2374 8e5' is no GPST stamp"),
        (HEADER + GOOD + GOOD, "line 4: the time does not increase"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, said):
    path = written(tmp_path, text)
    with pytest.raises(RecordingError) as error:
        read_rtklib_pos(path)
    assert said in str(error.value)
    assert str(path) in str(error.value)
