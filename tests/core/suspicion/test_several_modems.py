"""A cell that two modems hear is no jump and no second place, however far apart they read."""

import math

import pytest

from tests.kit.suspicion_walks import Walk, gsm

APART_DB = 25.0
"""More than any two modems: every rule about levels has a smaller gate. The cell of the mast alone
differs so much, as between two bands of two antennas: where all do, S2 is silent."""
MAST_M = 400.0


def _levels(north_m, above_db):
    """The cells of a scan on the way to the north, past a mast."""
    field = [
        -20.0 - 35.0 * math.log10(math.hypot(north_m - mast_m, 60.0)) + apart_db
        for mast_m, apart_db in ((MAST_M, above_db), (900.0, 0.0), (-200.0, 0.0))
    ]
    cells = [gsm(cid, round(level)) for cid, level in enumerate(field, 1)]
    return sorted(cells, key=lambda cell: -cell.rssi_dbm)


def _walk(first, second, hears):
    """Two modems by name; `hears` says which of them does in a scan."""
    walk = Walk()
    for k in range(130):
        for modem, above_db in ((first, 0.0), (second, -APART_DB)):
            if hears(k, above_db):
                cells = _levels(walk.north_m, above_db)
                if above_db:
                    cells.reverse()  # it is served by another cell
                walk.scan(*cells, seconds=2.5, metres=3.0, modem=modem)
    return walk


def _together(_k, _above_db):
    return True


def _joins(k, above_db):
    """The second one from the start, the first one in the middle of the walk."""
    return (k < 65) == bool(above_db)


def _in_turns(k, above_db):
    return (k // 20) % 2 == bool(above_db)


@pytest.mark.parametrize("hears", [_together, _joins, _in_turns])
def test_two_modems_give_no_finding_that_one_would_not(hears):
    alone = _walk("a", "a", lambda k, above_db: not above_db and hears(k, above_db))
    assert _walk("a", "b", hears).rules <= alone.rules


@pytest.mark.parametrize("hears", [_joins, _in_turns])
def test_the_same_levels_of_one_modem_would_be_found(hears):
    assert "S2" in {rule for rule, _ in _walk("a", "a", hears).rules}


def test_a_cell_that_the_other_modem_finds_counts_once():
    walk = Walk()
    for modem in ("a", "b"):
        walk.scan(gsm(1, -80), gsm(2, -85), gsm(3, -90), gsm(4, -95), times=6, modem=modem)
        walk.scan(gsm(9, -50), gsm(2, -85), gsm(3, -90), gsm(4, -95), times=6, modem=modem)
    by_rule = [(finding.rule.id, finding.cell) for finding in walk.found]
    assert by_rule
    assert len(by_rule) == len(set(by_rule))
