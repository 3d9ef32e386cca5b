import numpy as np

from logger.core.locator.pipeline import locate
from logger.core.locator.two_source_test import LEAST_LOG_FACTOR, divide
from logger.core.locator.verdict import assess
from logger.core.places import Places
from tests.kit.walks import observations, path, simulate


def two_sources(rng, apart_m=400.0, white_db=3.0):
    """The louder of two transmitters, each passed at 40 m."""
    x, y = path("L", 300, 2.8)
    sources = np.array([(60.0, 40.0), (380.0, apart_m - 60.0)])
    level = np.max([-30.0 - 30.0 * np.log10(np.hypot(x - a, y - b)) for a, b in sources], axis=0)
    return observations(x, y, np.round(level + white_db * rng.normal(size=len(x)))), sources


def test_two_transmitters_are_told():
    obs, sources = two_sources(np.random.default_rng(1))
    posterior = locate(obs)
    division = divide(obs, posterior)
    assert division.log_factor > LEAST_LOG_FACTOR
    for source in sources:  # or its mirror image: each part of the walk may be straight
        assert min(p.away_m(Places.of(*source)) for p in (division.one, division.other)) < 120.0
    outcome, (reason, *_), *_ = assess(posterior, obs, division)
    assert outcome == "cannot tell"
    assert "one position does not explain the data" in reason


def test_a_pattern_hides_no_two_transmitters():
    for seed in range(1, 5):
        obs, _ = two_sources(np.random.default_rng(seed), apart_m=320.0, white_db=5.0)
        posterior = locate(obs)
        assert posterior.station.antenna_db
        assert divide(obs, posterior).log_factor > LEAST_LOG_FACTOR


def test_one_transmitter_is_not_divided():
    for seed in range(4):
        obs, _ = simulate(
            np.random.default_rng(seed), "L", count=300, step=2.8, white_db=2.0, shadow_db=6.0
        )
        division = divide(obs, locate(obs))
        assert division is None or division.log_factor < LEAST_LOG_FACTOR
