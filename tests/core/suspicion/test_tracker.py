import sys
from dataclasses import replace
from math import log10

import pytest

from logger.core.baseline import NotedBaseline
from logger.core.suspicion.rule import Rate, ScanRule
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
    class Trusting(NotedBaseline):
        def trust_note(self, name):
            return "mine" if name.endswith("-99") else None

    assert Walk(baseline=Trusting()).scan(*HOME, FOREIGN, times=8).found == []


def _loud(_memory, cell):
    return {} if cell.heard.level_dbm > -50.0 else None


def _quiet(memory, name):
    cell = memory.cells.get(name)
    return cell is not None and cell.heard.level_dbm < -90.0


@pytest.fixture
def loud(monkeypatch):
    """A rule of this test alone: a loud cell is suspicious until it is quiet."""
    rule = ScanRule(
        id="X1", family="signal", needs=("level",), gate="none", sentence="is loud",
        harmless="nothing", check=_loud, detection=1.0, elsewhere=Rate(1, 1000, 0.0, "a test"),
        strength="suffices", refuted_by=_quiet,
    )  # fmt: skip
    monkeypatch.setitem(RULES, "X1", rule)


@pytest.mark.usefixtures("loud")
def test_a_rule_needs_nothing_but_itself():
    walk = Walk().scan(*HOME, gsm(99, -45), times=3)
    assert ("X1", 99) in walk.rules
    assert walk.word("232-01-1201-99") == "suspicious"


@pytest.mark.usefixtures("loud")
def test_a_finding_that_later_scans_refute_is_withdrawn():
    walk = Walk().scan(*HOME, gsm(99, -45), gsm(98, -49), times=3)
    assert walk.tracker.worst == "232-01-1201-98"
    walk.scan(*HOME, gsm(99, -45), gsm(98, -95))
    assert walk.word("232-01-1201-98") == "nothing unusual"
    assert walk.tracker.worst == "232-01-1201-99"
    assert "232-01-1201-98" not in {one.cell for one in walk.tracker.conspicuous()}


def test_a_rule_that_fails_for_one_cell_goes_on_with_the_others(monkeypatch):
    def failing(memory, cell):
        if cell.name.endswith("-98"):
            raise ZeroDivisionError
        return _loud(memory, cell)

    monkeypatch.setitem(RULES, "S2", replace(RULES["S2"], check=failing, sentence="is loud"))
    walk = Walk().scan(*HOME, gsm(98, -45), gsm(99, -45), times=2)
    assert ("S2", 99) in walk.rules
    assert list(walk.tracker.errors) == ["232-01-1201-98"]
    assert "ZeroDivisionError" in walk.tracker.errors["232-01-1201-98"]


def test_memory_is_bounded():
    walk = Walk()
    for k in range(400):
        walk.scan(*(gsm(1000 + k * 5 + i) for i in range(5)), metres=30.0)
    memory = walk.tracker._memories["modem"]
    assert len(memory.cells) <= 128
    assert all(len(cell.spots) <= 49 for cell in memory.cells.values())
    assert sys.getsizeof(walk.tracker._findings) < 100_000


@pytest.mark.parametrize(("n_others", "is_asked"), [(2, False), (3, True)])
def test_among_few_cells_no_area_stands_out(n_others, is_asked):
    # a rogue cell of 4G that takes over the modem leaves it few others
    others = [gsm(10 + k, -70) for k in range(n_others)]
    walk = Walk().scan(*others, times=2).scan(gsm(99, -60, lac=7777), times=40)
    assert (("L1", 99) in walk.rules) == is_asked
    said = walk.tracker.unnoticed_text
    assert ("one of an invented area" in said) != is_asked


def test_a_scan_of_more_cells_than_are_remembered_is_asked_about_all():
    # a list of all networks in a large city; the cells of before are forgotten at its end
    city = [gsm(1000 + k, -60.0 - k / 4.0, arfcn=k) for k in range(170)]
    rogue = gsm(1, -55, mcc="001", lac=1, arfcn=900)
    walk = Walk().scan(*city, rogue, seconds=30.0, times=4)
    assert walk.word(rogue.cell) == "suspicious"
    assert all(cell.n_scans == 4 for cell in walk.tracker._memories["modem"].cells.values())
    assert len(walk.scan(*city[:5]).scan(gsm(2)).tracker._memories["modem"].cells) <= 128


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
