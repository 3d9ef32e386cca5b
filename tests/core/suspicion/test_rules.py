"""Each rule: broken by what it aims at, and not by what its gate is there for."""

from dataclasses import replace

import pytest

from logger.core.suspicion.countries import countries
from logger.core.suspicion.rule import Rate
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.tracker import SuspicionTracker
from logger.core.types import Broadcast, CellReading, Record, Scan
from tests.kit.suspicion_walks import Walk, gsm

HOME = [gsm(cid, -80 - cid % 7) for cid in range(10, 16)]


def test_every_rule_says_what_it_needs_and_how_often_it_is_wrong():
    for rule in RULES.values():
        assert rule.needs
        assert rule.gate
        assert rule.harmless
        assert rule.strength == "warns" or rule.rate("GSM").cells > 0
        assert 0.0 <= rule.nats("GSM") < 8.0


def test_the_interval_of_a_rate():
    assert Rate(0, 50, 1.0, "").interval == pytest.approx((0.0, 2.996), abs=0.001)
    assert Rate(10, 50, 1.0, "").interval == pytest.approx((4.795, 18.390), abs=0.001)
    assert Rate(1, 77, 2.0, "").text == "1 of 77 cells in 2.0 h (0.01 to 2.79 an hour)"
    assert Rate(1, 77, 0.0, "").text == "1 of 77 cells"


def test_a_technology_with_an_alarm_has_no_lower_rate_than_its_own():
    """One of 23 GSM cells is not excused by 900 cells of LTE without an alarm."""
    assert RULES["S9"].rate("GSM").cells < 100
    assert RULES["S9"].rate("GSM").per_cell > RULES["S9"].rate("LTE").per_cell


def test_p1_a_network_of_no_country_near():
    foreign = gsm(99, mcc="310", mnc="260")
    walk = Walk().scan(*HOME, foreign, times=8)
    assert ("P1", 99) in walk.rules
    assert ("L4", 99) in walk.rules
    assert walk.word("310-260-1201-99") == "suspicious"


@pytest.mark.parametrize("mcc", ["505", "266", "340", "362", "553", "554", "647", "742"])
def test_p1_a_country_with_territories_far_away(mcc):
    mnc = min(countries().networks[mcc])
    assert ("P1", 99) in Walk().scan(*HOME, gsm(99, mcc=mcc, mnc=mnc), times=8).rules


@pytest.mark.parametrize(
    "harmless",
    [
        gsm(99, mcc="293", mnc="41"),  # Slovenia begins 35 km from here
        gsm(99, mcc="232", mnc="91", arfcn=960),  # the railway
        gsm(99, mcc="262", mnc="10", arfcn=960),  # a railway of another country
        gsm(99, mcc="232", mnc="001"),  # a modem that prints three digits
    ],
)
def test_p1_is_silent_about_borders_and_railways(harmless):
    assert not [rule for rule, _ in Walk().scan(*HOME, harmless, times=8).rules if rule == "P1"]


def test_p1_a_test_network_counts_where_there_are_others():
    alone = [gsm(cid, mcc="001") for cid in range(5)]
    assert Walk().scan(*alone, times=8).rules == set()
    assert ("P1", 99) in Walk().scan(*HOME, gsm(99, mcc="001"), times=8).rules
    # a modem that names the serving cell alone, and is caught where the walker stands
    caught = (
        Walk().scan(gsm(10), metres=0.0, times=20).scan(gsm(99, mcc="001"), metres=0.0, times=8)
    )
    assert caught.word("001-01-1201-99") == "suspicious"
    damaged = Walk().scan(*alone, times=4).scan(gsm(10), *alone).scan(*alone, times=4)
    assert damaged.rules == set()


@pytest.mark.parametrize(
    ("mcc", "metres", "word"),
    [
        ("001", 20.0, "suspicious"),
        ("001", 10.0, "nothing unusual"),  # a laboratory
        ("999", 20.0, "nothing unusual"),  # the private network of a harbour
    ],
)
def test_p1_a_test_network_that_has_caught_the_modem_from_the_begin(mcc, metres, word):
    caught = gsm(99, mcc=mcc)
    assert Walk().scan(caught, metres=metres, times=20).word(caught.cell) == word


def test_p1_is_silent_about_a_simulation():
    assert (
        Walk().scan(*(gsm(cid, mcc="001") for cid in range(3)), metres=20.0, times=20).rules
        == set()
    )


def test_p4_one_cell_identity_in_two_areas():
    walk = Walk().scan(*HOME, times=5).scan(gsm(10, lac=1202), *HOME[1:], times=5)
    assert ("P4", 10) in walk.rules


def test_p4_is_withdrawn_where_the_operator_renumbers():
    walk = Walk().scan(*HOME, times=5)
    walk.scan(*[replace(cell, lac=1202) for cell in HOME[:2]], *HOME[2:], times=5)
    assert walk.word("232-01-1202-10") == "unusual"
    walk.scan(*[replace(cell, lac=1202) for cell in HOME], times=5)
    assert not walk.tracker.conspicuous()


@pytest.mark.parametrize(("rise_db", "word"), [(5.0, "unusual"), (20.0, "suspicious")])
def test_an_area_that_the_operator_renumbers_is_one_cause(rise_db, word):
    """A standing walker whose modem names its serving cell alone cannot see the others change."""
    walk = Walk().scan(HOME[0], metres=0.0, times=15)
    renamed = gsm(10, HOME[0].rssi_dbm + rise_db, lac=1300)
    walk.scan(renamed, metres=0.0, times=6)
    assert walk.word(renamed.cell) == word


@pytest.mark.parametrize("n_silent", [0, 1, 2])
def test_what_was_heard_before_a_lift_is_not_compared(n_silent):
    """Its doors close: no cell is heard, then other ones, above the roofs."""
    above = gsm(50, -60, lac=1300)
    walk = Walk().scan(*HOME, metres=0.0, times=15).scan(metres=0.0, times=n_silent)
    walk.scan(above, gsm(15, -55), metres=0.0, times=30)
    assert {rule for rule, _ in walk.rules} == (set() if n_silent > 1 else {"L1", "L3", "S2", "S3"})


@pytest.mark.parametrize(("cid", "is_accused"), [(10, False), (99, True)])
def test_p5_one_cell_of_two_networks_is_no_contradiction(cid, is_accused):
    """Networks share it, and the modem prints one or the other."""
    shared = replace(gsm(cid, -60, mnc="10"), arfcn=HOME[0].arfcn)
    walk = Walk().scan(*HOME, times=5).scan(*HOME[1:], shared, times=5)
    assert (("P5", cid) in walk.rules) == is_accused


def test_p6_one_identity_on_two_channels_for_a_while():
    other = gsm(10, arfcn=77)
    assert ("P6", 10) in Walk().scan(*HOME, times=5).scan(other, *HOME[1:], times=5).rules
    assert ("P6", 10) not in Walk().scan(*HOME, times=5).scan(other, *HOME[1:], times=2).rules


@pytest.mark.parametrize(("times", "is_accused"), [(2, False), (3, True)])
def test_p6_one_scan_names_an_identity_on_two_channels(times, is_accused):
    # a modem that lists all cells hears a copy and its original; in a handover one scan may
    walk = Walk().scan(*HOME, times=2).scan(*HOME, gsm(10, -60, arfcn=77), times=times)
    assert (("P6", 10) in walk.rules) == is_accused


def test_p6_two_handovers_are_no_copy():
    walk = Walk()
    for _ in range(3):
        walk.scan(*HOME, times=3).scan(*HOME, gsm(10, -60, arfcn=77))
    assert ("P6", 10) not in walk.scan(*HOME).rules


def test_l1_l2_an_area_that_no_other_cell_has():
    many = [gsm(cid, -80) for cid in range(10, 20)]
    walk = Walk().scan(*many, times=3).scan(*many, gsm(99, -70, lac=7777), times=25)
    assert {("L1", 99), ("L2", 99)} <= walk.rules
    # at a border the others of the new area follow
    border = [gsm(cid, -80, lac=1202) for cid in range(30, 40)]
    walk = Walk().scan(*many, times=3).scan(*many, border[0], times=3).scan(*border, times=15)
    assert walk.rules == set()


@pytest.mark.parametrize(("n_areas", "is_accused"), [(1, True), (12, False)])
def test_l1_l2_are_silent_where_most_areas_have_one_cell(n_areas, is_accused):
    """On a mountain."""
    near = [gsm(cid, -80, lac=1201 + cid % n_areas) for cid in range(10, 22)]
    walk = Walk().scan(*near, times=3).scan(*near, gsm(99, -70, lac=7777), times=25)
    assert bool({("L1", 99), ("L2", 99)} & walk.rules) == is_accused


def test_l1_l2_are_withdrawn_where_the_cells_of_many_areas_come_later():
    """On the way to its top the first far cell is alone."""
    valley, far = HOME, [gsm(cid, -80, lac=cid) for cid in range(30, 45)]
    walk = Walk().scan(*valley, times=3).scan(*valley, far[0], times=25)
    assert ("L1", 30) in walk.rules
    walk.scan(*far, times=4)
    assert not walk.tracker.conspicuous()


def test_l1_an_area_each_minute_is_no_far_view():
    """A station that changes its area keeps its channel."""
    walk = Walk().scan(*HOME, times=3)
    for lac in range(7000, 7006):
        walk.scan(*HOME, gsm(lac, -60, lac=lac, arfcn=99), times=20)
    assert {("L1", lac) for lac in range(7000, 7006)} <= walk.rules


@pytest.mark.parametrize(("seconds", "is_accused"), [(60.0, False), (90.0, True)])
def test_l1_without_a_position_waits_as_on_foot(seconds, is_accused):
    tracker = SuspicionTracker()
    cells = (*HOME, gsm(99, -60, lac=7777))
    found = []
    for k in range(3 + round(seconds / 5.0) + 1):
        t_ns = k * 5 * 10**9
        scan = Scan(t_ns, tuple(HOME) if k < 3 else cells)
        found += tracker.feed(Record(t_ns, "modem", scan))
    assert ("L1" in {finding.rule.id for finding in found}) == is_accused


def test_l3_a_new_area_while_standing():
    elsewhere = gsm(50, lac=1300)
    standing = Walk().scan(*HOME, metres=0.0, times=15).scan(elsewhere, metres=0.0, times=4)
    assert ("L3", 50) in standing.rules
    walking = Walk().scan(*HOME, metres=7.0, times=15).scan(elsewhere, metres=7.0, times=4)
    assert ("L3", 50) not in walking.rules


def test_l3_is_silent_where_neighbours_of_the_area_were_heard_before():
    """At a border; a station that was heard since the walker stands is still a new one."""
    border = [gsm(50, lac=1300), gsm(51, lac=1300)]
    walk = Walk().scan(*HOME, border[1], metres=0.0, times=15)
    assert ("L3", 50) not in walk.scan(*border, *HOME, metres=0.0, times=4).rules
    walk = Walk().scan(*HOME, metres=0.0, times=15).scan(*HOME, border[0], metres=0.0, times=2)
    assert ("L3", 50) in walk.scan(border[0], *HOME, metres=0.0, times=4).rules


def test_l4_takes_two_scans_of_a_slow_modem():
    """A test network on the air for a minute, where a scan of all channels takes half of one."""
    walk = Walk().scan(*HOME, seconds=30.0, times=3)
    walk.scan(*HOME, gsm(99, -60, mcc="001"), seconds=30.0, times=2)
    assert walk.word("001-01-1201-99") == "suspicious"


def test_n1_no_neighbours_for_a_while():
    assert ("N1", 10) in Walk().scan(*HOME, times=3).scan(HOME[0], times=6).rules
    assert ("N1", 10) not in Walk().scan(*HOME, times=3).scan(HOME[0], times=3).rules
    assert ("N1", 10) not in Walk().scan(HOME[0], times=9).rules  # a modem that prints none
    weak = gsm(10, -100)
    assert ("N1", 10) not in Walk().scan(*HOME, times=3).scan(weak, times=6).rules


def test_n2_n3_n4_lists_of_neighbours():
    own = tuple(sorted(cell.arfcn for cell in HOME))
    listed = [gsm(cid, -80, broadcast=Broadcast(own)) for cid in range(10, 18)]
    others = [gsm(cid, -80, mnc="03", lac=4301, arfcn=100 + cid) for cid in range(60, 64)]
    nobodys = gsm(98, -70, arfcn=120, broadcast=Broadcast((121, 122, 123)))
    strangers = gsm(99, -70, arfcn=119, broadcast=Broadcast(tuple(c.arfcn for c in others)))
    walk = Walk().scan(*listed, *others, nobodys, strangers, times=4)
    assert {("N2", 98), ("N3", 98), ("N4", 99)} <= walk.rules
    unsure = Broadcast((121, 122, 123), broadcast_unsure=True)
    walk = Walk().scan(*listed, gsm(98, -70, arfcn=21, broadcast=unsure), times=4)
    assert ("N2", 98) not in walk.rules


def test_s2_s3_levels_that_jump_while_the_walker_hardly_moves():
    louder = gsm(15, -55)
    jump = Walk().scan(*HOME, metres=1.0, times=6).scan(*HOME[:5], louder, metres=1.0, times=4)
    assert ("S2", 15) in jump.rules
    fast = Walk().scan(*HOME, metres=60.0, times=6).scan(*HOME[:5], louder, metres=60.0, times=4)
    assert ("S2", 15) not in fast.rules
    new = Walk().scan(*HOME, metres=1.0, times=6).scan(gsm(99, -50), *HOME, metres=1.0, times=4)
    assert ("S3", 99) in new.rules


@pytest.mark.parametrize(("metres", "is_named"), [(0.0, True), (20.0, False)])
def test_s2_s3_wait_for_the_scans_of_a_slow_modem_while_the_walker_stands(metres, is_named):
    """A modem that lists all cells once a minute."""
    walk = Walk().scan(*HOME, metres=metres, seconds=60.0, times=5)
    walk.scan(*HOME[:5], gsm(15, -55), gsm(99, -50), metres=metres, seconds=60.0, times=4)
    assert (("S2", 15) in walk.rules) == is_named
    assert (("S3", 99) in walk.rules) == is_named


@pytest.mark.parametrize("repeats", [False, True])
def test_s2_a_modem_that_repeats_old_levels_of_neighbours(repeats):
    """The old level is of a place that the walker has left."""
    walk = Walk()
    for k in range(5):
        weak = gsm(15, -85 if repeats else -85 - k % 2)
        walk.scan(*HOME[:5], weak, metres=7.0)
    walk.scan(gsm(15, -60), *HOME[:5], metres=2.0, times=4)
    assert (("S2", 15) in walk.rules) != repeats


@pytest.mark.parametrize(("rise_db", "dbm", "is_named"), [(0.0, -68, True), (25.0, -75, False)])
def test_s3_is_silent_where_all_levels_rise(rise_db, dbm, is_named):
    """A walker leaves a house, and hears more cells than in it."""
    walk = Walk().scan(*_weaker(HOME, rise_db), metres=1.0, times=6)
    walk.scan(*HOME, gsm(99, dbm), metres=1.0, times=4)
    assert (("S3", 99) in walk.rules) == is_named


@pytest.mark.parametrize(("mnc", "is_named"), [("01", True), ("03", False)])
def test_s3_a_scan_of_one_network_says_nothing_of_another_that_comes_late(mnc, is_named):
    """A roaming card is moved to another network; neighbours have no identity."""
    nameless = [_nameless(cell) for cell in HOME[1:]]
    walk = Walk().scan(HOME[0], *nameless, metres=0.0, times=70)
    walk.scan(gsm(99, -50, mnc=mnc, arfcn=99), metres=0.0, times=4)
    assert (("S3", 99) in walk.rules) == is_named


def _standing(*after, seconds=30.0, metres=0.0):
    """Rules after scans of a channel that is taken over, and the word of the one who took it."""
    walk = Walk().scan(*HOME, metres=metres, seconds=seconds, times=5)
    walk.scan(*after, metres=metres, seconds=seconds, times=3)
    return {rule for rule, _ in walk.rules}, walk.word(after[-1].cell)


@pytest.mark.parametrize("cid", [15, 99])
@pytest.mark.parametrize("seconds", [10.0, 60.0])
def test_s12_a_channel_is_taken_over_beside_a_walker_who_stands(cid, seconds):
    rules, word = _standing(*HOME[:5], gsm(cid, -50, arfcn=16), seconds=seconds)
    assert "S12" in rules
    assert word == "suspicious"


@pytest.mark.parametrize(
    ("before", "new", "word"),
    [
        (HOME, gsm(99, -50), "unusual"),
        (HOME, gsm(99, -50, lac=1300), "suspicious"),  # and L3
        ([replace(cell, arfcn=None) for cell in HOME], gsm(99, -50, arfcn=7), "unusual"),
    ],
)
def test_s12_a_cell_switched_on_is_unusual(before, new, word):
    walk = Walk().scan(*before, metres=0.0, seconds=10.0, times=9)
    walk.scan(new, *before, metres=0.0, seconds=10.0, times=4)
    assert ("S12", 99) in walk.rules
    assert walk.word(new.cell) == word


def test_s12_a_cell_vanishes_where_a_modem_prints_no_channels():
    home = [replace(cell, arfcn=None) for cell in HOME]
    walk = Walk().scan(*home, metres=0.0, seconds=10.0, times=9)
    new = replace(gsm(99, -50), arfcn=None)
    walk.scan(*home[:5], new, metres=0.0, seconds=10.0, times=4)
    assert walk.word(new.cell) == "suspicious"


def test_s12_is_silent_about_walkers_and_about_what_changes_all_levels():
    louder = gsm(15, -50)
    assert "S12" not in _standing(*HOME[:5], louder, metres=40.0)[0]
    assert "S12" not in _standing(*HOME[:5], louder, seconds=1.0)[0]
    turned = [gsm(cid, -95 - cid % 7) for cid in range(10, 15)]
    assert "S12" not in _standing(*turned, louder)[0]
    assert "S12" not in _standing(*HOME[:5], gsm(15, -76))[0]  # not beside the walker


def _nameless(cell):
    return replace(cell, mcc=None, mnc=None, lac=None, cid=None)


@pytest.mark.parametrize(("bsic", "is_new"), [(8, False), (9, True), (None, False)])
def test_s3_s12_a_neighbour_without_an_identity_was_heard(bsic, is_new):
    """It appears only by name, as where a modem names none but its serving cell."""
    new = gsm(99, -50)
    before = replace(_nameless(new), bsic=bsic)
    walk = Walk().scan(*HOME, before, metres=0.0, seconds=10.0, times=6)
    walk.scan(new, *HOME, metres=0.0, seconds=10.0, times=4)
    assert (("S3", 99) in walk.rules) == is_new
    assert (("S12", 99) in walk.rules) == is_new


@pytest.mark.parametrize(("raised", "is_named"), [(0, True), (1, True), (3, False)])
def test_s12_is_silent_in_a_lift(raised, is_named):
    """Above the roofs many cells become stronger, and some stay."""
    many = [gsm(cid, -85 - cid % 7) for cid in range(10, 17)]
    louder = [gsm(cid, -60 - cid % 7) for cid in range(10, 10 + raised)]
    walk = Walk().scan(*many, metres=0.0, seconds=30.0, times=5)
    walk.scan(*louder, *many[raised:6], gsm(16, -50), metres=0.0, seconds=30.0, times=3)
    assert (("S12", 16) in walk.rules) == is_named


def test_s4_stronger_than_on_the_first_visit():
    walk = Walk().scan(*HOME, metres=8.0, times=10).scan(*HOME, metres=-8.0, times=10)
    assert ("S4", 15) not in walk.rules
    louder = gsm(15, -50)
    walk = Walk().scan(*HOME, metres=8.0, times=10).scan(*HOME[:5], times=30, metres=0.0)
    assert ("S4", 15) in walk.scan(*HOME[:5], louder, metres=-8.0, times=9).rules


def test_t1_rings_that_do_not_meet():
    walk = Walk()
    for ta in (0, 0, 0, 9, 9, 0, 9, 0):
        walk.scan(gsm(10, -70, ta=ta), *HOME[1:], metres=60.0, times=1)
    assert ("T1", 10) in walk.rules
    walk = Walk()
    for ta in (3, 3, 4, 3, 2, 3, 3, 4):
        walk.scan(gsm(10, -70, ta=ta), *HOME[1:], metres=60.0)
    assert ("T1", 10) not in walk.rules


def test_c1_compares_the_offset_with_that_of_the_operators_other_cells():
    usual = [gsm(cid, c1=20, c2=80) for cid in range(10, 15)]
    assert not Walk().scan(*usual, times=3).rules
    attractive = gsm(99, c1=20, c2=120)
    assert ("C1", 99) in Walk().scan(*usual, attractive, times=3).rules


def test_c1_does_not_rest_on_a_single_reading():
    usual = [gsm(cid, c1=20, c2=20) for cid in range(10, 15)]
    ordinary, wrong = gsm(99, c1=20, c2=20), gsm(99, c1=20, c2=120)
    walk = Walk().scan(*usual, ordinary, times=3).scan(*usual, wrong)
    walk.scan(*usual, ordinary, times=3)
    assert ("C1", 99) not in walk.rules


@pytest.mark.parametrize(
    ("broadcast", "is_accused"),
    [
        (Broadcast(cro_db=60, penalty_time=0), True),
        (Broadcast(cro_db=60, penalty_time=31), False),  # 31: the offset is subtracted
        (Broadcast(cro_db=60, penalty_time=0, broadcast_unsure=True), False),
    ],
)
def test_c1_takes_the_offset_that_the_cell_broadcasts(broadcast, is_accused):
    usual = [gsm(cid, broadcast=Broadcast(cro_db=0, penalty_time=0)) for cid in range(10, 15)]
    walk = Walk().scan(*usual, gsm(99, broadcast=broadcast), times=4)
    assert (("C1", 99) in walk.rules) == is_accused


def test_lists_printed_once_accuse_nobody():
    """N2, N3, N4 and the needs of the rules: an unsure list is no list."""
    own = tuple(sorted(cell.arfcn for cell in HOME))
    cells = [gsm(cid, -80, broadcast=Broadcast(own)) for cid in range(10, 18)]
    others = [gsm(cid, -80, mnc="03", lac=4301, arfcn=100 + cid) for cid in range(60, 64)]
    strange = Broadcast(tuple(c.arfcn for c in others), broadcast_unsure=True)
    walk = Walk().scan(*cells, *others, gsm(99, -70, arfcn=14, broadcast=strange), times=8)
    assert not {(name, 99) for name in ("N1", "N2", "N3", "N4")} & walk.rules
    unsure = [replace(c, broadcast=replace(c.broadcast, broadcast_unsure=True)) for c in cells]
    capabilities = Walk().scan(*unsure, times=4).tracker.capabilities
    assert capabilities.not_asked(RULES.values())["N2"] == ("neighbour lists",)


def test_c2_a_modem_that_leaves_a_good_cell_for_a_weak_one():
    walk = Walk().scan(gsm(10, -70), times=4).scan(gsm(99, -90), times=4)
    assert ("C2", 99) in walk.rules
    assert walk.word("232-01-1201-99") == "nothing unusual"  # most words that it gave were false
    walk = Walk().scan(gsm(10, -70), times=4).scan(gsm(99, -74), times=4)
    assert ("C2", 99) not in walk.rules


def test_c2_between_networks_no_level_decides():
    """A roaming card is moved to a preferred network."""
    walk = Walk().scan(gsm(10, -70), times=70).scan(gsm(99, -90, mnc="03"), times=4)
    assert ("C2", 99) not in walk.rules


def test_c2_the_way_back_from_a_rogue_cell_that_fell_silent():
    walk = Walk().scan(gsm(10, -85), times=4).scan(gsm(99, -55), times=4)
    assert ("C2", 10) not in walk.scan(gsm(10, -85), times=4).rules


def test_s3_a_full_list_of_several_networks_could_name_another():
    strangers = [gsm(60 + k, -84 - k, mnc="03", lac=4301) for k in range(2)]
    walk = Walk().scan(*HOME[:3], *strangers, times=4)
    walk.scan(*HOME[:3], *strangers, gsm(99, -50, mnc="05", lac=9101), times=3)
    assert ("S3", 99) in walk.rules


LTE = CellReading("serving", "LTE", "232", "01", tac=7, cid=9, rsrp_dbm=-90.0)
UMTS = CellReading("serving", "WCDMA", "232", "01", lac=7, cid=90000, rscp_dbm=-90.0)


def test_r1_a_good_cell_of_4g_left_for_2g_is_enough():
    walk = Walk().scan(LTE, times=4).scan(gsm(10), times=4)
    assert walk.rules == {("R1", 10)}
    assert walk.word("232-01-1201-10") == "suspicious"
    short = Walk().scan(LTE, times=4).scan(gsm(10), times=2).scan(LTE, times=4)
    assert short.rules == set()


def test_r1_takes_the_last_level_of_4g():
    """A cell that fades, as in a cellar, is left for want of a better one."""
    weak = replace(LTE, rsrp_dbm=-118.0)
    assert Walk().scan(LTE, times=4).scan(weak, times=2).scan(gsm(10), times=4).rules == set()
    assert Walk().scan(weak, times=4).scan(LTE).scan(gsm(10), times=4).rules == {("R1", 10)}


def test_r1_counts_a_change_once_and_not_one_by_a_call_on_3g():
    walk = Walk().scan(LTE, times=4).scan(gsm(10), times=4).scan(gsm(11), times=4)
    assert walk.rules == {("R1", 10)}
    assert walk.scan(LTE, times=4).scan(gsm(11), times=4).rules == {("R1", 10), ("R1", 11)}
    by_3g = Walk().scan(LTE, times=4).scan(UMTS, times=6).scan(gsm(10), times=4)
    assert by_3g.rules == set()
    passing = Walk().scan(LTE, times=4).scan(UMTS, times=2).scan(gsm(10), times=4)
    assert passing.rules == {("R1", 10)}
    named_late = replace(gsm(10), cid=None)
    walk = Walk().scan(LTE, times=4).scan(named_late, times=3).scan(gsm(10), times=2)
    assert walk.rules == {("R1", 10)}


@pytest.mark.parametrize(
    ("dbm", "metres", "times", "rules"),
    [
        (-60, 0.0, 12, {("R1", 10)}),
        (-60, 8.0, 12, {("R1", 10)}),
        (-95, 0.0, 12, set()),  # a cellar
        (-60, 40.0, 12, set()),  # a tunnel
        (-60, 0.0, 80, set()),
    ],
)
def test_r1_all_is_jammed_before_the_2g_cell(dbm, metres, times, rules):
    """No cell is heard for a minute, then 2G as good as without walls between."""
    walk = Walk().scan(LTE, metres=metres, times=4).scan(metres=metres, times=times)
    assert walk.scan(gsm(10, dbm), metres=metres, times=4).rules == rules
    if rules:
        (found,) = walk.found
        assert ", no cell was heard for 65 s, and 2G was kept for " in found.text


def test_r1_a_modem_that_prints_nothing_was_not_jammed():
    walk = Walk().scan(LTE, metres=0.0, times=4).scan(gsm(10, -60), metres=0.0, seconds=60.0)
    assert walk.scan(gsm(10, -60), metres=0.0, times=4).rules == set()


@pytest.mark.parametrize(("seconds", "is_accused"), [(5.0, True), (12.0, False), (25.0, False)])
def test_r1_a_modem_that_starts_again_looks_for_2g_first(seconds, is_accused):
    walk = Walk().scan(LTE, times=4).scan(gsm(10), seconds=seconds)
    assert (("R1", 10) in walk.scan(gsm(10), times=4).rules) == is_accused


def test_r1_a_slow_modem_is_asked():
    slow = Walk().scan(LTE, seconds=15.0, times=4).scan(gsm(10), seconds=15.0, times=3)
    assert slow.rules == {("R1", 10)}


def test_r1_is_about_one_network():
    other = gsm(10, mnc="03", lac=4301)
    assert ("R1", 10) not in Walk().scan(LTE, times=4).scan(other, times=9).rules


@pytest.mark.parametrize(("metres", "is_accused"), [(6.0, False), (40.0, True), (0.0, True)])
def test_l1_waits_for_the_second_cell_of_a_border_as_long_as_a_walker_needs(metres, is_accused):
    """30 s of a new area with old cells beside it: on foot a border, in a car or standing not."""
    walk = Walk().scan(*HOME, metres=metres, times=3)
    walk.scan(*HOME, gsm(99, -70, lac=1202), metres=metres, times=7)
    assert (("L1", 99) in walk.rules) == is_accused
    walk.scan(*HOME, gsm(99, -70, lac=1202), metres=metres, times=20)
    assert ("L1", 99) in walk.rules


def test_l1_l2_are_withdrawn_where_another_cell_of_the_area_comes_later():
    """What looked like an invented area was a border; a single scan may be damaged."""
    many = [gsm(cid, -80) for cid in range(10, 20)]
    first, second = gsm(99, -70, lac=1202), gsm(98, -75, lac=1202)
    walk = Walk().scan(*many, times=3).scan(*many, first, times=25)
    assert {("L1", 99), ("L2", 99)} <= walk.rules
    assert walk.scan(first, second).word(first.cell) == "suspicious"
    assert walk.scan(first, second).word(first.cell) == "nothing unusual"
    other_rat = replace(second, cid=97, rat="WCDMA", bsic=None, psc=5, rscp_dbm=-75.0)
    walk = Walk().scan(*many, times=3).scan(*many, first, times=25).scan(first, other_rat, times=3)
    assert walk.word(first.cell) == "suspicious"


@pytest.mark.parametrize(("metres", "is_accused"), [(180.0, True), (350.0, False)])
def test_l1_is_silent_in_an_aircraft(metres, is_accused):
    walk = Walk().scan(*HOME, metres=metres, times=3)
    walk.scan(*HOME, gsm(99, -70, lac=1202), metres=metres, times=20)
    assert (("L1", 99) in walk.rules) == is_accused


def _weaker(cells, by_db):
    return [replace(cell, rssi_dbm=cell.rssi_dbm - by_db) for cell in cells]


def test_s2_is_silent_where_all_levels_rise():
    """A walker who leaves a house, also with a cell that the modem lists now and then."""
    inside = _weaker(HOME, 25.0)
    walk = Walk().scan(*inside, metres=0.0, times=2).scan(*inside[:-1], metres=0.0, times=8)
    walk.scan(*HOME[:-1], metres=0.0, times=4).scan(*HOME, metres=0.0, times=4)
    assert walk.rules == set()
    alone = Walk().scan(*inside[:-1], inside[-1], metres=0.0, times=5)
    assert ("S2", 15) in alone.scan(*inside[:-1], HOME[-1], metres=0.0, times=4).rules


def test_s2_compares_with_neighbours_that_have_no_identity():
    nameless = [replace(cell, mcc=None, mnc=None, lac=None, cid=None) for cell in HOME[1:]]
    walk = Walk().scan(*_weaker([HOME[0], *nameless], 25.0), metres=0.0, times=5)
    assert walk.scan(HOME[0], *nameless, metres=0.0, times=5).rules == set()
    walk = Walk().scan(*_weaker(HOME[:1], 25.0), *nameless, metres=0.0, times=5)
    assert ("S2", 10) in walk.scan(HOME[0], *nameless, metres=0.0, times=5).rules


def test_a_doubtful_identity_breaks_no_rule():
    unsure = gsm(99, mcc="310", mnc="260", identity_unsure=True)
    assert Walk().scan(*HOME, unsure, times=8).rules == set()
