"""What each hypothesis of reach, antenna and height says alone."""

from itertools import groupby

import numpy as np
import pytest

from logger.core.locator.alternatives import ANTENNA, HEIGHT, REACH, alternatives
from logger.core.locator.pipeline import locate
from logger.core.locator.region import Squares
from logger.core.model.prior import Prior, prior_for
from tests.kit.walks import simulate


@pytest.fixture(scope="module")
def walk():
    rng = np.random.default_rng(7)
    return simulate(rng, "L", count=80, step=5.6, white_db=3.0)[0]


@pytest.fixture(scope="module", name="found")
def answer_of(walk):
    return locate(walk)


def by_name(found, kind):
    return {one.name: one for one in found.alternatives if one.kind == kind}


def test_each_kind_has_all_of_the_probability(found):
    kinds = [kind for kind, _ in groupby(found.alternatives, lambda one: one.kind)]
    assert kinds == [REACH, ANTENNA, HEIGHT]
    for kind in kinds:
        total = sum(one.probability for one in by_name(found, kind).values())
        assert total == pytest.approx(1.0, abs=1e-6)


def test_their_probabilities_are_those_of_the_hypotheses_of_the_prior(found):
    prior = found.prior
    assert list(by_name(found, REACH)) == ["near", "far"]
    is_near = [one.flat_m <= 200.0 for one in prior.reaches]
    near = float(np.sum(found.reach_probability[is_near]))
    assert by_name(found, REACH)["near"].probability == pytest.approx(near)
    is_sector = [bool(one.antenna_db) for one in prior.stations]
    sector = float(np.sum(found.station_probability[is_sector]))
    assert by_name(found, ANTENNA)["sector"].probability == pytest.approx(sector, abs=1e-3)
    heights = [float(name.removesuffix(" m")) for name in by_name(found, HEIGHT)]
    assert heights == sorted({one.height_m for one in prior.stations})


def test_the_one_height_of_a_sector_antenna_speaks_for_none(found):
    omni = ~np.array([bool(one.antenna_db) for one in found.prior.stations])
    share = found.station_probability[omni] / np.sum(found.station_probability[omni])
    for station, expected in zip(np.array(found.prior.stations, object)[omni], share, strict=True):
        name = f"{station[1]:g} m"
        assert by_name(found, HEIGHT)[name].probability == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize(
    ("kind", "name", "fixed"),
    [
        (REACH, "near", {"reach": "near"}),
        (REACH, "far", {"reach": "far"}),
        (ANTENNA, "omni", {"antenna": "omni"}),
        (HEIGHT, "10 m", {"height_m": 10.0}),
    ],
)
def test_its_region_is_about_that_of_a_prior_without_the_others(walk, found, kind, name, fixed):
    alone = locate(walk, prior_for("any", **fixed))
    ratio = by_name(found, kind)[name].area_m2 / alone.region_area_m2
    assert 0.6 < ratio < 1.6
    (only,) = by_name(alone, kind).values()
    assert (only.name, only.area_m2) == (name, pytest.approx(alone.region_area_m2))
    assert only.probability == pytest.approx(1.0)


def test_what_is_ruled_out_has_no_region():
    squares = Squares(np.arange(4.0), np.zeros(4), np.ones(4), np.full(4, 0.25))
    prior = Prior()
    reach = np.zeros((1, len(prior.reaches), 4))
    reach[0, 0] = 0.25
    station = np.full((1, len(prior.stations), 4), 0.25 / len(prior.stations))
    near, far, *_ = alternatives(prior, squares, reach, station)
    assert (near.probability, near.area_m2) == (1.0, 4.0)
    assert (far.name, far.probability, far.area_m2, far.outside) == ("far", 0.0, None, None)
