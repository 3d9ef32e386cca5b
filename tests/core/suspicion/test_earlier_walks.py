"""Earlier walks: B1, a cell that they did not hear, and B3, one that they all heard."""

from dataclasses import replace
from types import MappingProxyType

import pytest

from logger.core.baseline import HeardInSquare, KnownCell, NotedBaseline, SquareHistory
from logger.core.suspicion.rules import RULES
from tests.kit.suspicion_walks import Walk, gsm

HOME = [gsm(cid, -80 - cid % 7) for cid in range(10, 16)]
GONE = gsm(50)


class Earlier(NotedBaseline):
    """Walks that heard the same cells in every square, `GONE` as often and as strong as said."""

    def __init__(self, n_walks=8, heard=8, gone_dbm=-65.0, home_dbm=0.0):
        super().__init__()
        self.n_walks = n_walks
        cells = {reading.cell: reading.rssi_dbm + home_dbm for reading in HOME}
        self.cells = {
            name: HeardInSquare(n_walks, 20 * n_walks, dbm + 5.0, dbm + 2.0, dbm, 4.0)
            for name, dbm in cells.items()
        }
        gone = HeardInSquare(heard, 20 * heard, gone_dbm + 5.0, gone_dbm + 2.0, gone_dbm, 4.0)
        self.cells[GONE.cell] = gone

    def square(self, square):
        return SquareHistory(square, {"GSM": self.n_walks}, MappingProxyType(self.cells))

    def cell(self, name):
        if name not in self.cells:
            return None
        heard = self.cells[name]
        n_walks, n_scans, best_dbm = heard.n_walks, heard.n_scans, heard.best_dbm
        return KnownCell(name, "GSM", n_walks, n_scans, 1, best_dbm, frozenset({(51, 8)}))


class Doubting(Earlier):
    """Walks that did not learn the cell 99, which was conspicuous then."""

    def is_doubted(self, name):
        return name.endswith("-99")


class OfArea(Earlier):
    """Walks in which the area 1300 was heard here, as often as said."""

    def __init__(self, heard):
        super().__init__(heard=heard)
        self.cells[gsm(70, lac=1300).cell] = self.cells.pop(GONE.cell)


def _b3(baseline, *scan, metres=20.0, times=14):
    walk = Walk(baseline=baseline).scan(*(scan or HOME), metres=metres, times=times)
    return [finding for finding in walk.found if finding.rule.id == "B3"]


def test_a_cell_that_was_always_heard_here_is_missed():
    (finding,) = _b3(Earlier())
    assert finding.cell == GONE.cell
    assert finding.evidence == {
        "walks": 8, "of": 8, "level_dbm": -65, "places": 3, "limit_dbm": -86,
    }  # fmt: skip
    assert finding.lat_deg is not None


def test_it_is_a_warning_and_no_accusation():
    walk = Walk(baseline=Earlier()).scan(*HOME, metres=20.0, times=14)
    assert walk.word(GONE.cell) == "nothing unusual"
    assert walk.tracker.worst is None
    assert walk.tracker.technologies()[GONE.cell] == "GSM"
    assert RULES["B3"].rate_text(0.0) == "Not measured: it only warns."


@pytest.mark.parametrize(
    "earlier",
    [
        Earlier(n_walks=6, heard=6),
        Earlier(heard=7),  # 88 % of the walks
        Earlier(gone_dbm=-72.0),  # 14 dB above what was named today
        Earlier(home_dbm=10.0),  # today's antenna is worse by as much
    ],
    ids=["few walks", "not always heard", "too weak", "a worse antenna"],
)
def test_the_gate_of_earlier_walks(earlier):
    assert not _b3(earlier)


def test_the_gate_of_todays_walk():
    assert not _b3(Earlier(), *HOME, GONE)  # heard
    assert not _b3(Earlier(), *HOME[:3])  # a short list
    assert not _b3(Earlier(), metres=2.0)  # one place
    unnamed = [gsm(None, -80 - k, arfcn=k) for k in range(6)]
    assert not _b3(Earlier(), *HOME[:3], *unnamed)
    assert _b3(Earlier(), *HOME, gsm(None, -60, arfcn=50))
    assert not _b3(Earlier(), *HOME, gsm(None, -60, arfcn=51))  # its channel, without identity


def test_a_modem_that_names_one_network_misses_no_cell_of_another():
    others = [gsm(reading.cid, reading.rssi_dbm, mnc="03") for reading in HOME]
    earlier = Earlier()
    earlier.cells |= {
        other.cell: earlier.cells[reading.cell] for other, reading in zip(others, HOME, strict=True)
    }
    assert not _b3(earlier, *others)
    assert _b3(earlier, *others, HOME[0])


def test_a_cell_heard_before_on_this_walk_is_not_gone():
    walk = Walk(baseline=Earlier()).scan(*HOME, GONE, times=2).scan(*HOME, metres=20.0, times=14)
    assert ("B3", 50) not in walk.rules


def test_a_cell_that_is_heard_later_was_not_gone():
    walk = Walk(baseline=Earlier()).scan(*HOME, metres=20.0, times=14)
    assert walk.tracker.assessment(GONE.cell).findings
    walk.scan(*HOME, GONE, metres=20.0, times=2)
    assert not walk.tracker.assessment(GONE.cell).findings
    assert GONE.cell in {cell.cell for cell in walk.tracker.assessments()}


@pytest.mark.parametrize(
    ("n_walks", "word"),
    [(6, "nothing unusual"), (7, "unusual"), (14, "unusual"), (15, "suspicious")],
)
def test_b1_weighs_by_the_number_of_earlier_walks(n_walks, word):
    earlier = Earlier(n_walks=n_walks, heard=0)
    new = gsm(99, -85)
    assert Walk(baseline=earlier).scan(*HOME, new, times=4).word(new.cell) == word


@pytest.mark.parametrize(("n_moved", "word"), [(2, "suspicious"), (3, "nothing unusual")])
def test_b1_is_silent_where_the_operator_has_renumbered(n_moved, word):
    """Overnight all cells of an area have another code; a rogue cell has the number of one."""
    earlier = Earlier(n_walks=15, heard=0)
    earlier.cells["tower"] = earlier.cells[GONE.cell]  # an import may name cells so
    moved = [gsm(cid, -85, lac=1300) for cid in range(10, 10 + n_moved)]
    walk = Walk(baseline=earlier).scan(*moved, *HOME[n_moved:], times=4)
    assert {walk.word(cell.cell) for cell in moved} == {word}
    new = gsm(99, -85, lac=1300)
    assert walk.scan(*moved, *HOME[n_moved:], new, times=4).word(new.cell) == "suspicious"


def test_b1_says_nothing_of_a_network_that_earlier_walks_did_not_hear():
    # another card, another modem, a network that has got another code
    other = [gsm(cid, -80, mnc="03") for cid in range(30, 36)]
    walk = Walk(baseline=Earlier(n_walks=15)).scan(*other, times=30)
    assert {walk.word(cell.cell) for cell in other} == {"nothing unusual"}
    assert "Earlier walks of this ground: 0" in walk.tracker.unnoticed_text
    new = gsm(99, -85)
    assert walk.scan(*HOME, new, times=4).word(new.cell) == "suspicious"
    assert walk.tracker.earlier_walks == 15


def test_b1_counts_the_walks_that_heard_the_network():
    earlier, new = Earlier(n_walks=15, heard=0), gsm(99, -85)
    earlier.cells = {name: replace(heard, n_walks=6) for name, heard in earlier.cells.items()}
    assert Walk(baseline=earlier).scan(*HOME, new, times=4).word(new.cell) == "nothing unusual"


@pytest.mark.parametrize(("n_new", "word"), [(5, "suspicious"), (7, "nothing unusual")])
def test_b1_is_silent_where_most_cells_are_new(n_new, word):
    # the operator has given all cells other identities
    new = [gsm(cid, -85) for cid in range(90, 90 + n_new)]
    walk = Walk(baseline=Earlier(n_walks=15)).scan(*HOME, *new, times=4)
    assert {walk.word(cell.cell) for cell in new} == {word}


def test_b1_takes_one_station_that_changes_its_identity_for_one():
    walk = Walk(baseline=Earlier(n_walks=15))
    for cid in range(90, 98):
        walk.scan(*HOME, gsm(cid, -60, arfcn=99), times=4)
    assert walk.word(gsm(97).cell) == "suspicious"


def test_b1_wants_three_readings_of_its_level():
    earlier = Earlier(n_walks=15, heard=0)
    weak = gsm(99, -96)
    walk = Walk(baseline=earlier).scan(*HOME, weak, times=4).scan(*HOME, gsm(99, -85), times=2)
    assert walk.word(weak.cell) == "nothing unusual"
    assert walk.scan(*HOME, gsm(99, -85)).word(weak.cell) == "suspicious"


@pytest.mark.parametrize("earlier", [Earlier(n_walks=15, heard=0), Doubting(n_walks=15, heard=0)])
def test_b1_does_not_say_that_a_cell_was_unheard_which_was_only_not_learnt(earlier):
    walk = Walk(baseline=earlier).scan(*HOME, gsm(99, -85), times=4)
    (text,) = [finding.text for finding in walk.found if finding.rule.id == "B1"]
    assert ("15 earlier walks did not hear this cell here" in text) == (type(earlier) is Earlier)
    assert ("did not learn this cell" in text) == (type(earlier) is Doubting)


@pytest.mark.parametrize(("heard", "is_new"), [(1, True), (2, False)])
def test_an_area_that_earlier_walks_heard_here_is_no_new_one(heard, is_new):
    many = [gsm(cid, -80) for cid in range(10, 20)]
    walk = Walk(baseline=OfArea(heard)).scan(*many, times=3)
    walk.scan(*many, gsm(99, -70, lac=1300), times=25)
    assert ({("L1", 99), ("L2", 99)} <= walk.rules) == is_new
    standing = Walk(baseline=OfArea(heard)).scan(*HOME, metres=0.0, times=15)
    standing.scan(gsm(99, lac=1300), metres=0.0, times=4)
    assert (("L3", 99) in standing.rules) == is_new


def test_an_area_that_earlier_walks_heard_farther_on_was_no_new_one():
    many = [gsm(cid, -80) for cid in range(10, 20)]
    baseline, new = OfArea(2), gsm(99, lac=1300).cell
    baseline.n_walks = 2  # too few for B1
    known, baseline.cells = baseline.cells, {}
    walk = Walk(baseline=baseline).scan(*many, times=3)
    walk.scan(*many, gsm(99, -70, lac=1300), times=25)
    assert {("L1", 99), ("L2", 99)} <= walk.rules
    assert walk.word(new) == "suspicious"
    baseline.cells = known
    walk.scan(*many, gsm(99, -70, lac=1300))
    assert walk.word(new) == "nothing unusual"
    baseline.cells = {}
    n_found = len(walk.found)
    walk.scan(*many, gsm(99, -70, lac=1300), times=25)
    assert len(walk.found) == n_found
