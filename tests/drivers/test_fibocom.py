import pytest

from logger.core.types import CellReading
from logger.drivers.fibocom import Fibocom
from logger.drivers.reading.row_language import NoCell
from tests.kit.corpus import check_recorded
from tests.kit.drivers import check_cuts, identity_of, run_dialogue

MODEM = Fibocom()

# Values of our own in the layouts of firmware_notes/fibocom.md; BARE is that of an FM350.
HEADED = [
    "AT+GTCCINFO?",
    "+GTCCINFO:",
    "LTE service cell:",
    "1,4,262,02,4E5F,2D3C4B5,5A4,12F,103,75,14,45,40,24",
    "LTE neighbor cell:",
    "2,4,,,,,5A4,131,,23,23,6",
    "2,4,,,,,C8,D3,,15,15,9",
    "",
    "OK",
]
BARE = [
    "+GTCCINFO:",
    "1,4,262,03,4E60,002D3C4B6,1444,305,103,75,-1,31,31,15",
    "",
    "2,4,,,FFFF,00FFFFFFF,2850,417,,22,22,12",
]
EN_DC = [
    "+GTCCINFO:",
    "LTE-NR EN-DC service cell:",
    "1,4,262,11,4E5F,2D3C4B5,5A4,1B8,103,100,38,60,60,22",
    "1,9,262,11,2A4C,4A5B6C7,9A680,0C3,5078,100,55,74,74,60",
]
UMTS = ["+GTCCINFO:", "UMTS service cell:", "1,2,262,02,A3C,1A2B3C4,29D9,75,1,33,38,1,30"]
GSM = ["+GTCCINFO:", "GSM service cell:", "1,1,262,01,2A3B,3C4D,58,27,900,5,20,33"]
SAMPLES = ["\n".join(sample) for sample in (HEADED, BARE, EN_DC, UMTS, GSM)]


def test_recorded_replies(corpus):
    check_recorded(corpus, MODEM, "fibocom")


# --- forms


def test_modem_with_headings_prints_channel_and_pci_in_hexadecimal():
    serving, first, second = MODEM.rows_in(HEADED)
    assert serving == CellReading(
        role="serving",
        rat="LTE",
        mcc="262",
        mnc="02",
        tac=0x4E5F,
        cid=0x2D3C4B5,
        arfcn=1444,
        band=3,
        pci=303,
        rsrp_dbm=-101.0,
        rsrq_db=-8.0,
        more={"sinr_raw": 14, "rsrp_raw": 40, "rsrq_raw": 24},
    )
    assert (first.role, identity_of(first), first.arfcn, first.pci) == (
        "neighbour",
        (None, None, None, None),
        1444,
        305,
    )
    assert (first.rsrp_dbm, first.rsrq_db, second.arfcn, second.pci) == (-118.0, -17.0, 200, 211)


def test_fm350_prints_them_in_decimal():
    serving, neighbour = MODEM.rows_in(BARE)
    assert (serving.cell, serving.arfcn, serving.pci, serving.band) == (
        "262-03-20064-47432886",
        1444,
        305,
        3,
    )
    assert (identity_of(neighbour), neighbour.arfcn, neighbour.pci) == (
        (None, None, None, None),
        2850,
        417,
    )


def test_the_rows_decide_against_the_headings():
    serving, neighbour = MODEM.rows_in([BARE[0], "LTE service cell:", *BARE[1:]])
    assert (serving.arfcn, neighbour.pci) == (1444, 417)
    serving, *_ = MODEM.rows_in([line for line in HEADED if "cell:" not in line])
    assert (serving.arfcn, serving.pci) == (1444, 303)


@pytest.mark.parametrize(
    ("heading", "row", "place"),
    [
        ("LTE", "1,4,310,260,4E5F,2D3C4B5,68611,136,171,25,22,40,40,16", (68611, 136, 71)),
        ("LTE", "1,4,310,260,4E5F,2D3C4B5,10C03,88,171,25,22,40,40,16", (68611, 136, 71)),
        ("NR", "1,9,262,01,2A4C31,4A5B6C7D8,632448,301,5078,273,30,60,56,65", (632448, 301, 78)),
        ("NR", "1,9,262,01,2A4C31,4A5B6C7D8,154570,301,5028,50,30,60,56,65", (154570, 301, 28)),
        ("NR", "1,9,262,01,2A4C31,4A5B6C7D8,1F9901,12D,50258,66,30,60,56,65", (2070785, 301, 258)),
        ("UMTS", "1,2,262,02,A3C,1A2B3C4,10737,117,1,33,38,1,30", (10737, None, 1)),
    ],
)
def test_a_channel_that_no_band_has_is_of_the_other_base(heading, row, place):
    (reading,) = MODEM.rows_in(["+GTCCINFO:", f"{heading} service cell:", row, "OK"])
    assert (reading.arfcn, reading.pci, reading.band) == place


def test_a_dash_for_an_unknown_value_costs_no_row():
    serving, *_ = MODEM.rows_in([line.replace(",14,45,40,24", ",-,45,40,24") for line in HEADED])
    assert (serving.cid, serving.rsrp_dbm) == (0x2D3C4B5, -101.0)


def test_where_no_base_fits_the_channel_is_unknown():
    reading, _ = MODEM.rows_in([line.replace("1444", "9999") for line in BARE])
    assert (reading.cell, reading.arfcn, reading.pci) == ("262-03-20064-47432886", None, None)


def test_5g_beside_lte():
    lte, nr = MODEM.rows_in(EN_DC)
    assert (lte.cell, lte.arfcn, lte.pci) == ("262-11-20063-47432885", 1444, 440)
    assert (nr.cell, nr.rat, nr.arfcn, nr.band, nr.pci) == (
        "262-11-10828-77969095",
        "NR",
        632448,
        78,
        195,
    )
    assert (nr.rsrp_dbm, nr.rsrq_db) == (-83.0, -13.5)
    filler = MODEM.rows_in([*BARE[:2], "1,9,,,FFFFFFF,00FFFFFFF,632448,211,5078,400,2,55,55,60"])[1]
    assert (identity_of(filler), filler.arfcn, filler.pci) == (
        (None, None, None, None),
        632448,
        211,
    )


def test_wcdma_and_gsm():
    (wcdma,), (gsm,) = MODEM.rows_in(UMTS), MODEM.rows_in(GSM)
    assert (wcdma.rat, wcdma.cell, wcdma.arfcn, wcdma.psc) == (
        "WCDMA",
        "262-02-2620-27440068",
        10713,
        117,
    )
    assert (wcdma.rscp_dbm, wcdma.ecio_db) == (-83.0, -8.0)
    assert (gsm.rat, gsm.cell, gsm.arfcn, gsm.level_dbm) == (
        "GSM",
        "262-01-10811-15437",
        None,
        None,
    )


def test_no_cell():
    assert MODEM.rows_in(["AT+GTCCINFO?", "+GTCCINFO:", "2,0,,,FFFF,0,0,,0,,,,,", "OK"]) == (
        NoCell(),
    )
    assert MODEM.rows_in(["+GTCCINFO:", "OK"]) == ()


def test_network_code_of_one_digit_is_no_network():
    serving, _ = MODEM.rows_in([line.replace("262,03", "262,3") for line in BARE])
    assert identity_of(serving) == (None, None, 0x4E60, 0x2D3C4B6)


def test_logs_around_a_reply():
    whole = MODEM.rows_in(HEADED)
    assert MODEM.rows_in([f"[17:03:01] {line}" for line in HEADED]) == whole
    assert MODEM.rows_in(["\\r\\n".join(HEADED)]) == whole
    assert MODEM.rows_in([line.lower() for line in HEADED]) == whole
    assert MODEM.rows_in([line for line in HEADED if line != "+GTCCINFO:"]) == whole
    assert MODEM.rows_in([*HEADED, "AT+GTCAINFO?", "PCC: 103,303,1444,75,0,1,0,0,40"]) == whole
    assert MODEM.rows_in(HEADED[2:]) == ()


# --- damage


@pytest.mark.parametrize(
    ("good", "bad"),
    [("262,02", "26202"), ("4E5F,2D3C4B5", "4E5F2D3C4B5"), ("4E5F", "4G5F"), (",40,24", "")],
)
def test_damaged_row_names_no_cell(good, bad):
    assert not any(row.cid for row in MODEM.rows_in([line.replace(good, bad) for line in HEADED]))


@pytest.mark.parametrize("sample", SAMPLES)
def test_cut_replies_read_nothing_else(sample):
    check_cuts(MODEM, sample)


# --- conversation


COMMON = {
    "AT+COPS?": (['+COPS: 0,2,"26202",0'], "OK"),
    "AT+CREG?": (['+CREG: 2,1,"0143","83BA",0'], "OK"),
    "AT+CSQ": (["+CSQ: 20,99"], "OK"),
}


def test_poll():
    rows = run_dialogue(MODEM.poll(), {"AT+GTCCINFO?": (HEADED[1:-1], "OK"), **COMMON})[0]
    assert [row.role for row in rows if isinstance(row, CellReading)] == [
        "serving",
        "neighbour",
        "neighbour",
    ]


def test_poll_where_the_reply_has_no_serving_cell():
    serving, *_ = run_dialogue(MODEM.poll(), {"AT+GTCCINFO?": (["+GTCCINFO:"], "OK"), **COMMON})[0]
    assert (serving.cell, serving.rssi_dbm) == ("262-02-323-33722", -73.0)
