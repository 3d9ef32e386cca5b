import numpy as np
import pytest
import scipy.integrate

from logger.core.errors import ConfigError
from logger.core.live import live_prior
from logger.core.live_settings import LiveSettings
from logger.core.model.noise import shadowing
from logger.core.model.prior import (
    ANTENNAS,
    ENVIRONMENTS,
    HEIGHTS_M,
    REACHES,
    SECTOR_DB,
    WHITE,
    Hypothesis,
    Prior,
    Reach,
    Station,
    prior_for,
)
from tests.kit.noise_groups import noise_groups


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_an_environment_says_its_name(name):
    assert prior_for(name).environment == name


def test_the_broadest_environment_is_the_default():
    assert prior_for("any") == Prior()
    assert all(prior.eta_sigma <= Prior().eta_sigma for prior in ENVIRONMENTS.values())


@pytest.mark.parametrize("antenna", ANTENNAS)
def test_the_height_may_be_known(antenna):
    known = prior_for("urban", height_m=31.0, antenna=antenna).stations
    assert {one.height_m for one in known} == {31.0}
    assert len(known) == len({one.antenna_db for one in known})


def test_without_a_height_all_are_equally_probable():
    omni = [one for one in prior_for("urban").stations if not one.antenna_db]
    assert [one.height_m for one in omni] == list(HEIGHTS_M)
    assert len({one.probability for one in omni}) == 1


def test_unknown_environment():
    with pytest.raises(ConfigError, match="'lunar' is unknown: one of any, open"):
        prior_for("lunar")


def test_hypotheses_share_all_odds():
    prior = Prior()
    odds = np.exp(prior.noise_table.log_odds)
    assert len(odds) == len(prior.hypotheses)
    assert odds.sum() == pytest.approx(1.0)
    assert prior.hypotheses[0] == WHITE
    total = sum(group.probability for group in prior.noise)
    for group, first in zip(prior.noise, prior.noise_table.first, strict=True):
        of_group = odds[first : first + len(group.hypotheses)]
        assert of_group == pytest.approx(group.probability / total / len(group.hypotheses))


def test_shadowing_of_two_scales_is_trusted_least():
    white, short, long, *averaged = Prior().noise
    assert white.trust == 1.0 > short.trust > long.trust
    assert [group.trust for group in averaged] == [short.trust, long.trust]
    assert [group.is_coarse for group in Prior().noise] == [False, False, True, True, True]
    assert min(one.long_m for one in long.hypotheses) > max(one.short_m for one in long.hypotheses)


@pytest.mark.parametrize("averaged_m", [0.0, 5.0])
def test_the_decorrelation_distance_is_the_integral_of_the_correlation(averaged_m):
    hypothesis = Hypothesis(0.3, 20.0, 0.75, 300.0, averaged_m)
    apart_m = np.arange(0.0, 6000.0, 0.1)
    assert 0.1 * np.sum(shadowing(apart_m, hypothesis)) / 0.7 == pytest.approx(
        hypothesis.decorrelation_m, rel=0.01
    )
    assert WHITE.decorrelation_m == 0.0


def test_white_noise_may_be_the_only_hypothesis():
    assert Prior(noise=noise_groups()).noise_table.log_odds.tolist() == [0.0]


# --- reach ---


def test_the_reaches_of_near_and_far_are_those_of_any():
    assert prior_for("any").reaches == REACHES["near"] + REACHES["far"]
    longest = max(one.flat_m for one in prior_for("any", reach="near").reaches)
    assert all(one.flat_m > longest for one in prior_for("any", reach="far").reaches)
    with pytest.raises(ConfigError, match="reach 'moon' is unknown: one of any, near, far"):
        prior_for("any", reach="moon")


@pytest.mark.parametrize("level", [0.05, 0.5, 0.8, 0.95, 0.99])
@pytest.mark.parametrize(
    "reaches",
    [*REACHES.values(), (Reach(1.0, 200.0, 3.0),), (Reach(0.2, 90.0, 2.5), Reach(3.0, 50.0, 6.0))],
)
def test_the_radius_around_a_reading_holds_its_share(reaches, level):
    """By quadrature over the logarithm of the distance."""

    def share(radius_m):
        held = []
        for one in reaches:
            log_m = np.linspace(np.log(1e-3), np.log(one.flat_m) + 60.0, 200_001)
            mass = np.exp(2.0 * log_m) * np.maximum(np.exp(log_m) / one.flat_m, 1.0) ** -one.power
            inside = log_m <= np.log(radius_m)
            total = scipy.integrate.trapezoid(mass, log_m)
            held.append(scipy.integrate.trapezoid(mass[inside], log_m[inside]) / total)
        return np.average(held, weights=[one.probability for one in reaches])

    assert share(Prior(reaches=reaches).radius_m(level)) == pytest.approx(level, abs=1e-3)


# --- stations ---


def test_a_sector_antenna_adds_two_coefficients_for_each_harmonic():
    omni, sector = (prior_for("urban", antenna=antenna) for antenna in ("omni", "sector"))
    assert len(omni.coefficients.mean) == 2
    zeros = [0.0] * (2 * len(SECTOR_DB))
    assert sector.coefficients.mean.tolist() == [*omni.coefficients.mean, *zeros]
    sigma_db = sector.coefficients.precision[2:] ** -0.5
    assert sigma_db == pytest.approx(np.repeat(SECTOR_DB, 2))
    with pytest.raises(ConfigError, match="antenna 'dish' is unknown: one of any, omni, sector"):
        prior_for("any", antenna="dish")


def test_any_antenna_is_one_of_the_others():
    kinds = [prior_for("any", antenna=antenna).stations for antenna in ("omni", "sector")]
    stations = prior_for("any").stations
    assert [one[1:] for one in stations] == [one[1:] for kind in kinds for one in kind]
    for some in (stations, *kinds):
        assert sum(one.probability for one in some) == pytest.approx(1.0)


def test_log_odds_of_the_stations_under_each_noise():
    """A pattern needs shadowing, unless there is nothing but patterns."""
    prior = Prior(stations=(Station(0.6, 5.0), Station(0.1, 20.0), Station(0.5, 5.0, (9.0,))))
    odds = np.exp(prior.station_log_odds)
    assert odds.shape == (3, len(prior.hypotheses))
    np.testing.assert_allclose(np.sum(odds, axis=0), 1.0)
    assert prior.hypotheses[0] == WHITE
    np.testing.assert_allclose(odds[:, 0], [6 / 7, 1 / 7, 0.0])
    shadowed = odds[:, 1:]
    np.testing.assert_allclose(shadowed.T, [[0.5, 1 / 12, 5 / 12]] * shadowed.shape[1])
    sector = prior.of_station(prior.stations[2])
    np.testing.assert_allclose(np.exp(sector.station_log_odds), 1.0)


def test_the_prior_of_one_station():
    prior, station = Prior(), Station(0.3, 17.0, (4.0,))
    alone = prior.of_station(station)
    assert (alone.height_m, alone.antenna_db) == (17.0, (4.0,))
    assert (alone.reaches, alone.noise) == (prior.reaches, prior.noise)


# --- the device ---


@pytest.mark.parametrize("antenna", ["omni", "any", "sector"])
def test_the_device_uses_the_configured_antenna_and_height(antenna):
    settings = LiveSettings(antenna=antenna, height_m=8.0)
    assert live_prior(settings).stations == ANTENNAS[antenna](8.0)


@pytest.mark.parametrize("reach", ["near", "far"])
def test_the_device_uses_the_configured_reach(reach):
    assert live_prior(LiveSettings(reach=reach)).reaches == REACHES[reach]
