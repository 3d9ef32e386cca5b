import numpy as np
import pytest

from logger.core.errors import ConfigError
from logger.core.live import live_prior
from logger.core.live_settings import LiveSettings
from logger.core.model.prior import ANTENNAS, ENVIRONMENTS, Hypothesis, Prior, prior_for


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_an_environment_says_its_name(name):
    assert prior_for(name).environment == name


def test_the_broadest_environment_is_the_default():
    assert prior_for("any") == Prior()
    assert all(prior.eta_sigma <= Prior().eta_sigma for prior in ENVIRONMENTS.values())


def test_the_height_may_be_known():
    assert prior_for("urban", height_m=31.0).height_m == 31.0
    assert prior_for("urban").height_m == Prior().height_m


def test_unknown_environment():
    with pytest.raises(ConfigError, match="'lunar' is unknown: one of any, open"):
        prior_for("lunar")


def test_hypotheses_share_all_odds():
    prior = Prior()
    assert np.exp(prior.log_odds).sum() == pytest.approx(1.0)
    assert (
        len(prior.log_odds)
        == len(prior.hypotheses)
        == 1 + len(prior.white_shares) * len(prior.decorrelation_m)
    )
    assert prior.hypotheses[0] == Hypothesis(1.0, 0.0, 1.0)
    assert np.exp(prior.log_odds[0]) == pytest.approx(prior.white_alone)


def test_what_hangs_together_over_the_whole_quarter_is_trusted_less():
    prior = Prior(trust=0.1, stationary_m=50.0)
    trusts = {h.decorrelation_m: h.trust for h in prior.hypotheses}
    assert trusts[50.0] == 1.0
    assert trusts[100.0] == 0.1


def test_white_noise_may_be_the_only_hypothesis():
    prior = Prior(decorrelation_m=(), white_shares=(), white_alone=1.0)
    assert prior.log_odds.tolist() == [0.0]


def test_a_sector_antenna_adds_two_coefficients_for_each_harmonic():
    omni, sector = (prior_for("urban", antenna=antenna) for antenna in ("omni", "sector"))
    assert omni == prior_for("urban")
    assert len(omni.coefficients.mean) == 2
    assert sector.coefficients.mean.tolist() == [*omni.coefficients.mean, 0.0, 0.0, 0.0, 0.0]
    sigma_db = sector.coefficients.precision[2:] ** -0.5
    assert sigma_db == pytest.approx([9.3, 9.3, 3.3, 3.3])
    with pytest.raises(ConfigError, match="antenna 'dish' is unknown: one of omni, sector"):
        prior_for("any", antenna="dish")


def test_the_device_uses_the_configured_antenna():
    assert live_prior(LiveSettings(antenna="sector")).antenna_db == ANTENNAS["sector"]
    assert live_prior(LiveSettings()).antenna_db == ()
