import pytest

from logger.drivers.reading import standard_replies
from logger.drivers.reading.row_language import as_json
from logger.drivers.registry import FAMILIES, reader_of
from tests.kit.corpus import check_entry, entries, lines_of

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
