import random
import re

import pytest

from logger.core.types import CellReading
from logger.drivers.protocols.at import INTERRUPTION, AtFramer
from logger.drivers.reading import standard_replies
from logger.drivers.reading.row_language import Registration, as_json
from logger.drivers.reading.standard_replies import drop_cut_values, names_of
from logger.drivers.registry import FAMILIES, reader_of
from logger.drivers.transcript import rows_of
from tests.kit.corpus import check_entry, entries, lines_of
from tests.kit.drivers import identity_of, own_replies

OF_ALL = (
    "3gpp_",
    "simcom_nosim",
    "simcom_csq",
    "simcom_cnwinfo",
    "quectel_registration",
    "ublox_log",
)


def rows(text):
    return [
        {k: v for k, v in as_json(row).items() if v is not None}
        for row in standard_replies.standard_rows(text.splitlines())
    ]


def test_every_driver_reads_the_common_ground_of_the_corpus(corpus):
    found = entries(corpus, *OF_ALL)
    assert len(found) > 20
    for entry in found:
        lines = lines_of(corpus, entry)
        check_entry(entry, [as_json(row) for row in standard_replies.standard_rows(lines)])
        for driver in FAMILIES.values():
            check_entry(entry, [as_json(row) for row in driver.read(lines)])
        check_entry(entry, [as_json(row) for row in reader_of(lines).read(lines)])


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("+CREG: 1", {"stat": 1}),
        ("+CREG: 2,1", {"n": 2, "stat": 1}),
        ('+CREG: 1,"CE00","00005449"', {"stat": 1, "lac": 0xCE00, "cid": 0x5449}),
        (
            '+CREG: 2,5,"CE00","00005449",0',
            {"n": 2, "stat": 5, "lac": 0xCE00, "cid": 0x5449, "act": 0, "rat": "GSM"},
        ),
        (
            '+CEREG: 2,1,"2AFE","1A2D001",9',
            {"n": 2, "stat": 1, "tac": 0x2AFE, "cid": 0x1A2D001, "act": 9},
        ),
        (
            '+CREG: 2,1,"FFFE","76340C",7]',
            {"n": 2, "stat": 1, "cid": 0x76340C, "act": 7, "rat": "LTE"},
        ),
        (
            '+CEREG: 3,3,"2AFE","1A2D001",7,0,15',  # as SARA-R4 manual UBX-17003787 p138
            {"n": 3, "stat": 3, "tac": 0x2AFE, "reject_cause_type": 0, "reject_cause": 15},
        ),
        ("+CREG: 3,3,,,,1,2", {"n": 3, "stat": 3, "reject_cause_type": 1, "reject_cause": 2}),
        ('+CGREG: 3,"01","02",0,"03",0,7', {"stat": 3, "lac": 1, "reject_cause": 7, "rat": "GSM"}),
        ('+CREG: 2,1,"FFFE","1A2D001",7', {"n": 2, "stat": 1, "cid": 0x1A2D001, "rat": "LTE"}),
        ("+CREG: 2,1,0x2AFE,0x1A2D", {"n": 2, "stat": 1, "lac": 0x2AFE, "cid": 0x1A2D}),
        (  # with the routing area
            "+CEREG: 2,1, 2AFE, 20 ,1A2D01 ,7",
            {"n": 2, "stat": 1, "tac": 0x2AFE, "cid": 0x1A2D01, "rat": "LTE"},
        ),
        ("+CEREG: 1, 2AFE, 20 ,1A2D01 ,7", {"stat": 1, "tac": 0x2AFE, "cid": 0x1A2D01}),
    ],
)
def test_registration_answered_and_reported(line, wanted):
    (row,) = rows(line)
    assert row.items() >= wanted.items()
    assert ("n" in row) == ("n" in wanted)
    assert ("lac" in row or "tac" in row) == ("lac" in wanted or "tac" in wanted)
    assert ("reject_cause" in row) == ("reject_cause" in wanted)


@pytest.mark.parametrize(
    "line",
    [
        '+CEREG: 4,1,"2AFE","1A2D001",7,,,"00000010","00000001"',
        "+CEREG: 3,3,,,,0,",
        "+CEREG: 3,3,,,,0,256",
        "+CEREG: 3,3,,,,2,15",
        '+C5GREG: 3,3,"2AFE","1A2D001",11,0,15',
        '+CREG: 3,3,"2AFE","5449",0',
    ],
)
def test_no_cause_where_none_is_printed(line):
    (row,) = rows(line)
    assert "reject_cause" not in row


@pytest.mark.parametrize(
    "beside",
    [
        " OK",
        "+CSQ: 20,0",
        ";+CGREG: 0,1",
        ",+CSQ: 20,0",
        ' +COPS: 0,0,"X"',
        "|+CSQ: 20,0",
        "\\r\\n\\r\\nOK",
        "\t+CSQ: 1,1",
    ],
)
@pytest.mark.parametrize("values", ["1,5", '2,5,"1A2B","3C4D"', "0,5"])
def test_registration_that_shares_its_line_with_other_answers(values, beside):
    row = next(row for row in rows(f"+CREG: {values}{beside}") if row.get("domain") == "CREG")
    assert (row["n"], row["stat"]) == (int(values[0]), 5)
    assert row.get("cid") == (0x3C4D if "3C4D" in values else None)


@pytest.mark.parametrize("line", ['+CREG: 2,1,,"3C4D","5E6F"', '+CREG: 2,1,"3C4D","5E6'])
def test_registration_with_a_comma_too_many_or_cut_names_no_other_cell(line):
    assert all(row.get("cid") is None for row in rows(line))


def test_levels_without_a_cell():
    assert rows("+CSQ: 31,0") == [{"role": "signal", "csq_raw": 31, "ber": 0, "rssi_dbm": -51.0}]
    assert rows("+CSQ: 99,99") == [{"role": "signal"}]
    gsm, lte = (rows(f"+CESQ: {text}") for text in ("40,0,255,255,255,255", "99,99,255,255,20,60"))
    assert (gsm[0]["rat"], gsm[0]["rssi_dbm"], gsm[0]["rxlev_raw"]) == ("GSM", -70.0, 40)
    assert (lte[0]["rat"], lte[0]["rsrp_dbm"], lte[0]["rsrq_db"]) == ("LTE", -81.0, -10.0)
    assert rows("+CESQ: 99,99,255,255,255,255") == []
    lte, nr = rows("+CESQ: 99,99,255,255,20,60,65,76,90")
    assert (lte["rat"], lte["rsrp_dbm"]) == ("LTE", -81.0)
    assert (nr["rat"], nr["rsrp_dbm"], nr["rsrq_db"]) == ("NR", -81.0, -11.0)
    assert rows("+CESQ: 99,99,255,255,255,255,255,255,255") == []


def test_a_list_of_networks_broken_between_lines_and_without_quotes():
    text = (
        '+COPS: (2,"A, B","AB","26201",0),(1,Net\r\nwork,"",'
        '"26202"),2),(1,x,y,310260),,(0,1,4),(0-2)'
    )
    assert [(r.get("stat"), r.get("plmn"), r.get("rat")) for r in rows(text)] == [
        (2, "26201", "GSM"),
        (1, "26202", "WCDMA"),
        (1, "310260", None),
    ]


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


@pytest.mark.parametrize("result", [" OK", "   OK", "\tOK \r"])
def test_a_result_that_a_log_has_joined_to_a_row_is_no_part_of_it(result):
    assert drop_cut_values([EC25 + result], NAMES) == [EC25]
    assert drop_cut_values([f"OK{result}", f"AT+QENG:{result}"], NAMES)[1] == f"AT+QENG:{result}"


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
