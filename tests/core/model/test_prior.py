import numpy as np
import pytest

from logger.core.errors import ConfigError
from logger.core.live import live_prior
from logger.core.live_settings import LiveSettings
from logger.core.model.noise import shadowing
from logger.core.model.prior import ANTENNAS, ENVIRONMENTS, WHITE, Hypothesis, Prior, prior_for
from tests.kit.noise_groups import noise_groups


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
    odds = np.exp(prior.noise_table.log_odds)
    assert len(odds) == len(prior.hypotheses)
    assert odds.sum() == pytest.approx(1.0)
    assert prior.hypotheses[0] == WHITE
    for group, first in zip(prior.noise, prior.noise_table.first, strict=True):
        of_group = odds[first : first + len(group.hypotheses)]
        assert of_group == pytest.approx(1.0 / (len(prior.noise) * len(group.hypotheses)))


def test_shadowing_of_two_scales_is_trusted_least():
    white, short, long = Prior().noise
    assert white.trust == 1.0 > short.trust > long.trust
    assert [group.is_long for group in (white, short, long)] == [False, False, True]
    assert min(one.long_m for one in long.hypotheses) > max(one.short_m for one in long.hypotheses)


def test_the_decorrelation_distance_is_the_integral_of_the_correlation():
    hypothesis = Hypothesis(0.3, 20.0, 0.75, 300.0)
    apart_m = np.arange(0.0, 6000.0, 0.1)
    assert 0.1 * np.sum(shadowing(apart_m, hypothesis)) / 0.7 == pytest.approx(
        hypothesis.decorrelation_m, rel=0.01
    )
    assert WHITE.decorrelation_m == 0.0


def test_white_noise_may_be_the_only_hypothesis():
    assert Prior(noise=noise_groups()).noise_table.log_odds.tolist() == [0.0]


def test_a_far_reach_makes_distant_transmitters_as_probable_as_close_ones():
    assert prior_for("any", reach="far").near_m == 2.0 * prior_for("any").near_m
    with pytest.raises(ConfigError, match="reach 'moon' is unknown: one of near, far"):
        prior_for("any", reach="moon")


def test_a_sector_antenna_adds_two_coefficients_for_each_harmonic():
    omni, sector = (prior_for("urban", antenna=antenna) for antenna in ("omni", "sector"))
    assert omni == prior_for("urban")
    assert len(omni.coefficients.mean) == 2
    assert sector.coefficients.mean.tolist() == [*omni.coefficients.mean, 0.0, 0.0, 0.0, 0.0]
    sigma_db = sector.coefficients.precision[2:] ** -0.5
    assert sigma_db == pytest.approx([9.3, 9.3, 3.3, 3.3])
    with pytest.raises(ConfigError, match="antenna 'dish' is unknown: one of omni, any, sector"):
        prior_for("any", antenna="dish")


def test_the_device_uses_the_configured_antenna():
    assert live_prior(LiveSettings(antenna="sector")).antenna_db == ANTENNAS["sector"]
    assert live_prior(LiveSettings()).antenna_db == ()


def test_the_device_uses_the_configured_reach():
    assert live_prior(LiveSettings(reach="far")).near_m == prior_for("any", reach="far").near_m
    assert live_prior(LiveSettings()).near_m == prior_for("any").near_m
