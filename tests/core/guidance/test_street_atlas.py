import numpy as np
import pytest

from logger.core.errors import GeoError
from logger.core.guidance import street_atlas
from logger.core.guidance.street_atlas import StreetAtlas
from logger.core.places import Places, Utm

NEAR, ALSO_NEAR = [(52.5, 13.4), (52.501, 13.4)], [(52.51, 13.4), (52.511, 13.4)]
FAR = [(48.0, 11.0), (48.001, 11.0)]
UTM = Utm.at(52.5, 13.4)


def _near(atlas, lat_deg=52.5, utm=UTM):
    return atlas.near(Places.of_degrees(lat_deg, 13.4, utm=utm))


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


def test_where_there_are_too_many_streets_the_nearest_are_in_the_map(monkeypatch):
    monkeypatch.setattr(street_atlas, "_MOST_LENGTHS", 10)
    lines = [[(52.5 + 0.001 * k, 13.4), (52.5 + 0.001 * k, 13.401)] for k in range(40)]
    atlas = StreetAtlas([*lines, FAR])
    streets = _near(atlas, 52.51)
    north_deg = [UTM.to_latlon(*leg.line_m[0].tolist())[0] for leg in streets.legs]
    assert len(north_deg) == 10
    assert all(abs(lat_deg - 52.51) < 0.0055 for lat_deg in north_deg)
    assert _near(atlas, 52.512) is streets
    # 300 m on, half as far as the map reaches
    assert _near(atlas, 52.513) is not streets


def test_a_ferry_is_no_street():
    ferry = [(52.5, 13.4), (52.6, 14.4)]
    assert len(_near(StreetAtlas([NEAR, ferry])).legs) == 1


def test_streets_that_all_cross_at_one_place_are_refused():
    ends_deg = np.random.default_rng(1).uniform([52.5, 13.4], [52.501, 13.4015], (1500, 2, 2))
    star = [[tuple(end) for end in line] for line in ends_deg.tolist()]
    with pytest.raises(GeoError, match="cross at one place"):
        StreetAtlas(star)
    atlas = StreetAtlas([*star, FAR])
    with pytest.raises(GeoError, match="cross at one place"):
        atlas.near_densest()
