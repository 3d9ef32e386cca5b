import numpy as np
import pytest

from logger.core.errors import ConfigError
from postproc.reproductions.toa import README_ANCHORS_M, Anchors, all_pairs, independent

README = Anchors(np.array(README_ANCHORS_M))
PRINTED_H = -2.0 * np.array(
    [
        [0 - 10, 10 - 10],
        [0 - 0, 10 - 0],
        [0 - 10, 10 - 0],
        [10 - 0, 10 - 0],
        [10 - 10, 10 - 0],
        [0 - 10, 0 - 0],
    ]
)


def printed_z(z, d1=10.0, d2=10.0):
    one, two, three, four = z**2
    return [
        one - two + d1**2,
        one - three - d2**2,
        one - four - (d2**2 - d1**2),
        two - three - (d1**2 + d2**2),
        two - four - d2**2,
        three - four + d1**2,
    ]


def printed_r(z, sigma2):
    a, b, c, d = z**2
    return (
        4.0
        * sigma2
        * np.array(
            [
                [a + b, a, a, -b, -b, 0],
                [a, a + c, a, c, 0, -c],
                [a, a, a + d, 0, d, d],
                [-b, c, 0, b + c, b, -c],
                [-b, 0, d, b, b + d, d],
                [0, -c, d, -c, d, c + d],
            ]
        )
    )


def test_the_printed_h_z_and_r_are_the_derived_ones():
    rows = all_pairs(README)
    assert rows.h == pytest.approx(PRINTED_H)
    z = np.random.default_rng(0).uniform(-3.0, 15.0, 4)
    assert rows.z_m2(z) == pytest.approx(np.array(printed_z(z)))
    assert rows.r_m4(z, 0.3) == pytest.approx(printed_r(z, 0.3))


@pytest.mark.parametrize("rows", [all_pairs, independent])
def test_each_row_reproduces_the_exact_position_without_noise(rows):
    rng = np.random.default_rng(1)
    for anchors in (README, Anchors(rng.uniform(-50.0, 50.0, (6, 2)))):
        at = rng.uniform(-40.0, 40.0, (20, 2))
        chosen = rows(anchors)
        assert chosen.z_m2(anchors.ranges_m(at)) == pytest.approx(at @ chosen.h.T, abs=1e-9)


def test_all_pairs_follow_from_the_independent_rows():
    pairs, rows = all_pairs(README), independent(README)
    assert np.linalg.matrix_rank(pairs.of) == np.linalg.matrix_rank(rows.of) == len(rows.of) == 3
    assert np.linalg.matrix_rank(np.vstack([pairs.of, rows.of])) == 3


def test_r_is_too_large_by_the_fourth_power_on_average():
    at, sigma2 = np.array([3.0, 4.0]), 25.0
    pairs, rng = all_pairs(README), np.random.default_rng(2)
    true_m = README.ranges_m(at)
    ranges = true_m + np.sqrt(sigma2) * rng.normal(size=(200_000, 4))
    measured = np.cov(pairs.z_m2(ranges).T)
    excess = 2.0 * sigma2**2 * pairs.of @ pairs.of.T
    scale = np.max(np.abs(measured))
    assert pairs.r_m4(true_m, sigma2) + excess == pytest.approx(measured, abs=0.02 * scale)
    assert np.mean(pairs.r_m4(ranges[:20_000], sigma2), axis=0) - excess == pytest.approx(
        measured, abs=0.02 * scale
    )


def test_bad_anchors_are_output():
    for bad in ([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]], [[5.0, 5.0]] * 4):
        with pytest.raises(ConfigError, match="one line"):
            Anchors(np.array(bad))
    with pytest.raises(ConfigError, match="positions"):
        Anchors(np.array([[0.0, np.nan], [1.0, 0.0], [0.0, 1.0]]))
