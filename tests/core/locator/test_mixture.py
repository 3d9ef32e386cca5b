import numpy as np
import pytest
import scipy.special

from logger.core.locator.mixture import GROUP_POWER, mixture
from logger.core.model.prior import Prior

RNG = np.random.default_rng(1)
NUMBERS = np.array([0, 2, 5, 9])
LOG_P = RNG.normal(-300.0, 12.0, (4, 50))
LOG_MASS = RNG.normal(3.0, 2.0, 50)


def prior_with(trust):
    """White noise, and two groups that are trusted this much."""
    white, *correlated = Prior().noise
    return Prior(noise=(white, *(group._replace(trust=trust) for group in correlated)))


def test_shares_sum_to_one():
    mixed = mixture(LOG_P, LOG_MASS, NUMBERS, Prior())
    assert mixed.share.shape == (4, 50)
    assert mixed.share.sum() == pytest.approx(1.0, abs=1e-12)
    assert mixed.probability.sum() == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(mixed.by_hypothesis, mixed.share.sum(axis=1))


GROUPS = [[0], [1, 2], [3]]
"""Rows of the hypotheses 0, 2 and 5, and 9."""


def joint_under(prior):
    """Log joint density of levels, hypothesis and position."""
    log_odds = prior.noise_table.log_odds[NUMBERS][:, None]
    return LOG_P + scipy.special.log_softmax(LOG_MASS) + log_odds


def test_with_full_trust_each_group_is_the_average_of_bayes():
    """The groups have their evidence to a power as weight."""
    prior = prior_with(1.0)
    mixed, joint = mixture(LOG_P, LOG_MASS, NUMBERS, prior), joint_under(prior)
    weight = scipy.special.softmax(
        [GROUP_POWER * scipy.special.logsumexp(joint[rows]) for rows in GROUPS]
    )
    for rows, share in zip(GROUPS, weight, strict=True):
        expected = share * scipy.special.softmax(joint[rows])
        np.testing.assert_allclose(mixed.share[rows], expected, rtol=1e-9, atol=1e-300)
    assert mixed.log_evidence == pytest.approx(scipy.special.logsumexp(joint))


def test_with_full_power_it_is_the_average_of_bayes(monkeypatch):
    monkeypatch.setattr("logger.core.locator.mixture.GROUP_POWER", 1.0)
    prior = prior_with(1.0)
    mixed = mixture(LOG_P, LOG_MASS, NUMBERS, prior)
    expected = scipy.special.softmax(joint_under(prior))
    np.testing.assert_allclose(mixed.share, expected, rtol=1e-9, atol=1e-300)


def test_without_trust_the_prior_is_left():
    mixed = mixture(LOG_P[1:], LOG_MASS, NUMBERS[1:], prior_with(0.0))
    np.testing.assert_allclose(mixed.probability, scipy.special.softmax(LOG_MASS), rtol=1e-12)


def test_a_group_is_mixed_before_it_is_flattened():
    full, some = (mixture(LOG_P, LOG_MASS, NUMBERS, prior_with(t)) for t in (1.0, 0.3))
    short = slice(1, 3)  # hypotheses 2 and 5
    by_group = [np.sum(mixed.by_hypothesis[short]) for mixed in (full, some)]
    assert by_group[1] == pytest.approx(by_group[0], rel=1e-9)
    assert some.log_evidence == pytest.approx(full.log_evidence)
    log_group = scipy.special.logsumexp(LOG_P[short], axis=0)
    given = np.sum(some.share[short], axis=0) / by_group[1]
    np.testing.assert_allclose(given, scipy.special.softmax(0.3 * log_group + LOG_MASS), rtol=1e-9)
    at_each = some.share[short] / np.sum(some.share[short], axis=0)
    np.testing.assert_allclose(at_each, scipy.special.softmax(LOG_P[short], axis=0), rtol=1e-9)


def test_known_weights_take_the_place_of_the_evidence():
    log_weight = np.array([-3.0, -np.inf, -2.0, -1.0])
    mixed = mixture(LOG_P, LOG_MASS, NUMBERS, prior_with(1.0), log_weight)
    log_group = [scipy.special.logsumexp(log_weight[rows]) for rows in GROUPS]
    of_groups = scipy.special.softmax(GROUP_POWER * np.array(log_group))
    each = [scipy.special.softmax(log_weight[rows]) for rows in GROUPS]
    expected = np.concatenate([w * one for w, one in zip(of_groups, each, strict=True)])
    np.testing.assert_allclose(mixed.by_hypothesis, expected, atol=1e-12)


def test_mass_of_the_prior_counts_by_its_share():
    one, other = (mixture(LOG_P, LOG_MASS + shift, NUMBERS, Prior()) for shift in (0.0, 700.0))
    np.testing.assert_allclose(other.share, one.share, rtol=1e-9)
    assert other.log_evidence == pytest.approx(one.log_evidence)


def test_levels_that_rule_out_a_hypothesis_or_all_but_one_place():
    log_p = np.full((2, 3), -1e5)
    log_p[1, 2] = -3.0
    mixed = mixture(log_p, np.zeros(3), np.array([0, 1]), prior_with(1.0))
    np.testing.assert_array_equal(mixed.share, [[0, 0, 0], [0, 0, 1]])
