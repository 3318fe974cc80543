"""The study of real drives: blocks from losses that are known, and the page from its committed rows."""

import importlib.util
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

ROOT = Path(__file__).parents[1]
STUDY = ROOT / "experiments" / "real_drives"
ERRORS = {  # of two settings on (a first, a second, b first, b second) [m]
    ("baseline", "none"): [(4.0, 4.0, 4.0, 4.0), (1.0, 2.0, 8.0, 8.0)],
    ("baseline", "mtf"): [(1.0, 8.0, 2.0, 2.0), (2.0, 1.0, 4.0, 4.0)],
    ("jerk", "none"): [(2.0, 2.0, 2.0, 2.0), (np.inf, 9.0, 9.0, 9.0)],
    ("jerk", "mtf"): [(1.0, 1.0, 1.0, 1.0), (9.0, 9.0, 9.0, 9.0)],
}
PLACES = [("a", "first"), ("a", "second"), ("b", "first"), ("b", "second")]


@pytest.fixture(scope="module")
def study():
    spec = importlib.util.spec_from_file_location("drives", STUDY / "drives.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def rows():
    return pd.DataFrame(
        [
            {"drive": drive, "half": half, "filter": model, "adaptation": rule, "trial": trial, "phase": phase}
            | {"position_rmse_m": own[place]}
            for (model, rule), several in ERRORS.items()
            for trial, own in enumerate(several)
            for place, (drive, half) in enumerate(PLACES)
            for phase in range(2)
        ]
    )


def test_what_a_block_is_scored_with_was_chosen_without_it(study, rows):
    """mtf on a: the first half chooses setting 0 (8 m on the second), the second setting 1 (2 m on the first)."""
    found = study.scored(study.losses(rows)).set_index(["filter", "adaptation", "drive"])
    plain, mtf = found.loc[("baseline", "none", "a")], found.loc[("baseline", "mtf", "a")]
    assert np.exp(mtf["halves"]) == pytest.approx(np.sqrt(8.0 * 2.0))
    assert np.exp(mtf["default"]) == pytest.approx(np.sqrt(1.0 * 8.0))
    assert np.exp(mtf["drives"]) == pytest.approx(np.sqrt(1.0 * 8.0))  # b has setting 0 ahead
    assert np.exp(plain["halves"]) == pytest.approx(np.sqrt(1.0 * 2.0))
    assert np.exp(plain["drives"]) == pytest.approx(4.0)  # b chooses setting 0


def test_ratios_are_to_the_plain_filter_tuned_alike(study, rows):
    found = study.ratios(rows).set_index(["filter", "adaptation", "drive"])
    assert found.loc[("baseline", "mtf", "a"), "halves_ratio"] == pytest.approx(4.0 / np.sqrt(2.0))
    assert found.loc[("baseline", "mtf", "b"), "drives_ratio"] == pytest.approx(4.0 / 8.0)
    assert found.loc[("baseline", "none", "b"), "default_ratio"] == pytest.approx(1.0)


def test_a_lost_run_counts_a_hundred_times_the_plain_filter(study, rows):
    table = study.losses(rows)
    assert np.exp(table.loc[("jerk", "none", "a", "first"), 1]) == pytest.approx(400.0)


def test_the_sentences_count_what_the_ratios_say(study, rows):
    first, second = study.sentences(rows)
    assert first.startswith("Of 2 adaptive methods 1 are ahead of the plain filter of their own model")
    assert "(jerk + mtf); 1 are nowhere worse" in first
    assert "jerk without any adaptation has 0.50 to 1.41 of" in second


def test_the_page_is_that_of_its_rows(study):
    page = (STUDY / "README.md").read_text(encoding="utf-8")
    stored = pd.read_parquet(ROOT / "results" / "real_drives" / "losses.parquet")
    assert study.markdown(stored) in page
    for sentence in study.sentences(stored):
        assert sentence in " ".join(page.split())
    assert f"`{study.digest()}`" in page
    known = study.protocol()
    assert set(stored["drive"]) == set(known["drives"])
    assert stored["trial"].max() == known["trials"] - 1
