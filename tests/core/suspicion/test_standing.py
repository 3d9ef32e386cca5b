"""S7: a station moves if its level changes while the walker stands and other levels stay."""

from tests.kit.suspicion_walks import Walk, gsm

HOME = [gsm(cid, -80) for cid in range(10, 14)]


def _stand(levels_dbm, others=lambda k: HOME, *, metres=0.0):
    walk = Walk().scan(*HOME, metres=metres, times=6)
    for k, level_dbm in enumerate(levels_dbm):
        walk.scan(*others(k), gsm(99, level_dbm), metres=metres, times=2)
    return walk


def test_a_level_that_changes_while_all_others_stay():
    walk = _stand(range(-85, -55, 2))
    (finding,) = [one for one in walk.found if one.rule == "S7"]
    assert finding.cell == "232-01-1201-99"
    assert finding.family == "place"
    assert finding.evidence["change_db"] >= 20
    assert (finding.evidence["cells"], finding.evidence["other_db"]) == (4, 0)


def test_silent_where_all_levels_change():
    """The walker goes on while the receiver repeats its position, or turns the antenna."""
    fading = lambda k: [gsm(cid, -70 - 2 * k) for cid in range(10, 14)]  # noqa: E731
    assert ("S7", 99) not in _stand(range(-85, -55, 2), fading).rules


def test_silent_without_another_cell_to_compare_with():
    walk = Walk().scan(*HOME, metres=0.0, times=6)
    for level_dbm in range(-85, -55, 2):
        walk.scan(gsm(99, level_dbm), metres=0.0, times=2)
    # the others were heard for half a minute only
    assert ("S7", 99) not in walk.rules


def test_silent_while_walking():
    assert ("S7", 99) not in _stand(range(-85, -55, 2), metres=7.0).rules
