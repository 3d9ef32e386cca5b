import sys
from math import log10

from logger.core.baseline import NoBaseline
from logger.core.suspicion.rules import RULES
from logger.core.suspicion.sources import compare_sources
from logger.core.suspicion.spots import Spot
from tests.kit.suspicion_walks import Walk, gsm

HOME = [gsm(cid, -80 - cid % 7) for cid in range(10, 16)]
FOREIGN = gsm(99, mcc="310", mnc="260")


def test_a_cell_named_once_is_not_accused():
    assert Walk().scan(*HOME, FOREIGN).found == []


def test_each_rule_accuses_a_cell_once():
    found = Walk().scan(*HOME, FOREIGN, times=20).found
    assert len({(one.rule.id, one.cell) for one in found}) == len(found)


def test_findings_have_time_place_and_evidence():
    first = Walk().scan(*HOME, FOREIGN, times=3).found[0]
    assert first.rule.id == "P1"
    assert first.t_ns == 10 * 10**9
    assert abs(first.lat_deg - 47.0708) < 0.001
    assert first.evidence["operator"] == "310-260"
    assert "United States" in first.text


def test_rules_that_the_modem_cannot_serve_are_not_asked():
    not_asked = Walk().scan(*HOME, times=3).tracker.capabilities.not_asked(RULES.values())
    assert not_asked["T1"] == ("timing advance",)
    assert not_asked["N2"] == ("neighbour lists",)
    assert not_asked["B1"] == ("earlier walks",)
    assert "P1" not in not_asked
    assert "N1" not in not_asked


def test_trusted_cells_are_not_accused():
    class Trusting(NoBaseline):
        def trust_note(self, name):
            return "mine" if name.endswith("-99") else None

    assert Walk(baseline=Trusting()).scan(*HOME, FOREIGN, times=8).found == []


def test_memory_is_bounded():
    walk = Walk()
    for k in range(400):
        walk.scan(*(gsm(1000 + k * 5 + i) for i in range(5)), metres=30.0)
    memory = walk.tracker._memory
    assert len(memory.cells) <= 128
    assert all(len(cell.spots) <= 49 for cell in memory.cells.values())
    assert sys.getsizeof(walk.tracker._findings) < 100_000


def _spots(places, n=40, step_m=30.0):
    """Levels along a street of the strongest of several stations with 55 dB at 1 m."""
    spots = []
    for k in range(n):
        x_m = k * step_m
        d2_m2 = [(x_m - px) ** 2 + (py - 0.0) ** 2 + 100.0 for px, py in places]
        level = max(-15.0 - 16.0 * log10(d2) for d2 in d2_m2)
        spots.append(Spot(x_m, 3.0 * (k % 2), level, 10.0 * k))
    return spots


def test_two_places_are_told_from_one():
    one = compare_sources(_spots([(600.0, 40.0)]))
    two = compare_sources(_spots([(100.0, 40.0), (1100.0, 40.0)]))
    assert one.two_places < 1.0
    assert two.two_places > 3.0
    assert 800.0 < two.apart_m < 1200.0


def test_a_short_walk_says_nothing_about_places():
    assert compare_sources(_spots([(50.0, 40.0)], n=5)) is None
