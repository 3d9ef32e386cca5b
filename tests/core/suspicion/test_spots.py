"""Spots of a cell stay few, cover the whole walk and keep its strongest places."""

from itertools import pairwise

from logger.core.suspicion.spots import MOST_SPOTS, Spots


def _walk(n, level_dbm=lambda k: -90.0, *, step_m=30.0, step_s=20.0):
    spots = Spots()
    for k in range(n):
        spots.add(k * step_m, 5.0, level_dbm(k), k * step_s)
    return spots


def test_levels_of_a_square_are_averaged():
    spots = Spots()
    for k, level_dbm in enumerate((-80.0, -90.0)):
        spots.add(5.0, 5.0, level_dbm, float(k))
    (spot,) = spots
    assert (spot.level_dbm, spot.best_dbm, spot.n) == (-85.0, -80.0, 2)


def test_a_long_walk_keeps_both_peaks_and_covers_the_way():
    """A clone passed first and its original an hour later are both needed to tell two places."""
    spots = _walk(1000, lambda k: -50.0 if k in (20, 900) else -90.0)
    assert len(spots) <= MOST_SPOTS + 1
    assert spots.n == 1000
    strongest = sorted(spots, key=lambda spot: spot.level_dbm)[-2:]
    assert sorted(spot.x_m for spot in strongest) == [600.0, 27_000.0]
    east_m = sorted(spot.x_m for spot in spots)
    assert max(b - a for a, b in pairwise(east_m)) <= 1600.0  # two squares of 800 m


def test_a_later_visit_of_a_square_is_another_spot():
    spots = Spots()
    for t_s, level_dbm in ((0.0, -60.0), (300.0, -85.0)):
        spots.add(5.0, 5.0, level_dbm, t_s)
    assert [spot.level_dbm for spot in spots] == [-60.0, -85.0]


def test_hours_at_one_place_lengthen_the_visits_and_not_the_squares():
    spots = Spots()
    for k in range(400):
        spots.add(5.0 + 30.0 * (k % 2), 5.0, -80.0, 100.0 * k)
    assert len(spots) <= MOST_SPOTS + 1
    assert {spot.x_m for spot in spots} == {5.0, 35.0}
