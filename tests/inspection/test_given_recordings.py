"""The doctor over all given recordings: what it is sure of is true, and mistakes made in them are named rightly."""

import re

import pytest
from given import LOADED, given
from mistakes import MISTAKES, is_found

from jerkbench.inspection.diagnostics import diagnoses, first_diagnoses
from jerkbench.inspection.facts import findings_text

CLOCK, SD = "IMU's clock off by 1 s", "sd of the fixes 10 times too small"

THREE_DRIVES = ("2011_09_30_drive_0018", "2011_09_30_drive_0034", "2011_10_03_drive_0047")

NOT_FOUND = {
    "field": set(),
    "path": set(),
    "drive": set(),
    "comma2k19": set(),
    "xsens": {SD},
    "husky": {SD},
    **dict.fromkeys(THREE_DRIVES, frozenset()),
}
"""Of the ten, as in docs/inspect.md, with why: xsens and husky state placeholders, 10 to 100 times too large, and have
no reference."""

MAY_BE_TOO_LARGE = {
    "drive": {"velocity"},
    "xsens": {"position"},
    "husky": {"position"},
    "beijing_car": {"velocity"},
}
"""What is stated at least four times as large as what shows: RTKLIB's velocities scatter by .004 to .016 m/s at rest,
the bags state placeholders, and .1 m/s of beijing_car is our default. All others are in order."""


@pytest.fixture(scope="module")
def recorded(shared_folder):
    """Loads a recording of those that may not be here, once."""
    loaded, folder = {}, shared_folder / "data"

    def load(name):
        where = {name: path for name, (path, _) in LOADED.items()} | {"taroz": "journeys"}
        where = where.get(name, "kitti" if name in THREE_DRIVES else "")
        if not (folder / where).exists():
            pytest.skip(f"{where} is not in ../shared/data")
        if name not in loaded:
            loaded[name] = given(folder, name)
        return loaded[name]

    return load


def is_right_as_it_is(recording, name):
    """They were read with their units, axes and clocks in order: any sure mistake would be a wrong one."""
    text = findings_text(recording)
    assert "mistakes: none found" in text, name
    told = re.findall(r"to check: The standard deviations of (\w+) may be too large", text)
    assert set(told) == MAY_BE_TOO_LARGE.get(name, set()), name


@pytest.mark.parametrize("name", [*LOADED, "taroz", *THREE_DRIVES])
def test_nothing_is_found_in_real_recordings_as_they_are(recorded, name):
    is_right_as_it_is(recorded(name), name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("files", "name"), [("kitti/*.parquet", "{}"), ("repoimu/*.parquet", "{}"), ("broad/[0-9]*", "broad/{}")]
)
def test_nothing_is_found_in_any_of_many(shared_folder, files, name):
    """28 drives of a car with white fixes, 11 of a stick in a hand, and 20 of a sensor in a hand."""
    stems = sorted(path.stem for path in (shared_folder / "data").glob(files))
    if not stems:
        pytest.skip(f"{files} is not in ../shared/data")
    for stem in stems:
        is_right_as_it_is(given(shared_folder / "data", name.format(stem)), name.format(stem))


@pytest.fixture(scope="module")
def told(recorded):
    """The diagnoses of a recording with a mistake, made once."""
    made = {}

    def diagnosed(name, mistake):
        if (name, mistake) not in made:
            made[name, mistake] = diagnoses(MISTAKES[mistake](recorded(name)))
        return made[name, mistake]

    return diagnosed


@pytest.mark.slow
@pytest.mark.parametrize("name", NOT_FOUND)
def test_mistakes_in_real_recordings_are_found_and_no_clock_is_blamed_for_them(recorded, told, name):
    for mistake in set(MISTAKES) - NOT_FOUND[name]:
        assert is_found(mistake, told(name, mistake)), mistake
    for mistake in NOT_FOUND[name]:
        assert not is_found(mistake, first_diagnoses(MISTAKES[mistake](recorded(name)))), mistake


@pytest.mark.parametrize("name", NOT_FOUND)
def test_the_clock_is_set_right(told, name):
    """As far as the recording itself is right: xsens has .21 s of its own, by the turning of its track."""
    (diagnosis,) = told(name, CLOCK)
    (shift_s,) = re.findall(r"Add ([-+.\d]+) to imu_shift_s", diagnosis.remedy)
    assert float(shift_s) == pytest.approx(-1.0, abs=0.25)


@pytest.mark.parametrize("name", [name for name, missed in NOT_FOUND.items() if SD not in missed])
def test_sigmas_are_scaled_right(told, name):
    (diagnosis,) = told(name, SD)
    (factor,) = re.findall(r"Multiply them by (\d+)", diagnosis.remedy)
    assert float(factor) == pytest.approx(10.0, rel=0.5)
