"""The page for an engineer with one bag, typed as it stands, over a bag and over a car's log."""

import pytest
import yaml

import pages
from commands import verb

HUSKY = ["dataset=husky_bag", "dataset.file=BAG"]
QUICK = {"tune": ["trials=2", "figures=false"], "run": ["figures=false"], "data": []}


@pytest.mark.slow
@pytest.mark.parametrize("recording", ["husky_bag", "drive"])
def test_the_page_goes_well_from_the_log_to_the_settings(recording, shared_folder, tmp_path):
    data = shared_folder / "data"
    log = {"husky_bag": data / "robot_localization/test1.bag", "drive": data / "rtklib_drive_0708"}[recording]
    drive = ["dataset=rtklib", f"dataset.folder={log}"]
    own = drive if recording == "drive" else ["dataset=husky_bag", f"dataset.file={log}"]

    for words in pages.commands("one_bag"):
        typed = [word for word in words if word not in HUSKY]
        typed += own if len(typed) < len(words) else []
        typed = [str(log) if word == "BAG" else word for word in typed]
        done = verb(*typed, *QUICK[typed[0]], cwd=tmp_path)
        assert done.returncode == 0, (typed, done.stderr)

    place = tmp_path / "results/bag/tune/bias-none"
    assert "the first 50 % of the time to tune" in (place / "tuning.md").read_text()
    for path in (place / "export").iterdir():
        assert yaml.safe_load(path.read_text())
