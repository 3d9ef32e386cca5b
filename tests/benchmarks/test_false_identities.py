"""One damaged byte produces few false cells; a short form of the benchmark."""

import random
from dataclasses import replace

import pytest

from benchmarks.false_identities import (
    DAMAGES,
    Stream,
    Tally,
    count,
    count_session,
    damage_bytes,
    is_false,
    replies,
    stream,
    stream_table,
    table,
)
from logger.core.types import CellReading
from logger.drivers.reading.recognition import CellHistory
from logger.drivers.registry import FAMILIES

EACH = 3
MOST_ALONE = 0.01
MOST_MARKED = 0.0125
"""At most the first of the eighty whole replies of a session."""
MOST_LEVELS = {"fibocom": 0.04}
"""Of lost and doubled bytes; indices that no firmware pads, as those of Fibocom, show no lost
digit.
"""
MOST_LEVELS_ELSEWHERE = 0.01
CENG = (
    '+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"\n+CENG: 1,"0128,15,30,a53f,310,411,178d"'
)


@pytest.fixture(scope="module")
def tallies():
    found = {name: Tally() for name in FAMILIES}
    for driver, text in replies():
        count(driver, text, found[driver.name], each=EACH)
        count_session(driver, text, found[driver.name])
    return found


@pytest.mark.parametrize("name", FAMILIES)
def test_one_byte_lost_or_doubled_makes_a_false_cell_in_one_of_a_hundred_at_most(tallies, name):
    tally = tallies[name]
    assert tally.replies
    assert tally.rate(tally.identities, "lost", "doubled") <= MOST_ALONE
    assert tally.rate(tally.levels, "lost", "doubled") <= MOST_LEVELS.get(
        name, MOST_LEVELS_ELSEWHERE
    )


@pytest.mark.parametrize("name", FAMILIES)
def test_a_cell_that_two_scans_have_heard_is_real_whatever_byte_was_damaged(tallies, name):
    assert tallies[name].rate(tallies[name].of_two_scans, "lost", "doubled", "changed") <= 0.001


@pytest.mark.parametrize("name", FAMILIES)
def test_in_a_session_few_whole_replies_are_marked_and_few_damaged_ones_are_not(tallies, name):
    assert tallies[name].session["whole"] > 100
    assert tallies[name].of_session("marked", "whole") <= MOST_MARKED
    assert tallies[name].of_session("false", "damaged") <= MOST_ALONE


@pytest.fixture(scope="module")
def texts():
    found = {name: [] for name in FAMILIES}
    for driver, text in replies():
        found[driver.name].append(text)
    return found


@pytest.mark.parametrize("name", FAMILIES)
def test_no_damage_of_any_kind_makes_a_cell_that_is_believed(texts, name):
    for kind in DAMAGES:
        found = stream(FAMILIES[name], texts[name], kind, 300)
        assert found.damaged == 300
        assert not found.cells, kind


@pytest.mark.parametrize("name", FAMILIES)
def test_no_driver_believes_a_cell_in_the_replies_of_other_modems(texts, name):
    for other in FAMILIES:
        for kind in ("flip", "swap", "burst"):
            found = stream(FAMILIES[other], texts[other], kind, 30, reader=FAMILIES[name])
            assert not found.cells, (other, kind)


def test_a_modem_that_remembers_no_cell_is_found_out(texts, monkeypatch):
    monkeypatch.setattr(CellHistory, "doubtful", lambda *_: frozenset())
    found = stream(FAMILIES["sim7600"], texts["sim7600"], "swap", 1000)
    assert found.false >= found.sure > len(found.believed) >= len(found.cells) > 0
    counts = f"{found.false}/{found.sure}/{len(found.believed)}/{len(found.cells)}"
    kinds = {kind: found if kind == "swap" else Stream() for kind in DAMAGES}
    assert counts in stream_table({"sim7600": kinds}).splitlines()[-1]


def test_each_kind_of_damage_is_what_its_name_says():
    text = "a1,2\nb3"
    made = {kind: change(text, 1, random.Random(5)) for kind, change in DAMAGES.items()}
    assert sum(a != b for a, b in zip(text, made["flip"], strict=True)) == 1
    assert {kind: made[kind] for kind in ("swap", "lost", "doubled", "cut", "merged")} == {
        "swap": "a,12\nb3",
        "lost": "a,2\nb3",
        "doubled": "a11,2\nb3",
        "cut": "a\nb3",
        "merged": "a1,2b3",
    }
    assert len(made["inserted"]) == len(text) + 1
    assert len(made["burst"]) == len(text)


def test_whole_replies_are_sure_after_an_earlier_one(tallies):
    assert not any(tally.marked_later for tally in tallies.values())


def test_whole_replies_of_firmware_that_pads_are_sure_alone():
    for name in ("sim800", "cinterion", "ublox", "quectel_gsm", "sierra"):
        tally = Tally()
        for driver, text in replies():
            if driver.name == name:
                count(driver, text, tally, ways=())
        assert (tally.marked_alone, tally.marked_later) == (0, 0), name


def test_a_driver_that_forgets_how_numbers_were_printed_is_found_out():
    class Careless(type(FAMILIES["sim800"])):
        def read(self, lines):
            return tuple(
                replace(row, lac=row.lac and int(row.lac), cid=row.cid and int(row.cid))
                for row in super().read(lines)
                if isinstance(row, CellReading)
            )

    tally = Tally()
    count(Careless(), CENG, tally)
    assert tally.rate(tally.identities, "lost") > 0.05
    tally = Tally()
    count(FAMILIES["sim800"], CENG, tally)
    assert tally.rate(tally.identities, "lost", "doubled") == 0.0


def test_damage_is_of_one_byte_each():
    text = "a53f,12"
    assert list(damage_bytes(text, "lost", random.Random(0)))[:3] == ["53f,12", "a3f,12", "a5f,12"]
    assert list(damage_bytes(text, "doubled", random.Random(0)))[:2] == ["aa53f,12", "a553f,12"]
    changed = list(damage_bytes(text, "changed", random.Random(0)))
    assert [sum(a != b for a, b in zip(text, other, strict=True)) for other in changed] == [
        1
    ] * len(text)


def test_a_cell_with_less_known_of_it_is_no_false_one():
    genuine = [("310", "411", 0x178D, 0xA53F)]
    assert not is_false(("310", "411", None, 0xA53F), genuine)
    assert is_false(("310", "411", 0x178D, 0xA5F), genuine)


def test_the_table_has_a_line_for_each_family_and_one_for_all(tallies):
    lines = table(tallies).splitlines()
    assert [line.split()[0] for line in lines[2:]] == [*FAMILIES, "all"]
