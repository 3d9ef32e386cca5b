"""A row that is cut keeps neither its last value nor what hangs on it, in every family and at every
place.
"""

import random
import re

import pytest

from logger.core.types import CellReading
from logger.drivers.protocols.at import INTERRUPTION, AtFramer
from logger.drivers.reading.row_language import Registration
from logger.drivers.reading.standard_replies import drop_cut_values, names_of
from logger.drivers.registry import FAMILIES
from logger.drivers.transcript import rows_of
from tests.kit.drivers import identity_of, own_replies

URC = '+CIEV: "service",1'
LEVELS = ("rssi_dbm", "rscp_dbm", "rsrp_dbm", "rxlev_raw")
NAMES = names_of("AT+QENG=1 AT+CENG?")
EC25 = '+QENG: "neighbourcell","GSM",262,01,1918,C851,59,118,-103,24,25,0,0'


def certain_values(driver, lines):
    """Who is named for certain, and which levels are told."""
    rows = rows_of(driver, lines)
    cells = {
        identity_of(row)
        if isinstance(row, CellReading)
        else (None, None, row.lac or row.tac, row.cid)
        for row in rows
        if isinstance(row, CellReading | Registration) and not row.identity_unsure
    }
    levels = {
        (name, getattr(row, name))
        for row in rows
        if isinstance(row, CellReading)
        for name in LEVELS
    }
    return cells, levels


def values_of(driver, lines):
    """The same for a reply that nothing has cut, an unsure identity among them: it is as it was
    sent.
    """
    rows = [row for row in driver.read(lines) if isinstance(row, CellReading | Registration)]
    cells = {
        identity_of(row)
        if isinstance(row, CellReading)
        else (None, None, row.lac or row.tac, row.cid)
        for row in rows
    }
    return cells, {
        (name, getattr(row, name))
        for row in rows
        if isinstance(row, CellReading)
        for name in LEVELS
    }


def is_part(cell, cells):
    """True where each part that is named is that of one cell."""
    return any(
        all(part is None or part == other for part, other in zip(cell, known, strict=True))
        for known in cells
    )


def strong_and_weak(reply, rng):
    """The reply, and the same with other levels of three digits, which a cut makes strong."""
    yield reply
    yield re.sub(r"-(?:[5-9]\d|1[01]\d)(?!\d)", f"-{rng.randint(100, 113)}", reply)


def cuts(lines):
    """The reply with a URC in each place of each line, between line ends and without them, or with
    the rest lost.
    """
    for number, line in enumerate(lines):
        for at in range(1, len(line) + 1):
            before, rest = [*lines[:number], line[:at]], [line[at:], *lines[number + 1 :]]
            yield [*before, URC, *rest]
            yield [*lines[:number], line[:at] + URC, *rest]
            if re.search(
                r"[\s,]", line[at:]
            ):  # a row that lost but the end of its last value is a row
                yield [*before, *lines[number + 1 :]]


@pytest.mark.parametrize("name", FAMILIES)
def test_no_cut_makes_a_level_or_an_identity(name):
    driver, rng = FAMILIES[name], random.Random(3)
    for reply in own_replies(name):
        for text in strong_and_weak(reply, rng):
            lines = text.split("\n")
            cells, levels = values_of(driver, lines)
            for damaged in cuts(lines):
                named, levels_left = certain_values(driver, damaged)
                assert all(is_part(cell, cells) for cell in named), damaged
                assert {level for level in levels_left if level[1] is not None} <= levels, damaged


@pytest.mark.parametrize("text", ["-1", "-10", "-103"])
def test_a_level_before_a_urc_is_none(text):
    lines = [EC25[: EC25.index("-103")] + text, URC, EC25[EC25.index(",24") :]]
    assert all(reading.level_dbm is None for reading in FAMILIES["quectel"].read(lines))


def test_a_complete_row_before_another_row_loses_nothing():
    lines = ["AT+QENG", EC25, EC25.replace("-103", "-97"), "OK"]
    assert drop_cut_values(lines, NAMES) == lines
    assert [reading.level_dbm for reading in FAMILIES["quectel"].read(lines)] == [-103.0, -97.0]


@pytest.mark.parametrize(
    "following", ["+CREG: 1", "OK", "ERROR", "+CME ERROR: 3", "AT+QENG", "", "+QENG: 1,4"]
)
def test_what_may_follow_a_row_cuts_none(following):
    assert drop_cut_values([EC25, following], NAMES)[0] == EC25


@pytest.mark.parametrize(
    "following", [URC, "RING", "^MODE: 3,3", "*PSUTTZ: 2024,1,2", INTERRUPTION]
)
def test_what_stands_where_a_row_should_go_on_cuts_it(following):
    assert drop_cut_values([EC25, following], NAMES)[0] == EC25[:-1]


def test_a_value_in_quotation_marks_is_complete():
    line = '+CENG: 1,"0128,15,30,a53f,310,411,178d"'
    assert drop_cut_values([line, URC], NAMES)[0] == line
    assert drop_cut_values([line[:-1], URC], NAMES)[0] == line[: -len('178d"')]


def test_a_urc_in_the_middle_of_a_live_reply_cuts_the_row_before_it():
    framer = AtFramer()
    framer.send('AT+QENG="neighbourcell"')
    data = EC25.replace("-103", "-10\r\n+CIEV: 1\r\n3").encode() + b"\r\nOK\r\n"
    *_, reply = framer.feed(data)
    assert reply.interrupted == {0}
    assert all(
        reading.level_dbm is None for reading in FAMILIES["quectel"].read(reply.marked_lines)
    )


def test_a_transcript_that_ends_within_a_row_loses_its_last_value():
    driver = FAMILIES["ublox"]
    row = "+UCELLINFO: 0,0,  262,   11, 3c4d,    5e6f,  25"
    assert rows_of(driver, ["AT+UCELLINFO?", row, ""])[0].rxlev_raw == 25
    assert not any(reading.rxlev_raw for reading in rows_of(driver, ["AT+UCELLINFO?", row[:-1]]))
    assert rows_of(driver, [row])[0].rxlev_raw == 25
