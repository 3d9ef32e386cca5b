"""Two modems on one walk: one scale in the live estimate, whatever they read apart."""

import numpy as np
import pytest

from logger.core.live import live_prior
from logger.core.live_cell import CERTAIN_DB, MANY_MORE, LiveCell, LiveScale
from logger.core.live_settings import LiveSettings
from logger.core.locator.summary import summarise
from tests.kit.walks import region_contains, simulate, single_reading

PRIOR = live_prior(LiveSettings(height_m=0.0))
APART_DB = 9.0
WHITE_DB = 3.0


def walk(seed, apart_db, count=300):
    """Readings of two modems at the places of a walk as (modem, reading), and the source."""
    rng = np.random.default_rng(seed)
    shape = ("square", "L", "random")[seed % 3]
    obs, source = simulate(rng, shape, white_db=0.0, shadow_db=4.0, count=count, step=2.8)
    readings = []
    for x, y, level in zip(obs.x_m, obs.y_m, obs.level_dbm, strict=True):
        for number, modem in enumerate(("first", "second")):
            heard = np.round(level + WHITE_DB * rng.normal() - number * apart_db)
            readings.append((modem, single_reading(x, y, heard)))
    return readings, source


def locate(readings):
    """The posterior of a cell after the readings, what was said, and the cell."""
    cell, news = LiveCell(PRIOR), []
    for modem, reading in readings:
        cell.take(reading, modem)
        news += cell.news
        if cell.stale > 1.0:
            cell.search()
    cell.search()
    return summarise(*cell.locator.last_search()), news, cell


def count_covered(seeds, apart_db):
    """How often the 95 % region holds the source: of both modems, and of the first alone."""
    of_both = of_one = 0
    for seed in seeds:
        readings, source = walk(seed, apart_db)
        of_both += region_contains(locate(readings)[0], source, 5.0)
        alone = [pair for pair in readings if pair[0] == "first"]
        of_one += region_contains(locate(alone)[0], source, 5.0)
    return of_both, of_one


def assert_covers_as_one(seeds, apart_db):
    """Within three standard deviations of the difference of two counts with 95 %."""
    n = len(seeds)
    of_both, of_one = count_covered(seeds, apart_db)
    print(f"both modems {of_both} of {n}, one alone {of_one} of {n}")
    assert of_both >= of_one - 3.0 * np.sqrt(2.0 * n * 0.95 * 0.05)
    assert of_both >= 0.85 * n - 1.0


def test_the_region_of_two_modems_9_db_apart_holds_the_source():
    assert_covers_as_one(range(6), APART_DB)


@pytest.mark.slow
def test_coverage_of_two_modems_is_that_of_one_over_40_walks():
    assert_covers_as_one(range(40), APART_DB)


def test_without_a_scale_of_their_own_the_two_would_not_fit():
    """What the test of coverage would miss: the offset is found, and it is not zero."""
    readings, _ = walk(1, APART_DB)
    _, news, cell = locate(readings)
    texts = [text for code, text in news if code == "modem-offset"]
    assert len(texts) == 1
    offset_db = float(texts[0].split()[2])
    assert offset_db == pytest.approx(-APART_DB, abs=3.5 * CERTAIN_DB)
    counted = len(readings) - cell.n - cell.n_set_aside - cell.n_repeated
    assert 10 <= counted <= 40, "the first half minute of the second modem is compared only"


def test_a_modem_alone_is_its_own_scale():
    scale = LiveScale()
    reading = single_reading(0.0, 0.0, -70.0)
    assert scale.take("only", reading) is reading
    assert (scale.first, scale.offset_db("only"), scale.waiting("only", 0)) == ("only", None, ())


@pytest.mark.parametrize(("away_m", "limit"), [(50.0, 0), (0.0, -1)])
def test_levels_far_apart_or_at_a_limit_are_not_compared(away_m, limit):
    scale = LiveScale()
    for _ in range(100):
        scale.take("first", single_reading(0.0, 0.0, -70.0))
        assert scale.take("second", single_reading(away_m, 0.0, -79.0, limit)) is None


def test_a_level_counts_once_in_a_comparison():
    """A first modem that is away leaves its last level, which says nothing more."""
    scale = LiveScale()
    scale.take("first", single_reading(0.0, 0.0, -70.0))
    for _ in range(200):
        assert scale.take("second", single_reading(0.0, 0.0, -79.0)) is None


def test_the_estimate_begins_anew_with_a_modem_that_hears_far_more():
    readings, source = walk(2, APART_DB)
    lone = [pair for pair in readings[:20] if pair[0] == "first"]
    lone += [pair for pair in readings[20:] if pair[0] == "second"]
    posterior, news, cell = locate(lone)
    assert [code for code, _ in news if code == "modem-changed"] == ["modem-changed"]
    assert cell.n > 2 * MANY_MORE
    assert region_contains(posterior, source, 5.0)
