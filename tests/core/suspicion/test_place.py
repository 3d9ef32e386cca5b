"""The place of a station: two places of one identity, and stations that move."""

from math import log10

import pytest

from logger.core.suspicion.rules import RULES
from tests.kit.suspicion_walks import Walk, gsm

HOME = [gsm(cid, -80) for cid in range(10, 14)]


def _past(places_m, slope_db, step_m=30.0):
    """A walk past stations beside a street: the strongest of them, -50 dBm within 30 m."""
    walk = Walk()
    for k in range(1, round((places_m[-1] + 100.0) / step_m) + 1):
        away_m = min(max(abs(k * step_m - place_m), 30.0) for place_m in places_m)
        level_dbm = -50.0 - slope_db * log10(away_m / 30.0)
        walk.scan(gsm(10, round(level_dbm)), metres=step_m)
    return walk


@pytest.mark.parametrize(
    ("apart_m", "slope_db", "rules"),
    [
        (900.0, 15.0, {"S9", "S5"}),  # log evidence 3.2
        (450.0, 25.0, {"S9"}),  # 3.4: an uneven field around one antenna may look like that
        (350.0, 25.0, set()),  # 1.4
    ],
)
def test_far_places_need_less_evidence_than_near_ones(apart_m, slope_db, rules):
    found = _past((100.0, 100.0 + apart_m), slope_db).found
    assert {finding.rule.id for finding in found} == rules
    assert all(finding.evidence["log_evidence"] < 3.5 for finding in found)


@pytest.mark.parametrize(("apart_m", "text"), [(437, "437 m apart"), (1307, "1.3 km apart")])
def test_a_distance_is_rounded_as_other_lengths(apart_m, text):
    assert text in RULES["S5"].text_of({"apart_m": apart_m, "log_evidence": 3.6})


def test_one_place_is_no_finding():
    assert _past((500.0,), 25.0).found == []


def test_two_places_of_few_squares_are_found():
    """A car hears a clone and its original in few squares: no square may go untested."""
    found = _past((100.0, 1000.0), 25.0, step_m=110.0).found
    assert {finding.rule.id for finding in found} == {"S9", "S5"}
    assert found[0].evidence["squares"] < 10


def _stand(levels_dbm, others=lambda k: HOME, *, metres=0.0):
    walk = Walk().scan(*HOME, metres=metres, times=6)
    for k, level_dbm in enumerate(levels_dbm):
        walk.scan(*others(k), gsm(99, level_dbm), metres=metres, times=2)
    return walk


def test_s7_a_level_that_changes_while_all_others_stay():
    walk = _stand(range(-85, -55, 2))
    (finding,) = [one for one in walk.found if one.rule.id == "S7"]
    assert finding.cell == "232-01-1201-99"
    assert finding.rule.family == "place"
    assert finding.evidence["change_db"] >= 20
    assert (finding.evidence["cells"], finding.evidence["other_db"]) == (4, 0)


def test_s7_is_silent_where_all_levels_change():
    """The walker goes on while the receiver repeats its position, or turns the antenna."""
    fading = lambda k: [gsm(cid, -70 - 2 * k) for cid in range(10, 14)]  # noqa: E731
    assert ("S7", 99) not in _stand(range(-85, -55, 2), fading).rules


def test_s7_is_silent_without_another_cell_to_compare_with():
    walk = Walk().scan(*HOME, metres=0.0, times=6)
    for level_dbm in range(-85, -55, 2):
        walk.scan(gsm(99, level_dbm), metres=0.0, times=2)
    # the others were heard for half a minute only
    assert ("S7", 99) not in walk.rules


def test_s7_is_silent_where_the_others_are_heard_after_the_change_alone():
    """A walker who enters a house, with a modem that lists other cells there."""
    walk = Walk().scan(gsm(9, -60), metres=0.0, times=15)
    walk.scan(gsm(9, -85), gsm(10, -90), gsm(11, -92), metres=0.0, times=40)
    assert not {one for one in walk.rules if one[0] == "S7"}


def test_s7_is_silent_where_most_of_a_list_come_and_go():
    """The walker goes on, the receiver repeats its position, and two far cells stay by chance."""
    passed = lambda k: [*HOME[:2], *[gsm(20 + 4 * (k // 3) + i, -80) for i in range(4)]]  # noqa: E731
    assert ("S7", 99) not in _stand(range(-85, -55, 2), passed).rules


def test_s7_is_silent_while_walking():
    assert ("S7", 99) not in _stand(range(-85, -55, 2), metres=7.0).rules


def _street(k, *, loss_db=0.0):
    """Four cells whose levels stay along a street, and two that the walk passes."""
    here_m = 6.0 * k
    past = [(91, 300.0), (92, 900.0)]
    levels = [(cid, -76.0 - cid % 10) for cid in range(10, 14)]
    levels += [(cid, -45.0 - 30.0 * log10(max(abs(here_m - at), 30.0) / 30.0)) for cid, at in past]
    return [gsm(cid, round(level_dbm - loss_db)) for cid, level_dbm in levels]


def _walk_with_houses(loss_db, indoors, drift_m, n=180):
    """North along the street; `indoors` are scans, while the position drifts there and back."""
    steps = round(drift_m / 25.0)
    walk, k = Walk(), 0
    for scan in range(n):
        is_indoors = scan in indoors
        k += not is_indoors
        metres = (25.0 if scan % (2 * steps) < steps else -25.0) if is_indoors else 6.0
        walk.scan(*_street(k, loss_db=loss_db if is_indoors else 0.0), metres=metres, seconds=10.0)
    return walk


@pytest.mark.parametrize(("indoors", "drift_m"), [(range(60, 100), 125.0), (range(40), 50.0)])
def test_walls_that_weaken_all_cells_are_of_no_cell(indoors, drift_m):
    """In a house on the way, and where the walk begins."""
    rules = {rule for rule, _ in _walk_with_houses(30.0, indoors, drift_m).rules}
    assert not rules & {"S4", "S5", "S6"}


@pytest.mark.parametrize("leap_m", [500.0, 1500.0])
@pytest.mark.parametrize(("begin", "end"), [(180, 240), (0, 240), (120, 360)])
def test_a_position_that_leaps_for_a_while_is_of_no_cell(leap_m, begin, end):
    """A reflection or a cold start puts it elsewhere; the levels stay those of the street."""
    walk, off_m = Walk(), 0.0
    for k in range(600):
        to_m = leap_m if begin <= k < end else 0.0
        walk.scan(*_street(0.7 * k), metres=4.2 + to_m - off_m, seconds=1.0)
        off_m = to_m
    assert not {rule for rule, _ in walk.rules} & {"S4", "S5", "S6", "S9"}


@pytest.mark.parametrize("network", ["01", "03"])
def test_a_repeater_in_a_car_is_of_no_cell(network):
    """It raises all cells of one network, or of the only one that is heard, for two minutes."""
    walk = Walk()
    for k in range(180):
        raised_db = 25.0 if 100 <= k < 124 else 0.0
        other = [gsm(60 + n, -80 - n, mnc=network, lac=4301) for n in range(4)]
        other = other if network == "03" else []
        walk.scan(*_street(k, loss_db=-raised_db), *other, metres=6.0)
    assert not {rule for rule, _ in walk.rules} & {"S2", "S3", "S4", "S5", "S6", "S9", "S12"}
