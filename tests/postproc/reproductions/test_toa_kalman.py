import numpy as np
import pytest

from postproc.reproductions import toa
from postproc.reproductions.toa import (
    README_ANCHORS_M,
    README_PATH_M,
    Anchors,
    all_pairs,
    fix_m,
    independent,
)

README, PATH = Anchors(np.array(README_ANCHORS_M)), np.array(README_PATH_M)


def simulate_runs(anchors, path, sigma2, runs, seed=0):
    return anchors.ranges_m(path) + np.sqrt(sigma2) * np.random.default_rng(seed).normal(
        size=(runs, len(path), len(anchors))
    )


def textbook(anchors, ranges, sigma2, noise, p):
    """One run by the README's equations, with numpy's pseudo-inverse."""
    pairs = all_pairs(anchors)
    h, result = pairs.h, [*fix_m(anchors, ranges[:2])]
    for z in ranges[2:]:
        predicted = result[-1] + (result[-1] - result[-2]) + noise.mean_m
        p_predicted = p + noise.q_m2
        s = h @ p_predicted @ h.T + pairs.r_m4(z, sigma2)
        gain = p_predicted @ h.T @ np.linalg.pinv(s, rcond=1e-10, hermitian=True)
        result.append(predicted + gain @ (pairs.z_m2(z) - h @ predicted))
        p = p_predicted - gain @ h @ p_predicted
    return np.array(result), p


@pytest.mark.parametrize("sigma2", toa.README_SIGMA2_M2)
def test_pseudo_inverse_and_independent_rows_agree(sigma2):
    noise, p1 = (
        toa.readme_values(README, PATH, sigma2),
        toa.covariance_m2(README, PATH[1], sigma2),
    )
    ranges = simulate_runs(README, PATH, sigma2, 300)
    rows = toa.by_readme(independent(README), ranges, sigma2, noise, p1)
    pinv = toa.by_readme(all_pairs(README), ranges, sigma2, noise, p1)
    assert np.max(np.abs(rows.position_m - pinv.position_m)) < 1e-9
    assert np.max(np.abs(rows.p_m2[:, 1:] - pinv.p_m2[:, 1:])) < 1e-9 * max(sigma2, 1.0)


@pytest.mark.parametrize("count", [3, 4, 7])
def test_the_filter_is_the_textbook_one_for_any_anchors(count):
    rng = np.random.default_rng(count)
    anchors = Anchors(rng.uniform(-20.0, 20.0, (count, 2)))
    noise, p1 = toa.closed_form(anchors, PATH, 0.5), toa.covariance_m2(anchors, PATH[1], 0.5)
    ranges = simulate_runs(anchors, PATH, 0.5, 3, count)
    result = toa.by_readme(independent(anchors), ranges, 0.5, noise, p1)
    for run in range(3):
        place, p = textbook(anchors, ranges[run], 0.5, noise, p1)
        assert result.position_m[run] == pytest.approx(place, abs=1e-8)
        assert result.p_m2[run, -1] == pytest.approx(p, abs=1e-8)


def test_the_innovation_covariance_of_the_readme_has_no_inverse():
    pairs, p = all_pairs(README), 5.0 * np.eye(2)
    s = pairs.h @ p @ pairs.h.T + pairs.r_m4(np.array([7.0, 8.0, 9.0, 10.0]), 1.0)
    value = np.linalg.eigvalsh(s)
    assert np.all(np.abs(value[:3]) < 1e-9 * value[-1])
    assert value[3] > 1e-3 * value[-1]


def test_the_initial_p_is_the_closed_form():
    for sigma2 in toa.README_SIGMA2_M2:
        expected = (0.82 * sigma2 + 0.005 * sigma2**2) * np.eye(2)
        assert toa.covariance_m2(README, PATH[1], sigma2) == pytest.approx(expected)
