"""A station that is one of several: the law of total probability, written once more."""

import numpy as np
import pytest
import scipy.special

from logger.core.model.evidence import PAIRS, Evidence, mix_stations

RNG = np.random.default_rng(1)
ODDS = np.array([[0.5, 1.0], [0.2, 0.0], [0.3, 0.0]])
"""Of three stations under two hypotheses of the noise; the second leaves only the first station."""


def part(harmonics):
    """Evidence of one station (2 hypotheses, 7 positions) with so many harmonics."""
    root = RNG.normal(size=(2, 7, 2, 2))
    covariance = root @ root.swapaxes(-1, -2)
    return Evidence(
        RNG.normal(-200.0, 3.0, (2, 7)),
        RNG.normal(0.0, 2.0, (2 + 2 * harmonics, 2, 7)),
        np.stack([covariance[..., i, j] for i, j in PAIRS]),
        RNG.uniform(2.0, 8.0, (2, 7)),
        np.ones((1, 2, 7)),
    )


PARTS = [part(harmonics) for harmonics in (0, 0, 1)]
with np.errstate(divide="ignore"):
    MIXED = mix_stations(PARTS, np.log(ODDS))


def test_log_evidence_and_stations_are_those_of_bayes():
    joint = np.stack([one.log_p for one in PARTS])
    log_p = scipy.special.logsumexp(joint, axis=0, b=ODDS[..., None])
    np.testing.assert_allclose(MIXED.log_p, log_p, rtol=1e-12)
    np.testing.assert_allclose(MIXED.station, ODDS[..., None] * np.exp(joint - log_p), rtol=1e-9)
    np.testing.assert_allclose(np.sum(MIXED.station, axis=0), 1.0)


@pytest.mark.parametrize("row", [0, 1])
@pytest.mark.parametrize("position", [0, 3, 6])
def test_p0_eta_and_sigma_have_the_moments_of_the_mixture(row, position):
    """By the law of total expectation and covariance."""
    share = MIXED.station[:, row, position]
    mean = np.array([one.theta[:2, row, position] for one in PARTS])
    covariance = np.zeros((3, 2, 2))
    for k, one in enumerate(PARTS):
        for (i, j), value in zip(PAIRS, one.theta_cov[:, row, position], strict=True):
            covariance[k, i, j] = covariance[k, j, i] = value
    total = np.einsum("s,sij->ij", share, covariance)
    total += np.cov(mean.T, aweights=share, ddof=0)
    assert MIXED.theta.shape == (2, 2, 7)
    np.testing.assert_allclose(MIXED.theta[:, row, position], share @ mean)
    np.testing.assert_allclose(
        MIXED.theta_cov[:, row, position], [total[i, j] for i, j in PAIRS], rtol=1e-9
    )
    sigma_db = [one.sigma_db[row, position] for one in PARTS]
    assert MIXED.sigma_db[row, position] == pytest.approx(share @ sigma_db)


def test_the_evidence_of_one_station_is_replaced_at_some_positions():
    """The others keep theirs, and the harmonics of a pattern go."""
    first, sector = PARTS[0], PARTS[2]
    rows, chosen = np.array([1]), np.array([2, 5])
    joined = first.replace(rows, chosen, sector.of_hypotheses(rows).at_positions(chosen))
    is_new = np.zeros((2, 7), bool)
    is_new[rows[:, None], chosen] = True
    for values, old, new in zip(joined, first, sector, strict=True):
        same = new[:2] if new is sector.theta else new
        np.testing.assert_array_equal(values, np.where(is_new, same, old))
    assert not np.array_equal(joined.log_p, first.log_p)
