from dataclasses import replace

import pytest

from logger.core.types import CellReading
from logger.drivers.cinterion import Cinterion
from logger.drivers.reading.row_language import NoCell, pieces
from tests.kit.corpus import check_recorded
from tests.kit.drivers import check_cuts, identity_of, run_dialogue

MODEM = Cinterion()

# SMONC, SMOND and SMONI are rows of the corpus, the tables have values of our own in the layouts of
# firmware_notes/cinterion.md.
SMONC = "^SMONC: 232,03,3010,4EAF,32,82,38,30,30,232,03,3010,0000,36,88,26,18,18"

SMOND = (
    "^SMOND:250,01,00EA,0AE1,23,756,47,,,0,,,0,250,01,00EA,0ADE,40,1022,47,"
    "250,01,00DD,0A5E,23,783,78,250,01,00EA,0AE2,43,795,78,250,01,00EA,0AE0,26,791,78,"
    "250,01,00EA,4EA7,20,748,86,250,01,00EA,,20,669,87,1,31,99"
)

SMONI_2G = "^SMONI: 2G,71,-61,262,02,0143,83BA,33,33,3,6,G,NOCONN"

SMONI_3G = "^SMONI: 3G,10564,296,-7.5,-79,262,02,0143,00228FF,-92,-78,NOCONN"

SMONI_4G = "^SMONI: 4G,6300,20,10,10,FDD,262,02,BF75,0345103,350,33,-94,-7,NOCONN"

HEADER = [
    "Serving Cell     I Dedicated channel",
    "chann rs  dBm  PLMN  LAC cell NCC BCC PWR RXLev  C1 I chann TS timAdv",
]

MONI = "847  19  -75 26201 2A3B 4C5D   5   2  33  -104  30 I    No connection"

MONI_CALL = "847  17 -79 262 01 2A3B 4C5D 5   2   33  -104  30 I 851  2  4  5  -80  1 S_HR"

MONP = "67 24 -81 26201 4 27 25"

SMONP = "853,31,-80,262,07,4,3,26,22,2A3C,4C5E,0,0"

SNMON = '^SNMON: "INS",0,1,0,4C5D,2A3B,"26202",67,41,-70,1'

SAMPLES = [
    SMONC,
    SMOND,
    SMONI_2G,
    SMONI_3G,
    SMONI_4G,
    MONI,
    MONI_CALL,
    MONP,
    f"2G:\n{SMONP}",
    SNMON,
]


@pytest.mark.parametrize(
    "dialect", ["siemens_smonc", "siemens_smond", "siemens_moni", "siemens_monp", "cinterion"]
)
def test_recorded_replies(corpus, dialect):
    check_recorded(corpus, MODEM, dialect)


def one(*lines):
    found = MODEM.rows_in(lines)
    assert len(found) == 1
    return found[0]


def test_smoni_of_three_technologies():
    gsm, wcdma, lte = MODEM.rows_in([SMONI_2G, SMONI_3G, SMONI_4G])
    assert (gsm.cell, gsm.arfcn, gsm.rssi_dbm, gsm.bsic, gsm.c1) == (
        "262-02-323-33722",
        71,
        -61.0,
        30,
        33,
    )
    assert gsm.more == {"ncc": 3, "bcc": 6, "state": "NOCONN"}
    assert (wcdma.cell, wcdma.psc, wcdma.ecio_db, wcdma.rscp_dbm) == (
        "262-02-323-141567",
        296,
        -7.5,
        -79.0,
    )
    assert (lte.cell, lte.arfcn, lte.band, lte.pci) == ("262-02-49013-3428611", 6300, 20, 350)
    assert (lte.rsrp_dbm, lte.rsrq_db) == (-94.0, -7.0)
    assert lte.more == {"state": "NOCONN", "duplex": "FDD", "srxlev": 33}
    assert "srxlev" not in one(SMONI_4G.replace("NOCONN", "CONN")).more


@pytest.mark.parametrize(
    ("tail", "ta"),
    [
        ("NOCONN", None),
        ("5,-104,LIMSRV", None),
        ("651,3,5,-79,0,S_FR", 5),
        ("5,-104,h,3,5,-79,0,S_FR", 5),
    ],
)
def test_ends_of_a_2g_row(tail, ta):
    reading = one(SMONI_2G.replace("NOCONN", tail))
    assert (reading.cell, reading.ta) == ("262-02-323-33722", ta)


@pytest.mark.parametrize(
    ("line", "rat"),
    [
        ("2G,SEARCH,SEARCH", "GSM"),
        ("3G,SEARCH", "WCDMA"),
        ("4G,SEARCH", "LTE"),
        ("SEARCH", None),
        ("2g,search", "GSM"),
    ],
)
def test_search(line, rat):
    assert MODEM.rows_in([f"^SMONI: {line}"]) == (NoCell(rat, state="SEARCH"),)


@pytest.mark.parametrize(
    ("act", "rat"), [("Cat.M", "LTE-M"), ("CAT-M1", "LTE-M"), ("Cat.NB1", "NB-IoT")]
)
def test_smoni_of_lte_m_and_nbiot_is_that_of_lte(act, rat):
    assert one(SMONI_4G.replace("4G", act)) == replace(one(SMONI_4G), rat=rat)


def test_values_that_smoni_does_not_know():
    row = one("^SMONI: 3G,10713,117,-,-,262,01,2A3D,1C5D6E7,--,--,----,---,-,-6,-90,0,01,06")
    assert (row.cell, row.rscp_dbm, row.ecio_db) == ("262-01-10813-29742823", None, None)
    assert identity_of(one(SMONI_2G.replace("83BA", "----"))) == ("262", "02", 0x143, None)
    assert identity_of(one(SMONI_2G.replace("83BA", "0000").replace("0143", "FFFE"))) == (
        "262",
        "02",
        None,
        None,
    )


def test_logs_around_a_row():
    for text in (
        f"[17:03:01.250] < {SMONI_2G}",
        SMONI_2G.lower(),
        f"'\\r\\n{SMONI_2G}\\r\\n\\r\\nOK\\r\\n'",
        f'"{SMONI_2G}"',
    ):
        assert one(text).cell == "262-02-323-33722"
    assert list(pieces([r"a\r\nb", "", " ", "c\r"])) == ["a", "b", "c"]


def test_unsolicited_rows():
    assert MODEM.role_of(SMONI_2G) == "serving"
    assert MODEM.role_of("^SMONI: 2G,SEARCH,SEARCH") is None
    assert MODEM.role_of("OK") is None


# --- damage


@pytest.mark.parametrize(
    "row",
    [
        SMONI_2G.replace("262,02", "26202"),
        SMONI_2G.replace("0143,83BA", "014383BA"),
        SMONI_2G.replace("0143", "143"),
        SMONI_2G.replace("83BA", "83B"),
        SMONI_3G.replace("00228FF", "0228FF"),
        SMONC.replace("3010,4EAF", "30104EAF"),
        MONI.replace("2A3B 4C5D", "2A3B4C5D"),
    ],
)
def test_lost_digit_or_comma_names_no_cell(row):
    assert not any(isinstance(found, CellReading) and found.cell for found in MODEM.rows_in([row]))


@pytest.mark.parametrize("sample", SAMPLES)
def test_cut_rows_read_nothing_else(sample):
    check_cuts(MODEM, sample)


# --- conversation


@pytest.mark.parametrize(
    ("command", "lines", "asked"),
    [
        (
            "AT^SMONI",
            [SMONI_2G],
            [
                "AT^SMONI",
                "AT^SMONP=255",
                "AT^SMOND",
                "AT^SMONC",
                "AT^MONI",
                "AT^MONP",
            ],  # who are its neighbours?
        ),
        ("AT^SMONI", ["^SMONI: 2G,SEARCH,SEARCH"], ["AT^SMONI", "AT^SMONP=255"]),
        ("AT^SMOND", [SMOND], ["AT^SMONI", "AT^SMONP=255", "AT^SMOND"]),
        ("AT^SMONC", [SMONC], ["AT^SMONI", "AT^SMONP=255", "AT^SMOND", "AT^SMONC"]),
        (
            "AT^MONI",
            [*HEADER, MONI],
            ["AT^SMONI", "AT^SMONP=255", "AT^SMOND", "AT^SMONC", "AT^MONI", "AT^MONP"],
        ),
    ],
)
def test_poll_asks_until_a_command_is_known(command, lines, asked):
    rows, sent = run_dialogue(MODEM.poll(), {command: (lines, "OK")})
    assert rows == MODEM.rows_in(lines)
    assert sent == asked


def test_neighbours_come_from_another_command_where_smonp_is_not_known():
    table = ["chann rs  dBm PLMN BCC C1 C2", MONP]
    replies = {
        "AT^SMONI": ([SMONI_2G], "OK"),
        "AT^MONI": ([*HEADER, MONI], "OK"),
        "AT^MONP": (table, "OK"),
    }
    rows, _ = run_dialogue(MODEM.poll(), replies)
    assert rows == (*MODEM.rows_in([SMONI_2G]), *MODEM.rows_in(table))
    assert [row.role for row in rows] == ["serving", "neighbour"]
    rows, sent = run_dialogue(MODEM.poll(), replies | {"AT^SMONP=255": ([], "OK")})
    assert rows == MODEM.rows_in([SMONI_2G])
    assert sent == ["AT^SMONI", "AT^SMONP=255"]


def test_a_serving_cell_of_another_width_beside_neighbours_is_that_of_creg():
    replies = {
        "AT^SMONI": ([SMONI_3G.replace("00228FF", "000228FF")], "OK"),
        "AT^SMONP=255": (["2G:", SMONP], "OK"),
        "AT+COPS?": (['+COPS: 0,2,"26202",2'], "OK"),
        "AT+CREG?": (['+CREG: 2,1,"0143","000228FF",2'], "OK"),
    }
    rows, _ = run_dialogue(MODEM.poll(), replies)
    cells = [row for row in rows if isinstance(row, CellReading)]
    assert [(cell.role, cell.cell) for cell in cells] == [
        ("serving", "262-02-323-141567"),
        ("neighbour", "262-07-10812-19550"),
    ]


def test_poll_of_a_modem_that_has_none_of_the_commands():
    replies = {
        "AT+COPS?": (['+COPS: 0,2,"26202",0'], "OK"),
        "AT+CREG?": (['+CREG: 2,1,"0143","83BA",0'], "OK"),
        "AT+CSQ": (["+CSQ: 20,99"], "OK"),
    }
    rows, _ = run_dialogue(MODEM.poll(), replies)
    assert (rows[0].cell, rows[0].rssi_dbm) == ("262-02-323-33722", -73.0)
