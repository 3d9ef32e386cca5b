from dataclasses import replace

import pytest

from logger.core.types import CellReading
from logger.drivers.reading.row_language import NoCell, Signal, as_json
from logger.drivers.reading.standard_replies import merge_serving_cells
from logger.drivers.sim7600 import cpsi_cells
from tests.kit.drivers import NO_IDENTITY, identity_of

# LTE and LTE_M are rows of the corpus, the others have values of our own in the layouts of
# firmware_notes/simcom.md.
GSM = "+CPSI: GSM,Online,262-01,0x3A5C,41213,637 DCS 1800,-74,0,28-26"
WCDMA = "+CPSI: WCDMA,Online,262-02,0x0A1B,19088743,WCDMA 2100,117,10688,0,9.5,86,25,31,500"
LTE = "+CPSI: LTE,Online,310-260,0x2D18,50896642,236,EUTRAN-BAND4,2300,5,5,-125,-987,-663,10"
LTE_M = "+CPSI: LTE CAT-M1,Online,240-07,0x2AFE,34564631,149,EUTRAN-BAND20,6400,3,3,-12,-81,-52,10"
INDEXED = "+CPSI: LTE,Online,262-03,0x5D21,7654321,318,EUTRAN-BAND20,6300,3,3,19,58,255,7"
NR_SA = "+CPSI: NR5G_SA,Online,262-01,0x2A4C31,19088743210,412,NR5G_BAND78,632448,-880,-105,18"
NR_NSA = "+CPSI: NR5G_NSA,731,NR5G_BAND78,641280,-905,-120,11,0,12"


def one(line):
    rows = cpsi_cells([line])
    assert len(rows) <= 1
    return rows[0] if rows else None


def test_gsm():
    assert one(GSM) == CellReading(
        role="serving",
        rat="GSM",
        mcc="262",
        mnc="01",
        lac=0x3A5C,
        cid=41213,
        arfcn=637,
        band="DCS 1800",
        rssi_dbm=-74.0,
        c1=28,
        c2=26,
        more={"state": "Online"},
    )


def test_gsm_of_an_a76xx_has_no_band():
    reading = one("+CPSI: GSM,Online,262-03,0x1C2D,23456,58,-69,1875,-4--9")
    assert (identity_of(reading), reading.arfcn, reading.band) == (
        ("262", "03", 0x1C2D, 23456),
        58,
        None,
    )
    assert (reading.rssi_dbm, reading.c1, reading.c2) == (-69.0, -4, -9)


def test_wcdma_levels_have_lost_their_sign():
    reading = one(WCDMA)
    assert (identity_of(reading), reading.psc, reading.arfcn) == (
        ("262", "02", 0x0A1B, 19088743),
        117,
        10688,
    )
    assert (reading.rscp_dbm, reading.ecio_db, reading.rssi_dbm) == (-86.0, -9.5, None)
    signed = one(WCDMA.replace(",9.5,86,", ",-9.5,-86,"))
    assert (signed.rscp_dbm, signed.ecio_db) == (-86.0, -9.5)
    nothing = one(WCDMA.replace(",9.5,86,", ",0,0,"))
    assert (nothing.rscp_dbm, nothing.ecio_db) == (None, None)


def test_lte_in_tenths_of_a_decibel():
    reading = one(LTE)
    assert (reading.rat, identity_of(reading), reading.lac) == (
        "LTE",
        ("310", "260", 0x2D18, 50896642),
        None,
    )
    assert (reading.pci, reading.arfcn, reading.band) == (236, 2300, 4)
    assert (reading.rsrq_db, reading.rsrp_dbm, reading.rssi_dbm, reading.sinr_db) == (
        -12.5,
        -98.7,
        -66.3,
        10.0,
    )


def test_lte_in_integer_decibel():
    reading = one(LTE_M)
    assert (reading.rat, identity_of(reading), reading.band) == (
        "LTE-M",
        ("240", "07", 0x2AFE, 34564631),
        20,
    )
    assert (reading.rsrq_db, reading.rsrp_dbm, reading.rssi_dbm, reading.sinr_db) == (
        -12.0,
        -81.0,
        -52.0,
        10.0,
    )
    assert one(LTE_M.replace("CAT-M1", "NB-IOT")).rat == "NB-IoT"


@pytest.mark.parametrize(
    ("system", "rat"),
    [
        ("LTE CAT-M", "LTE-M"),
        ("CAT-M1", "LTE-M"),
        ("LTE NB-IOT2", "NB-IoT"),
        ("LTE CAT-NB1", "NB-IoT"),
        ("NB", "NB-IoT"),
    ],
)
def test_words_for_a_system(system, rat):
    assert one(LTE_M.replace("LTE CAT-M1", system)) == replace(one(LTE_M), rat=rat)


def test_a_ratio_alone_is_no_level_of_nr():
    reading = one(NR_SA.replace(",-880,-105,", ",,-105,"))
    assert (reading.cell, reading.rsrp_dbm, reading.rsrq_db) == (one(NR_SA).cell, None, None)


@pytest.mark.parametrize("system", ["NR5G", "NR5G_NSA"])
def test_nr_with_state_and_network_is_nr_alone_whatever_its_word(system):
    assert one(NR_SA.replace("NR5G_SA", system)) == one(NR_SA)


def test_a_code_that_is_not_known_costs_no_row():
    assert one(LTE.replace(",236,", ",65535,")) == replace(one(LTE), pci=None)


def test_lte_as_an_index_has_no_level():
    reading = one(INDEXED)
    assert identity_of(reading) == ("262", "03", 0x5D21, 7654321)
    assert (reading.rsrp_dbm, reading.rsrq_db, reading.rssi_dbm, reading.sinr_db) == (
        None,
        None,
        None,
        7.0,
    )
    assert {name: as_json(reading)[name] for name in ("rsrq_raw", "rsrp_raw", "rssi_raw")} == {
        "rsrq_raw": 19,
        "rsrp_raw": 58,
        "rssi_raw": None,
    }


@pytest.mark.parametrize("snr", ["18", "240"])
def test_nr_alone_whose_unit_of_snr_differs_by_firmware(snr):
    reading = one(NR_SA.replace(",18", f",{snr}"))
    assert (reading.rat, identity_of(reading), reading.band) == (
        "NR",
        ("262", "01", 0x2A4C31, 19088743210),
        78,
    )
    assert (reading.pci, reading.arfcn, reading.rsrp_dbm, reading.rsrq_db) == (
        412,
        632448,
        -88.0,
        -10.5,
    )
    assert (reading.sinr_db, reading.more["sinr_raw"]) == (None, int(snr))


def test_nr_beside_lte():
    lte, nr = cpsi_cells([LTE, NR_NSA])
    assert (lte.rat, nr.rat, nr.role, identity_of(nr)) == ("LTE", "NR", "serving", NO_IDENTITY)
    assert (nr.pci, nr.arfcn, nr.band, nr.rsrp_dbm, nr.rsrq_db) == (731, 641280, 78, -90.5, -12.0)


@pytest.mark.parametrize(
    "row", ["+CPSI: NR5G,203,632736,-11,-92,6.5", "+CPSI: NR5G_NSA,203,632736,-92,-11,6.5"]
)
def test_nr_without_its_band_in_either_order(row):
    reading = one(row)
    assert (reading.pci, reading.arfcn, reading.band) == (203, 632736, None)
    assert (reading.rsrp_dbm, reading.rsrq_db, reading.more["sinr_raw"]) == (-92.0, -11.0, "6.5")


@pytest.mark.parametrize(
    ("line", "state"),
    [
        ("+CPSI: NO SERVICE,Online", "Online"),
        ("+CPSI: NO SERVICE, Online", "Online"),
        ("+CPSI: NO SERVICE,Powering Off", "Powering Off"),
        ("+CPSI: NO SERVICE", None),
        ("12:00:01 -> +CPSI: NO SERVICE,Online OK", "Online"),
        ("+cpsi: no service,Online\\r\\nOK", "Online"),
    ],
)
def test_no_service(line, state):
    assert one(line) == NoCell(status="NO SERVICE", state=state)


@pytest.mark.parametrize(
    "line",
    [
        LTE.replace("+CPSI: ", "+CPSI:"),
        LTE.replace(",", ", "),
        LTE + "\r",
        LTE + "\\r\\n\\r\\nOK\\r\\n",
        f'b"{LTE}"',
        LTE + " OK",
        LTE + "OK",
        "10:20:30.405 -> " + LTE,
        "AT+CPSI?" + LTE,
        LTE.replace("0x", "0X"),
        LTE.lower(),
        "# " + LTE.removeprefix("+"),
    ],
)
def test_writing_of_a_row(line):
    assert one(line) == one(LTE) or as_json(one(line)) | {"state": "Online"} == as_json(one(LTE))


def test_rows_run_into_each_other():
    first, second = cpsi_cells([LTE[:-3] + GSM])
    assert (identity_of(first), first.sinr_db, first.rssi_dbm) == (
        ("310", "260", 0x2D18, 50896642),
        None,
        None,
    )
    assert identity_of(second) == ("262", "01", 0x3A5C, 41213)


@pytest.mark.parametrize(
    ("whole", "other", "cell"),
    [
        (",50896642,", ",-294967296,", ("310", "260", 0x2D18, None)),
        (",50896642,", ",4294967295,", ("310", "260", 0x2D18, None)),
        (",50896642,", ",268435455,", ("310", "260", 0x2D18, None)),
        ("0x2D18", "0xFFFE", ("310", "260", None, 50896642)),
        ("0x2D18", "0x0000", ("310", "260", None, 50896642)),
        ("310-260", "000-00", NO_IDENTITY),
        ("0x2D18", "2D18", NO_IDENTITY),
        ("0x2D18", "0x12D18", NO_IDENTITY),
        (",50896642,", ",508966x2,", NO_IDENTITY),
        ("310-260", "310-2600", NO_IDENTITY),
    ],
)
def test_identity(whole, other, cell):
    reading = one(LTE.replace(whole, other))
    assert (identity_of(reading), reading.rsrp_dbm) == (cell, -98.7)


def test_while_the_cell_changes_there_is_none():
    assert (
        one("+CPSI: LTE,Online,262-02,0x3C4D,26543210,0,EUTRAN-BAND0,4294967295,0,0,0,0,0,0")
        is None
    )


ROWS = [GSM, WCDMA, LTE, LTE_M, INDEXED, NR_SA]


@pytest.mark.parametrize("row", ROWS)
def test_row_without_its_last_value_is_the_cell_and_a_shorter_one_is_none(row):
    values = row.split(",")
    assert identity_of(one(",".join(values[:-1]))) == identity_of(one(row))
    assert one(",".join(values[:-2])) is None


@pytest.mark.parametrize("row", ROWS)
@pytest.mark.parametrize("more", [",7", ",0,100"])
def test_more_values_at_the_end_of_a_row_cost_nothing(row, more):
    # written from the layouts of the SIM7500 and SIM7600 manual
    assert one(row + more) == one(row)


@pytest.mark.parametrize("row", ROWS)
def test_lost_value_before_the_levels_is_no_cell(row):
    values = row.split(",")
    for lost in range(2, 2 + 4):
        reading = one(",".join(values[:lost] + values[lost + 1 :]))
        assert reading is None or identity_of(reading) == identity_of(one(row)), lost


@pytest.mark.parametrize("row", [*ROWS, NR_NSA])
def test_comma_lost_or_added_makes_no_other_cell_and_no_other_level(row):
    whole = one(row)
    for at in range(len("+CPSI: "), len(row)):
        damaged = [row[:at] + row[at + 1 :]] if row[at] == "," else [row[:at] + "," + row[at:]]
        for reading in filter(None, map(one, damaged)):
            if not isinstance(reading, NoCell):
                assert identity_of(reading) in {identity_of(whole), NO_IDENTITY}, damaged
                assert reading.level_dbm in {whole.level_dbm, None}, damaged


@pytest.mark.parametrize(
    "line",
    [
        "AT+CPSI?",
        "+CPSI:",
        "+CPSI: CDMA,Online,001-03,283,150,-5.5,-11.0,0,0,-70.5,13999,1201,2,30101",
        "+CPSI: GSM,Online,262-01 0x3a5c,41213,81 EGSM 900,-79,0,17-12",
        "+CPSI: (0-255)",
        "+CCPSI: LTE,Online",
        LTE.replace("+CPSI", "+XCPSI"),
    ],
)
def test_other_lines_are_no_cell(line):
    assert one(line) is None


def test_joined_rows_name_the_serving_cell_once():
    first = CellReading(role="serving", rat="GSM", lac=5, cid=7, rxlev_raw=30)
    second = CellReading(
        role="serving",
        rat="GSM",
        mcc="262",
        mnc="01",
        lac=5,
        cid=7,
        band="DCS",
        rssi_dbm=-80.0,
        ta=2,
    )
    neighbour = CellReading(role="neighbour", rat="GSM", lac=5, cid=7, rxlev_raw=1)
    signal = Signal(csq_raw=3)
    joined, *others = merge_serving_cells([neighbour, first, signal, second])
    assert others == [neighbour, signal]
    assert joined == CellReading(
        role="serving", rat="GSM", mcc="262", mnc="01", lac=5, cid=7, band="DCS", rxlev_raw=30, ta=2
    )


def test_joined_rows_take_the_level_where_the_first_has_none():
    first = CellReading(role="serving", rat="LTE", cid=7, more={"rsrp_raw": 60})
    second = CellReading(
        role="serving", rat="LTE", cid=7, rsrp_dbm=-80.0, more={"rsrp_raw": 61, "a": 1}
    )
    other = CellReading(role="serving", rat="LTE", cid=8)
    joined, rest = merge_serving_cells([first, second, other])
    assert (joined.rsrp_dbm, dict(joined.more), rest) == (-80.0, {"rsrp_raw": 60, "a": 1}, other)
