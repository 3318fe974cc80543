"""Splits: what is tuned on and what is scored on share nothing."""

import dataclasses

import numpy as np
import pytest
from linear_gaussian import Level, LinearGaussian

from jerkbench.campaign.runs import CampaignRuns, space_of
from jerkbench.campaign.search import Budget, Evaluator, objective_of, score, search
from jerkbench.campaign.split import Excerpt, Seeds, by_label, by_seeds, by_time
from jerkbench.errors import PluginError, RecordingError
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.names import job_of_parts
from made_jobs import with_scenario

SINGLE = {"dataset": "field", "attitude": None, "filter": "baseline", "adaptation": "none", "engine": "compiled"}
FEW = Seeds(tune=2, choose=1, test=2)


def cell_of(disturbance="none", dataset="field"):
    return job_of_parts({**SINGLE, "dataset": dataset}, [disturbance], None, Protocol())


def drive(**changed):
    """A recording on which nothing is random, and the cell over it."""
    cell = with_scenario(cell_of(), dataset=Drive(**changed), attitude=Level())
    assert not cell.scenario.seeded
    return cell


@dataclasses.dataclass(frozen=True)
class Drive:
    """A recorded drive of 12 s; after ``spoilt_after_s`` its measurements are nonsense."""

    seeded = False
    spoilt_after_s: float = float("inf")

    def fingerprint(self):
        return ""

    def load(self, seed):
        recording = LinearGaussian(duration_s=12.0).load(7)
        p, v = recording.position, recording.velocity
        z_p, z_v = np.array(p.enu_m), np.array(v.mps)
        z_p[p.t_s > self.spoilt_after_s] += 1e4
        z_v[v.t_s > self.spoilt_after_s] -= 1e3
        position, velocity = dataclasses.replace(p, enu_m=z_p), dataclasses.replace(v, mps=z_v)
        return dataclasses.replace(recording, position=position, velocity=velocity)


def test_by_time_nothing_after_the_share_is_read_while_tuning(tmp_path):
    trials = []
    for name, cell in {"whole": drive(), "spoilt": drive(spoilt_after_s=6.0)}.items():
        evaluator = Evaluator(space_of(cell), objective_of("rmse"), CampaignRuns(tmp_path / name))
        found = search(evaluator, by_time([cell], FEW), Budget(3))
        trials.append((found, score(evaluator, found.setting, by_time([cell], FEW).test)))

    (clean, unseen), (spoilt, spoilt_unseen) = trials
    assert np.array_equal(clean.trials.runs, spoilt.trials.runs)
    assert unseen.tuned[0] != spoilt_unseen.tuned[0]


def test_an_excerpt_ends_where_it_says_and_too_short_a_one_is_refused():
    recording = Drive().load(0)
    early, late = (Excerpt(0.5, late).apply(recording, 0) for late in (False, True))
    for stream in (early.imu, early.position, early.velocity, early.reference):
        assert stream.t_s[-1] <= 6.0
    assert len(early.imu.accel_mps2) == len(early.imu.t_s) == 300
    assert late.imu is recording.imu
    assert np.array_equal(late.reference.scored, recording.reference.t_s >= 6.0)
    with pytest.raises(RecordingError, match="increase share"):
        Excerpt(0.01, late=False).apply(Drive().load(0), 0)


def test_what_is_held_out_is_scored_and_never_tuned_on_and_the_nominal_case_is_in_both():
    cells = [cell_of(name) for name in ("none", "outliers", "imu_bias", "wheel_slip")]
    cases = by_label(cells, "disturbance", ["outliers", "imu_bias"], FEW)
    assert [case.labels.disturbance for case in cases.tune] == ["none", "wheel_slip"]
    assert sorted(case.labels.disturbance for case in cases.test) == ["imu_bias", "none", "outliers"]
    assert cases.split.endswith("; seeds 0 to 1 to tune, 2 to 2 to choose, 3 to 4 to test")
    seen = {draw for case in (*cases.tune, *cases.choose) for draw in case.draws}
    assert not seen & {draw for case in cases.test for draw in case.draws}
    cells = [cell_of(dataset=name) for name in ("field", "field_combined")]
    cases = by_label(cells, "dataset", ["field_combined"], FEW)
    assert [case.labels.dataset for case in cases.tune] == ["field"]
    assert [case.labels.dataset for case in cases.test] == ["field_combined"]


def test_seeds_of_what_is_not_random_and_scenarios_of_two_methods_are_refused():
    with pytest.raises(PluginError, match="use split=time"):
        by_seeds([drive()], FEW)
    other = job_of_parts({**SINGLE, "filter": "jerk"}, ["none"], None, Protocol())
    with pytest.raises(PluginError, match="different values of filter"):
        by_seeds([cell_of(), other], FEW)
