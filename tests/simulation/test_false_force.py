import numpy as np
import pytest

from jerkbench.simulation.truth import draw_impacts, impact_force, inner_times, rut_force

T = np.arange(1001) / 100
INNER = inner_times(T, 10)


def test_samples_are_the_mean_of_the_decaying_force():
    sample = rut_force(INNER, (5.0,), (0.7, 0.4, 1.0), 0.3).mean(axis=1)
    decay = np.exp(-np.maximum(T - 5.0, 0) / 0.3)
    mean = 0.3 * (decay[:-1] - decay[1:]) / 0.01 * (T[1:] > 5.0)
    np.testing.assert_allclose(sample, np.outer(mean, [0.7, 0.4, 1.0]), atol=1e-5)


@pytest.mark.parametrize("start", [2.0, 2.0037])
def test_an_impact_is_a_half_sine_upwards(start):
    force = impact_force(INNER, np.array([start]), 45.0)
    impulse = force.sum(axis=(0, 1)) * 0.001
    np.testing.assert_allclose(impulse, [0.0, 0.0, 45.0 * 0.02 * 2 / np.pi], rtol=0.01)
    assert force.max() == pytest.approx(45.0, rel=0.01)
    assert not force[np.abs(INNER - (start + 0.01)) > 0.01].any()


def test_impacts_are_a_poisson_process():
    counts, times = [], []
    for seed in range(400):
        hits = draw_impacts(np.random.default_rng(seed), 0.3, 6.0, 106.0)
        counts.append(len(hits))
        times.extend(hits)
    assert np.mean(counts) == pytest.approx(30.0, abs=4 * np.sqrt(30 / 400))
    assert np.var(counts) == pytest.approx(30.0, rel=0.3)
    assert (min(times), max(times)) == (pytest.approx(6.0, abs=0.1), pytest.approx(106.0, abs=0.1))
    assert (np.diff(hits) > 0).all()
