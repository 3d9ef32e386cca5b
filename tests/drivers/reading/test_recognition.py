"""Which identities are sure: by the rows of one reply, and by what the modem has sent before."""

import pytest

from logger.drivers.reading.recognition import NumberHistory, mark_doubtful, mark_doubtful_replies
from logger.drivers.reading.standard_replies import merge_serving_cells, with_serving_cell
from logger.drivers.registry import FAMILIES
from tests.kit.drivers import identity_of

PADDED = [
    '+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"',
    '+CENG: 1,"0128,15,30,a53f,310,411,178d"',
]
SERVING = (
    '+QENG: "servingcell","NOCONN","LTE","FDD",262,01,{cid},212,1300,3,5,5,{tac},-97,-8,-70,14,30'
)
CPSI = "+CPSI: LTE,Online,262-02,0x2AFE,{cid},149,EUTRAN-BAND20,6300,3,3,-91,-885,-594,13"


def recognised_rows(family, *replies, known=None):
    """Readings of the last of the replies, which the modem sends one after the other."""
    known = known or NumberHistory()
    rows = ()
    for reply in replies:
        lines = [reply] if isinstance(reply, str) else reply
        rows, known = mark_doubtful(FAMILIES[family].read(lines), known)
    return rows


def lte(tac, cid):
    return SERVING.format(tac=tac, cid=cid)


def decimal(cid):
    return CPSI.format(cid=cid)


def test_a_lost_digit_beside_padded_rows_is_unsure_and_keeps_its_level():
    serving, neighbour = recognised_rows("sim800", [PADDED[0], PADDED[1].replace("a53f", "a5f")])
    assert not serving.identity_unsure
    assert (neighbour.cid, neighbour.identity_unsure, neighbour.rssi_dbm) == (0xA5F, True, -98.0)


@pytest.mark.parametrize("column", ["a53f", "178d"])
def test_no_row_beside_it_is_needed(column):
    (row,) = recognised_rows("sim800", PADDED[1].replace(column, column[:-1]))
    assert row.identity_unsure
    assert row.level_dbm == -98.0


def test_complete_rows_are_sure():
    assert not any(row.identity_unsure for row in recognised_rows("sim800", PADDED))


def test_a_number_that_stands_twice_is_what_it_is():
    rows = recognised_rows(
        "sim800", ['+CENG:1,"0672,19,30,a53e,310,260,113"', '+CENG:2,"0678,14,39,4e74,310,260,113"']
    )
    assert [identity_of(row)[2] for row in rows] == [0x113, 0x113]
    assert not any(row.identity_unsure for row in rows)


def test_an_area_and_its_other_base_are_printed_twice():
    cmgrmi = "+CMGRMI: Serving_Cell,1300,262,02,11006,2,7654321,3,5,5,12,149,-95,-912,-604,0"
    rows = recognised_rows("sim7600", [decimal(7654321), cmgrmi])
    assert not any(row.identity_unsure for row in rows)
    rows = recognised_rows("sim7600", [decimal(7654321), cmgrmi.replace("7654321", "754321")])
    assert all(row.identity_unsure for row in rows)


def test_areas_that_contradict_each_other_are_unsure_where_the_rows_are_one():
    cmgrmi = "+CMGRMI: Serving_Cell,6300,262,02,{area},2,190887432,3,3,3,12,149,-95,-912,-604,0"
    for area, unsure in ((11006, False), (1106, True)):
        rows = merge_serving_cells(
            FAMILIES["sim7600"].read([decimal(190887432), cmgrmi.format(area=area)])
        )
        ((row,), _) = mark_doubtful(rows, NumberHistory())
        assert row.identity_unsure is unsure


def test_rows_that_are_made_one_have_printed_the_cell_twice():
    ccinfo = (
        "+CCINFO:[SCELL],ARFCN:34,MCC:262,MNC:01,LAC:14940,ID:1213,"
        "BSIC:18,RXLev:-78dbm,C1:33,C2:33,TA:0,TXPWR:0"
    )
    gsm = "+CPSI: GSM,Online,262-01,0x3A5C,1213,34 EGSM 900,-78,0,33-33"
    for lines, unsure in (([gsm, ccinfo], False), ([gsm], True)):
        ((row,), _) = mark_doubtful(
            merge_serving_cells(FAMILIES["sim7600"].read(lines)), NumberHistory()
        )
        assert (row.cid, row.identity_unsure) == (1213, unsure)


def test_serving_cells_of_one_channel_contradict_each_other():
    other = decimal(190887432).replace("0x2AFE", "0x2AFD")
    assert all(
        row.identity_unsure for row in recognised_rows("sim7600", [decimal(190887432), other])
    )


def test_rows_of_one_reply_show_a_firmware_that_does_not_pad():
    rows = recognised_rows(
        "sim800",
        [f'+CENG: {n},"404,04,{lac},d91{n},38,13"' for n, lac in enumerate(("1b3", "138", "7d"))],
    )
    assert not any(row.identity_unsure for row in rows)


def test_an_earlier_reply_shows_the_form_for_any_cell():
    assert recognised_rows("quectel", lte("BFF", "4940206"))[0].identity_unsure
    (later,) = recognised_rows("quectel", lte("BFF", "4940206"), lte("D17", "127328"))
    assert not later.identity_unsure
    assert recognised_rows("sim7600", decimal(50896642))[0].identity_unsure
    assert not recognised_rows("sim7600", decimal(50896642), decimal(7131))[0].identity_unsure


def test_an_earlier_reply_shows_padding():
    lost = PADDED[1].replace("178d", "17d")
    assert recognised_rows("sim800", PADDED[1].replace("178d", "0113"), lost)[0].identity_unsure


@pytest.mark.parametrize("cid", ["2089664", "2008964", "220089664", "200896664"])
def test_a_digit_lost_or_doubled_of_a_known_cell_is_unsure(cid):
    (row,) = recognised_rows("sim7600", *[decimal(20089664)] * 3, decimal(cid))
    assert row.cid == int(cid)
    assert row.identity_unsure, row


def test_the_known_cell_stays_sure_beside_its_damaged_self():
    (row,) = recognised_rows(
        "sim7600", *[decimal(50896642)] * 3, decimal(5896642), decimal(50896642)
    )
    assert not row.identity_unsure


def test_a_neighbour_that_is_often_received_is_no_damage():
    known = NumberHistory()
    for _ in range(5):
        for cid in (10111, 1011):
            rows, known = mark_doubtful(FAMILIES["sim7600"].read([decimal(cid)]), known)
    assert not rows[0].identity_unsure


def test_the_same_damage_again_and_again_proves_nothing():
    known = NumberHistory()
    for number in range(400):
        lost = number % 100 == 99
        (row,), known = mark_doubtful(
            FAMILIES["quectel"].read([lte("1A2" if lost else "1A2B", "4940206")]), known
        )
        assert row.identity_unsure == lost


@pytest.mark.parametrize(
    ("mcc", "mnc", "unsure"),
    [
        ("262", "01", False),
        ("262", "001", True),
        ("262", "011", True),
        ("310", "260", False),
        ("310", "26", True),
    ],
)
def test_a_network_code_has_the_digits_of_its_country(mcc, mnc, unsure):
    assert (
        recognised_rows("sim800", PADDED[1].replace("310,411", f"{mcc},{mnc}"))[0].identity_unsure
        is unsure
    )


def test_a_network_code_received_before_is_sure_and_its_damage_is_not():
    odd = PADDED[1].replace("310,411", "262,001")
    assert not recognised_rows("sim800", odd, odd)[0].identity_unsure
    known = PADDED[1].replace("310,411", "405,864")
    assert recognised_rows("sim800", known, known, known.replace("864", "84"))[0].identity_unsure


@pytest.mark.parametrize(
    ("row", "arfcn", "level"), [("0128,15", 128, -98.0), ("0128,5", 128, None)]
)
def test_a_level_without_its_padding_is_none(row, arfcn, level):
    reading = recognised_rows("sim800", [PADDED[0], PADDED[1].replace("0128,15", row)])[1]
    assert (reading.arfcn, reading.rssi_dbm, reading.cid) == (arfcn, level, 0xA53F)
    assert (reading.rxlev_raw is None) is (level is None)


def test_a_channel_without_its_padding_is_none():
    reading = recognised_rows("sim800", [PADDED[0], PADDED[1].replace("0128,15", "128,15")])[1]
    assert (reading.arfcn, reading.arfcn_raw, reading.rssi_dbm) == (None, None, -98.0)


def test_levels_of_firmware_that_does_not_pad_are_read():
    rows = recognised_rows(
        "sim800", [f'+CENG: {n},"{61 + n},{n},30,a53{n},310,411,178d"' for n in range(1, 5)]
    )
    assert [row.rxlev_raw for row in rows] == [1, 2, 3, 4]
    assert [row.arfcn for row in rows] == [62, 63, 64, 65]


def test_rows_come_back_with_plain_numbers():
    for row in recognised_rows("sim800", PADDED):
        assert {
            type(getattr(row, name)) for name in ("lac", "cid", "arfcn_raw", "rxlev_raw", "bsic")
        } <= {int}


def test_what_is_remembered_is_bounded():
    known = NumberHistory()
    for cid in range(100_000, 102_500):
        _, known = mark_doubtful(FAMILIES["sim7600"].read([decimal(cid)]), known)
    assert all(len(texts) <= 2000 for texts in known.columns.values())
    assert len(known.codes) <= 2000


def test_replies_of_a_transcript_know_of_each_other():
    replies = [
        FAMILIES["sim7600"].read([decimal(cid)])
        for cid in (50896642, 5896642, 50896642, 50896642, 7131)
    ]
    found, _ = mark_doubtful_replies(replies, NumberHistory())
    assert [row.identity_unsure for rows in found for row in rows] == [
        False,
        True,
        False,
        False,
        False,
    ]


def _lte_status(level):
    return [
        "!GSTATUS:",
        "System mode:   LTE        \tPS state:    Attached",
        "LTE Rx chan:   1300\t\tLTE Tx chan: 19300",
        f"PCC RxM RSSI:  -67\t\tPCC RxM RSRP: {level}",
        "Tx Power:      0 \t\tTAC:         1A2B (6699)",
        "RSRQ (dB):     -11.5\t\tCell ID:     02D00A0B (47188491)",
    ]


def _levels_of(levels):
    known, found = NumberHistory(), []
    for level in levels:
        (row,), known = mark_doubtful(FAMILIES["sierra"].read(_lte_status(level)), known)
        found.append(row.level_dbm)
    return found


def test_the_carrier_does_not_stand_for_a_lost_level_of_the_cell():
    """A report behind the row takes its last value; the RSSI is some 30 dB above the RSRP."""
    assert _levels_of(["-98", "", "-97"]) == [-98.0, None, -97.0]
    assert _levels_of(["", "--", "---"]) == [-67.0] * 3, "a modem that has no other level"


def test_a_carrier_of_no_cell_keeps_its_level():
    cell = "earfcn: 1300 rxLev: -70 mcc: 262 mnc: 02 cellId: 47188491 tac: 12345 cellIdentity: 135"
    lines = [
        f"{cell} cellStatus: CELL_SUITABLE rsrp: -98.00 rsrq: -11.00",
        "earfcn: 6300 rxLev: -80",
    ]
    rows, _ = mark_doubtful(FAMILIES["telit"].read(lines), NumberHistory())
    assert [row.level_dbm for row in rows] == [-98.0, -80.0]


@pytest.mark.parametrize(
    ("cell", "act", "unsure"),
    [("1345103", 7, False), ("0303", 7, True), ("0303", 2, True), ("0303", 0, False)],
)
def test_four_digits_are_all_of_a_cell_of_gsm_alone(cell, act, unsure):
    # written after 3GPP TS 27.007 10.1.22: the cell of LTE has 28 bits; 0303 has lost some
    lines = ['+COPS: 0,2,"26202"', f'+CREG: 2,1,"BF75","{cell}",{act}']
    rows = with_serving_cell(FAMILIES["generic"].read(lines))
    (serving, *_), _ = mark_doubtful(rows, NumberHistory())
    assert (serving.cid, serving.identity_unsure) == (int(cell, 16), unsure)
