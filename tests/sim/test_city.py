import numpy as np
import pytest

from logger.core.suspicion.countries import countries
from logger.sim.scenario import CITIES, HALF_M, city, scenario, with_lists


@pytest.mark.parametrize("name", CITIES)
def test_a_city_has_40_cells_with_networks_of_the_place(name):
    place = CITIES[name]
    cells = with_lists(city(np.random.default_rng(1), place))
    assert len(cells) == 40
    assert len({(c.mcc, c.mnc, c.lac, c.cid) for c in cells}) == 40
    plan = countries()
    near = plan.near(place.lat_deg, place.lon_deg)
    assert all(set(plan.countries_of(c.mcc)) & set(near) for c in cells)
    assert all(plan.is_listed(c.mcc, c.mnc) for c in cells)
    assert sum(plan.is_railway(c.mcc, c.mnc) for c in cells) == 1


@pytest.mark.parametrize("name", CITIES)
def test_the_rogue_is_only_in_its_scenario(name):
    rogue = CITIES[name].rogue
    clean, walk = (scenario(f"city-{kind}", city_name=name) for kind in ("clean", "rogue"))
    assert walk.target == rogue
    assert set(walk.world.transmitters) - set(clean.world.transmitters) == {rogue}
    assert not rogue.broadcast.neighbour_arfcns
    assert np.max(np.abs(walk.walk.waypoints)) <= HALF_M / 2
