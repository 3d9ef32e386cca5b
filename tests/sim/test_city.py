import numpy as np

from logger.core.suspicion.countries import countries
from logger.sim.city import LAT_DEG, LON_DEG, ROGUE, city, with_lists
from logger.sim.scenario import scenario


def test_a_city_has_40_cells_with_networks_of_the_place():
    cells = with_lists(city(np.random.default_rng(1)).cells)
    assert len(cells) == 40
    assert len({(c.mcc, c.mnc, c.lac, c.cid) for c in cells}) == 40
    plan = countries()
    near = plan.near(LAT_DEG, LON_DEG)
    assert all(set(plan.countries_of(c.mcc)) & set(near) for c in cells)
    assert all(plan.is_listed(c.mcc, c.mnc) for c in cells)
    assert sum(plan.is_railway(c.mcc, c.mnc) for c in cells) == 1


def test_the_rogue_is_only_in_its_scenario():
    clean, rogue = scenario("city-clean"), scenario("city-rogue")
    assert rogue.target == ROGUE
    assert set(rogue.world.transmitters) - set(clean.world.transmitters) == {ROGUE}
    assert not ROGUE.broadcast.neighbour_arfcns
