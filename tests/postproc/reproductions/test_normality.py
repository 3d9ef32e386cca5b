import numpy as np
import pytest

from postproc.reproductions.theory import normality


@pytest.mark.parametrize("limit", [None, 2.0, 3.0])
def test_normal_values_pass_and_their_p_is_uniform(limit):
    rng = np.random.default_rng(5)
    p = [normality(rng.normal(7.0, 3.0, 60), limit, rng).p for _ in range(30)]
    assert 0.3 < np.mean(p) < 0.7
    assert np.mean(np.array(p) < 0.05) < 0.2


def test_outliers_fail_until_they_are_cut():
    rng = np.random.default_rng(6)
    values = np.concatenate([rng.normal(size=300), rng.normal(0.0, 12.0, 20)])
    whole, cut = normality(values, None, rng), normality(values, 3.0, rng)
    assert whole.p < 0.01
    assert cut.p > 0.05
    assert cut.n_cut >= 10
    assert cut.n + cut.n_cut == 320
    assert normality(np.arange(5.0), None, rng) is None


def test_equal_values_are_not_checked():
    rng = np.random.default_rng(1)
    assert normality(np.full(40, -3.0), 2.5, rng) is None
    mostly_equal = np.append(np.full(40, -3.0), [1.0, 2.0, 5.0])
    assert normality(mostly_equal, 2.5, rng) is None
