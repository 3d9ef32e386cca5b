import numpy as np
import pytest

from logger.core.geo import Utm
from logger.core.guidance.street_atlas import StreetAtlas

NEAR, ALSO_NEAR = [(52.5, 13.4), (52.501, 13.4)], [(52.51, 13.4), (52.511, 13.4)]
FAR = [(48.0, 11.0), (48.001, 11.0)]
UTM = Utm.at(52.5, 13.4)


def _near(atlas, lat_deg=52.5, utm=UTM):
    return atlas.near(utm, *utm.to_xy(lat_deg, 13.4))


def test_streets_far_from_the_walk_are_left_out():
    streets = _near(StreetAtlas([NEAR, FAR]))
    assert len(streets.legs) == 1
    assert streets.legs[0].length_m == pytest.approx(111.3, abs=1.0)


def test_a_town_has_one_map_wherever_the_walk_begins():
    atlas = StreetAtlas([NEAR, ALSO_NEAR])
    assert _near(atlas) is _near(atlas, 52.52)
    assert len(_near(atlas).legs) == 2


def test_a_walk_far_away_or_in_another_zone_has_another_map():
    atlas = StreetAtlas([NEAR, FAR])
    first = _near(atlas)
    assert _near(atlas, 52.51) is first
    assert _near(atlas, 52.52) is not first
    other = Utm(UTM.zone - 1)
    south_m = _near(atlas, utm=other).crossing_m[0]
    np.testing.assert_allclose(south_m, other.to_xy(52.5, 13.4), atol=0.01)


def test_an_empty_file_has_no_map():
    assert _near(StreetAtlas([])) is None
