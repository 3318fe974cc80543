"""The answer of an audit: every number is computed again from the rows with pandas."""

import dataclasses
import json

import numpy as np
import pandas as pd
import pytest

from commands import experiment
from jerkbench.campaign.answer import NO_FAULT, answered, judged_audit, kinds_of, pays_from
from jerkbench.campaign.audit import losses_of, write_audit_manifest, write_protocol
from jerkbench.errors import PluginError
from jerkbench.evaluation.drives_and_tunings import statements
from made_rows import SMALL, made_rows

METHOD = ["filter", "adaptation"]
PAGE = experiment("audit/audit_page.py")


def same_as_in_pandas(answer):
    """Compare every number with that of pandas."""
    again, methods = recomputed(answer.rows, answer.rows.protocol), answer.methods
    names = methods["filter"] + " + " + methods["adaptation"]
    for column in ("own_ratio", "best_ratio", "untuned", "worse_3", "worse_100", "lost", "pays_from"):
        np.testing.assert_allclose(methods[column], again[column][names], rtol=1e-5, atol=1e-9, err_msg=column)
    assert answer.said.average.ratio == pytest.approx(again["average"], rel=1e-5)
    assert answer.said.pick.ratio == pytest.approx(again["pick"], rel=1e-5)
    for row in answer.kinds.itertuples():
        assert row.ratio == pytest.approx(again["kinds"].loc[f"{row.filter} + {row.adaptation}", row.kind], rel=1e-5)


@pytest.fixture(scope="module")
def answer():
    ratios = {("jerk", "mtf"): -0.5, ("baseline", "chi2"): 0.6}
    return answered(made_rows(ratio=ratios))


def of(answer, *method):
    return answer.methods.set_index(METHOD).loc[method]


def test_every_number_is_that_of_twenty_lines_of_pandas_and_its_verdict_is_said(answer):
    same_as_in_pandas(answer)
    assert of(answer, "jerk", "mtf")["own_verdict"] == "better"
    assert of(answer, "baseline", "chi2")["own_verdict"] == "worse"
    kinds = answer.kinds[(answer.kinds["adaptation"] == "mtf") & (answer.kinds["filter"] == "jerk")]
    shown = (kinds["verdict"] == "better") & (kinds["kind"] != NO_FAULT)
    assert of(answer, "jerk", "mtf")["better_kinds"] == shown.sum() > 0 == of(answer, "jerk", "mtf")["worse_kinds"]
    assert of(answer, "jerk", "mtf")["pays_from"] == 0.0
    assert np.isnan(of(answer, "baseline", "chi2")["pays_from"])
    assert set(PAGE.take_frame(answer.rows, answer.losses)["take"]) == {"jerk + mtf"}


def test_it_pays_from_the_share_at_which_gain_and_price_are_equal():
    d = np.array([[0.1, 0.1, -0.3, -0.3], [0.1, 0.1, 0.2, 0.2], [-0.1, -0.1, -0.2, -0.2], [-0.2, -0.2, -0.1, -0.1]])
    without = np.array([True, True, False, False])

    np.testing.assert_allclose(pays_from(d, without), [0.25, np.nan, 0.0, 0.0])


def test_another_mixture_is_that_of_its_drives_alone(answer):
    """With no faulty drives left, the ratios are those of the drives without a fault."""
    said = PAGE.reweighted(answer.rows, answer.losses, "faulty=0")
    without = kinds_of(answer.rows)[NO_FAULT]
    y = (answer.losses.methods - answer.losses.plains[answer.losses.model])[:, :, without]

    np.testing.assert_allclose([one.ratio for one in said.same_model_plain], np.exp(y.mean(axis=(1, 2))))
    assert "With outliers=0.2, from 160 weighted drives" in PAGE.reweighted_text(answer.rows, "outliers=0.2")


@pytest.mark.parametrize(
    ("mixture", "said"),
    [("rain=0.1", "There is no kind of fault 'rain'"), ("faulty=often", "gives no share"), ("faulty=2", "cannot be 2")],
)
def test_a_mixture_that_cannot_be_is_refused_in_a_sentence(answer, mixture, said):
    with pytest.raises(PluginError, match=said):
        PAGE.reweighted(answer.rows, answer.losses, mixture)


def test_a_verdict_that_turns_is_a_defect_and_a_method_without_a_row_an_error(answer):
    ratios = {("jerk", "mtf"): 0.5, ("baseline", "chi2"): 0.6}
    other = statements(losses_of(made_rows(seed=1, ratio=ratios)))
    text = PAGE.compared_text(SMALL.methods, answer.said, other, {"outliers": [answer.said, other]})
    assert '2 verdicts are "better" in one audit and "worse" in the other audit, which is a defect' in text
    assert f"On the drives without outliers, adaptation multiplies the error by {PAGE.interval(other.average)}" in text
    assert "- jerk + mtf, own plain filter: better, then worse" in text
    judged = answer.rows.judged
    lacking = dataclasses.replace(answer.rows, judged=judged[judged["adaptation"] != "mtf"])
    with pytest.raises(KeyError, match="mtf"):
        losses_of(lacking)


def test_the_page_and_the_summary_say_the_same(answer, tmp_path):
    folder = tmp_path / "audit-small"
    (tmp_path / "journeys").mkdir()
    (tmp_path / "journeys" / "answer.md").write_text("On 13 journeys it holds.", encoding="utf-8")
    write_protocol(answer.rows.protocol, folder)
    answer.rows.write(folder)
    write_audit_manifest(folder, {"git_commit": "abc+changes"})
    judged_audit(folder)
    PAGE.write_page(answer, folder, "abc+changes")
    page = (folder / "README.md").read_text(encoding="utf-8")
    told = json.loads((folder / "answer.json").read_text(encoding="utf-8"))

    assert all(sentence in page for sentence in PAGE.sentences(answer))
    assert told["sentences"] == answer.sentences
    assert told["against_own_plain"]["better"] == (answer.methods["own_verdict"] == "better").sum()
    assert "On 13 journeys it holds." in page
    assert "was not committed" in page
    assert "doi:10.1016/j.isatra.2010.04.001" in page
    assert (folder / "answer.png").stat().st_size > 10_000
    pd.testing.assert_frame_equal(pd.read_csv(folder / "methods.csv"), answer.methods, check_dtype=False)


def test_an_audit_of_equal_methods_says_nothing():
    said = answered(made_rows(dataclasses.replace(SMALL, resampled_audits=100), seed=2))

    assert not set(said.methods["own_verdict"]) & {"better", "worse"}
    assert said.error.low <= 0.05


def recomputed(folder_or_rows, protocol):
    """Return numbers by name, from the tables drives, judged and tuned."""
    drives, judged, tuned = (getattr(folder_or_rows, name) for name in ("drives", "judged", "tuned"))
    judged = judged.assign(method=judged["filter"].astype(str) + " + " + judged["adaptation"].astype(str))
    judged["loss"] = (
        judged["log_error"].astype(float).fillna(judged["seed"].map(drives.set_index("seed")["level"]) + np.log(100))
    )
    tuned = tuned.assign(method=tuned["filter"].astype(str) + " + " + tuned["adaptation"].astype(str))
    plain = [f"{model} + none" for model in protocol.filters]
    methods = [f"{model} + {name}" for model in protocol.filters for name in protocol.compared]
    cube = judged[judged["tried"] > 1].pivot_table(index=["tried", "tuning", "seed"], columns="method", values="loss")
    narrow, wide = cube.loc[protocol.trials], cube.loc[protocol.plain_trials]
    lowest = tuned[tuned["trial"] < protocol.trials].pivot_table(
        index="tuning", columns="method", values="loss", aggfunc="min"
    )
    widest = tuned[tuned["method"].isin(plain)].pivot_table(
        index="tuning", columns="method", values="loss", aggfunc="min"
    )
    published = [m for m in methods if protocol.adaptations[m.split(" + ")[1]] != "own"]
    best = pd.concat(
        [narrow.xs(r, level="tuning", drop_level=False)[lowest.loc[r, plain].idxmin()] for r in lowest.index]
    )
    pick = pd.concat(
        [narrow.xs(r, level="tuning", drop_level=False)[lowest.loc[r, published].idxmin()] for r in lowest.index]
    )
    with_more = pd.concat([wide.xs(r, level="tuning", drop_level=False)[widest.loc[r].idxmin()] for r in widest.index])
    own = pd.DataFrame({m: narrow[m] - narrow[f"{m.split(' + ')[0]} + none"] for m in methods})
    faults = drives.set_index("seed").filter(like="drawn.fault.").notna().rename(columns=lambda name: name[12:])
    drive = own.groupby("seed").mean()
    kinds = {"no fault": ~faults.any(axis=1), **{kind: faults[kind] for kind in faults}}
    by_kind = {kind: np.exp(drive[member.reindex(drive.index)].mean()) for kind, member in kinds.items()}
    at_defaults = judged[judged["tried"] == 1].pivot_table(index="seed", columns="method", values="loss").mean()
    price, gain = (drive[kinds["no fault"].reindex(drive.index) == none].mean() for none in (True, False))
    return {
        "own_ratio": np.exp(own.mean()),
        "best_ratio": np.exp((narrow[methods].sub(best, axis=0)).mean()),
        "average": np.exp(own[published].mean().mean()),
        "pick": np.exp((pick - with_more).mean()),
        "untuned": np.exp(
            pd.Series({m: at_defaults[m] - narrow[f"{m.split(' + ')[0]} + none"].mean() for m in methods})
        ),
        "worse_3": (drive > np.log(1.03)).mean(),
        "worse_100": (drive > np.log(2)).mean(),
        "lost": judged[judged["tried"] == protocol.trials]
        .groupby("method")["log_error"]
        .apply(lambda e: e.isna().mean())[methods],
        "pays_from": (price.clip(lower=0) / (price.clip(lower=0) - gain)).where(gain < 0),
        "kinds": pd.DataFrame(by_kind),
    }
