"""Networks of a log: several telephones in one log, and codes that are not printed."""

import pytest

from logger.core.suspicion.heard import may_be_same
from tests.kit.suspicion_walks import Walk, gsm

FIRST = [gsm(10 + k, -70 - k) for k in range(4)]
SECOND = [gsm(60 + k, -84 + k, mnc="03", lac=4301) for k in range(4)]


@pytest.mark.parametrize(
    ("operator", "other", "is_same"),
    [
        ("232-01", "232-01", True),
        ("232-01", "232-03", False),
        ("232-?", "232-03", True),
        ("?-?", "232-03", True),
        ("001-?", "232-?", False),
    ],
)
def test_a_code_that_is_not_printed_may_be_any(operator, other, is_same):
    assert may_be_same(operator, other) == is_same


def test_networks_that_come_late_are_not_those_of_the_log():
    walk = Walk().scan(*FIRST, *SECOND, times=2)
    memory = walk.scan(*FIRST, gsm(90, mcc="001"), seconds=400.0).tracker._memories["modem"]
    assert memory.are_apart("232-03", "232-01")
    assert not memory.are_apart("001-01", "232-01")
    assert not memory.are_apart("232-01", "232-01")


def test_one_network_says_nothing_of_another():
    """A modem that tries two networks in turn, or two telephones in one log: C2, S3, L3."""
    walk = Walk().scan(*FIRST, metres=0.0, times=15).scan(*SECOND, metres=0.0, times=15)
    assert walk.rules == set()


def test_a_network_that_comes_late_has_to_be_explained():
    walk = Walk().scan(*FIRST, metres=0.0, times=70).scan(SECOND[0], metres=0.0, times=4)
    assert walk.rules == {("L3", 60)}
    walk.scan(*SECOND, metres=0.0, times=2)
    assert not walk.tracker.conspicuous()
    assert not walk.tracker.assessment(SECOND[0].cell).findings


def test_a_receiver_that_repeats_its_position_in_a_train_does_not_stand():
    """Other cells serve again and again; L3 would name the border of an area."""
    walk = Walk().scan(*FIRST, metres=0.0, times=20)
    for k in range(5):
        walk.scan(gsm(20 + k, -75), metres=0.0, times=6)
    assert ("L3", 50) not in walk.scan(gsm(50, -75, lac=1300), metres=0.0, times=4).rules
    stands = Walk().scan(*FIRST, metres=0.0, times=20).scan(*FIRST[::-1], metres=0.0, times=30)
    assert ("L3", 50) in stands.scan(gsm(50, -75, lac=1300), metres=0.0, times=4).rules
