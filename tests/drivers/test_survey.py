import pytest

from logger.drivers.telit import Telit
from tests.kit.drivers import NO_IDENTITY, cells_of, identity_of

MODEM = Telit()

# Values of our own in the layouts of firmware_notes/telit.md.
SERVING = "#MONI: S 52 3F6A 1B7C 688 -79dbm 22 30 1 0 Example Net"

LABELLED = "#MONI: Cc:262 Nc:01 BSIC:52 RxQual:0 LAC:3F6A Id:1B7C ARFCN:1002 PWR:-71dbm TA:0"

SURVEYED = (
    "arfcn: 61 bsic: 37 rxLev: -57 ber: 0.00 mcc: 262 mnc: 1 lac:"
    " 12345 cellId: 6789 cellStatus: CELL_SUITABLE "
    "numArfcn: 2 arfcn: 61 67 numChannels: 3 array: 3 9 27 pbcch: 0 mstxpwr: 5 rxaccmin: 4"
)

SURVEYED_HEX = (
    SURVEYED.replace("12345", "3039").replace("6789", "0A85").replace("bsic: 37", "bsic: 71")
)

CSV = "1005,26,-76,0,262,02,23456,34567,CELL_SUITABLE,0"

CSV_UMTS = "10713,-85,262,88,117,1234567,23457,0,-91,-4"

CSV_LTE = "1444,-69,001,010,47432885,20063,303,0,-98,-12,20"


def cells(*lines):
    return cells_of(MODEM, lines)


def one(*lines):
    (row,) = MODEM.read(lines)
    return row


def test_survey_with_labels():
    row = one(SURVEYED)
    assert (row.role, identity_of(row), row.arfcn, row.bsic) == (
        "scan",
        ("262", "01", 12345, 6789),
        61,
        37,
    )
    assert (row.rssi_dbm, row.more) == (-57.0, {"status": "CELL_SUITABLE"})


def test_survey_in_hexadecimal_has_an_octal_bsic():
    row = one(SURVEYED_HEX)
    assert (identity_of(row), row.bsic) == (("262", "01", 0x3039, 0x0A85), 57)


def test_survey_in_numbers():
    gsm, umts, lte = cells(CSV, CSV_UMTS, CSV_LTE)
    assert (gsm.rat, identity_of(gsm), gsm.bsic, gsm.more["status"]) == (
        "GSM",
        ("262", "02", 23456, 34567),
        26,
        "CELL_SUITABLE",
    )
    assert (umts.rat, identity_of(umts), umts.psc, umts.rscp_dbm) == (
        "WCDMA",
        ("262", "88", 23457, 1234567),
        117,
        -91,
    )
    assert (lte.rat, identity_of(lte), lte.pci, lte.rsrp_dbm) == (
        "LTE",
        ("001", "010", 20063, 47432885),
        303,
        -98,
    )
    assert lte.rsrq_db == -12


AMBIGUOUS = "44,26,-76,0,262,02,2345,3456,0,0"


def test_base_that_does_not_show_is_taken_as_shipped_and_unsure():
    row = one(AMBIGUOUS)
    assert (identity_of(row), row.identity_unsure) == (("262", "02", 2345, 3456), True)
    assert (row.bsic, row.rssi_dbm) == (None, -76.0)
    assert not cells(CSV, AMBIGUOUS)[1].identity_unsure


@pytest.mark.parametrize("head", [["Network survey started ..."], ["AT#CSURVC"], []])
@pytest.mark.parametrize(
    "end", ["0,-98,-12,20", "0,-98,-12", "CELL_SUITABLE,-98,-12", "0", "CELL_OTHER"]
)
def test_carrier_of_lte_without_what_stands_around_it(head, end):
    (row,) = cells(*head, f"66786,-68,001,010,47432885,20063,303,{end}")
    assert (row.rat, identity_of(row), row.arfcn, row.pci) == (
        "LTE",
        ("001", "010", 20063, 47432885),
        66786,
        303,
    )
    assert row.rssi_dbm == -68
    assert (row.rsrp_dbm is None) == ("-98" not in end)


def test_carrier_of_lte_or_wcdma_that_is_not_decoded():
    rows = cells(
        "Network survey started ...",
        "66786,-88",
        "earfcn: 1444 rxLev: -91",
        "uarfcn: 10713 rxLev: -93",
    )
    assert [(row.rat, row.arfcn, row.rssi_dbm) for row in rows] == [
        ("LTE", 66786, -88), ("LTE", 1444, -91), ("WCDMA", 10713, -93),
    ]  # fmt: skip


@pytest.mark.parametrize("ta", [0, 1, 37, 63])
def test_timing_advance_in_both_forms(ta):
    assert one(SERVING.replace(" 1 0 Ex", f" {ta} 0 Ex")).ta == ta
    assert one(LABELLED.replace("TA:0", f"TA:{ta}")).ta == ta
    assert one(LABELLED.replace("TA:0", "TA:64")).ta is None


@pytest.mark.parametrize(
    ("beside", "lac", "bsic"),
    [(CSV, 2345, 26), (CSV.replace("23456,34567", "5BA0,87C7"), 0x2345, 0o26)],
)
def test_base_shows_in_other_lines_of_the_survey(beside, lac, bsic):
    row = cells(beside, AMBIGUOUS)[1]
    assert (row.lac, row.bsic) == (lac, bsic)


@pytest.mark.parametrize(
    ("setting", "lac"), [("AT#CSURVF=0", 2345), ("#CSURVF: 1", 0x2345), ("AT#CSURVF=2", 0x2345)]
)
def test_base_that_the_transcript_sets(setting, lac):
    assert cells(setting, AMBIGUOUS)[0].lac == lac


def test_line_in_another_base_than_its_survey_names_no_cell():
    assert [row.cell is None for row in cells(CSV, CSV, CSV.replace("23456", "2345A"))] == [
        False,
        False,
        True,
    ]


def test_codes_as_hexadecimal_numbers():
    for line in (
        "6300,-73,E8,B,1A2B3C4,4E5F,163,0,-99,-9,15",
        "6300,-73,0E8,0B,1A2B3C4,4E5F,163,0,-99,-9,15",
    ):
        assert identity_of(one(line)) == ("232", "11", 0x4E5F, 0x1A2B3C4)
    lines = (
        "6300,-73,106,065,1A2B3C4,4E5F,163,0,-99,-9,15",
        "6300,-79,106,065,1A2B3C5,4E5F,164,0,-99,-9,15",
    )
    assert [identity_of(row)[:2] for row in cells(*lines)] == [("262", "101")] * 2


@pytest.mark.parametrize("damaged", ["182", "062", "2A2", "E62", "26F", "22"])
def test_a_country_code_that_is_damaged_is_not_taken_for_hexadecimal(damaged):
    row = one(CSV.replace("262", damaged))
    assert (identity_of(row), row.rssi_dbm) == (NO_IDENTITY, -76.0)


def test_carrier_without_identity():
    lines = [
        "Network survey started ...",
        "44,-93",
        "arfcn: 30 rxLev: -95",
        "5,12,-80,0,FFF,FF,FFFF,FFFF,5,0",
    ]
    rows = cells(*lines)
    assert [(row.arfcn, row.rssi_dbm) for row in rows] == [(44, -93), (30, -95), (5, -80)]
    assert {identity_of(row) for row in rows} == {NO_IDENTITY}
    assert MODEM.read(["44,-93"]) == ()
    assert MODEM.read([*lines[:1], "Network survey ended (Carrier: 2 BCCh: 1)", "44,-93"]) == ()


def test_two_records_that_have_run_into_each_other():
    for end in range(60, 140):
        for row in cells(
            SURVEYED[:end] + SURVEYED.replace("12345", "12346").replace("6789", "4711")
        ):
            assert identity_of(row) in {
                NO_IDENTITY,
                ("262", "01", 12345, 6789),
                ("262", "01", 12346, 4711),
            }
