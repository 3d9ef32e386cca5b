import pytest

from logger.core.types import CellReading
from logger.drivers.huawei import Huawei
from logger.drivers.reading.row_language import NoCell, Signal
from tests.kit.corpus import check_recorded
from tests.kit.drivers import NO_IDENTITY, check_cuts, identity_of, run_dialogue

MODEM = Huawei()

# Values of our own in the layouts of firmware_notes/huawei.md.
GSM = "^MONSC: GSM,262,01,1,58,27,3C4D,2A3B,-72,,"
WCDMA = "^MONSC: WCDMA,262,02,10713,117,1A2B3C4,A3C,-84,-67,-8,64,1"
LTE = "^MONSC: LTE,262,03,1444,2D3C4B5,12F,4E5F,-96,-12,-65"
NR = "^MONSC: NR,262,01,632448,1,4A5B6C7D8,1C2,2A4C31,-82,-11,17"
NEIGHBOURS = [
    "^MONNC: GSM,2,637,36,3C4E,2A3B,-84",
    "^MONNC: WCDMA,10713,305,-98,-13",
    "^MONNC: LTE,1850,9C,-90,-13,-62",
    "^MONNC: NR,632448,2A5,-88,-13,0",
]
SAMPLES = [GSM, WCDMA, LTE, NR, *NEIGHBOURS]


@pytest.mark.parametrize("dialect", ["huawei_monsc", "huawei_monnc", "huawei_hcsq"])
def test_recorded_replies(corpus, dialect):
    check_recorded(corpus, MODEM, dialect)


def one(*lines):
    found = MODEM.rows_in(lines)
    assert len(found) == 1
    return found[0]


# --- forms


def test_gsm():
    assert one(GSM) == CellReading(
        role="serving",
        rat="GSM",
        mcc="262",
        mnc="01",
        lac=0x2A3B,
        cid=0x3C4D,
        arfcn=58,
        band=900,
        bsic=27,
        rssi_dbm=-72.0,
    )
    assert (one(GSM.replace("-72,,", "-72,3,7")).rxq, one(GSM.replace("-72,,", "-72,3,7")).ta) == (
        3,
        7,
    )


def test_what_is_unknown_costs_no_row():
    assert one(GSM.replace(",58,", ",65535,")).arfcn is None
    assert one(LTE.replace(",-12,", ",-,")).rsrp_dbm == -96.0
    assert one(NR.replace("4A5B6C7D8", "FFFFFFF")).cid is None


def test_numbers_in_hexadecimal_may_have_a_prefix_or_a_zero():
    written = LTE.replace("2D3C4B5", "0x02D3C4B5").replace("4E5F", "0x4E5F")
    assert one(written) == one(LTE)
    assert one(LTE.replace("2D3C4B5", "02D3C4B5")) == one(LTE)


def test_numbers_for_unknown_cost_no_row():
    assert one(GSM.replace("-72,,", "-72,99,255")) == one(GSM)


def test_wcdma():
    cell = one(WCDMA)
    assert (cell.cell, cell.psc, cell.rscp_dbm, cell.rssi_dbm) == (
        f"262-02-{0xA3C}-{0x1A2B3C4}",
        117,
        -84.0,
        -67.0,
    )
    assert cell.ecio_db == -8.0
    empty = one("^MONSC: WCDMA,262,02,10713,,1A2B3C4,A3C,,,,,")
    assert (empty.cell, empty.psc, empty.rscp_dbm) == (f"262-02-{0xA3C}-{0x1A2B3C4}", None, None)


def test_lte_and_nr_have_a_hexadecimal_pci():
    lte, nr = MODEM.rows_in([LTE, NR])
    assert (lte.cell, lte.pci, lte.arfcn) == (f"262-03-{0x4E5F}-{0x2D3C4B5}", 0x12F, 1444)
    assert (lte.rsrp_dbm, lte.rsrq_db, lte.rssi_dbm) == (-96.0, -12.0, -65.0)
    assert (nr.cell, nr.pci, nr.arfcn) == (f"262-01-{0x2A4C31}-{0x4A5B6C7D8}", 0x1C2, 632448)
    assert (nr.rsrp_dbm, nr.rsrq_db, nr.sinr_db) == (-82.0, -11.0, 17.0)


def test_neighbours():
    gsm, wcdma, lte, nr = MODEM.rows_in(NEIGHBOURS)
    assert {cell.role for cell in (gsm, wcdma, lte, nr)} == {"neighbour"}
    assert (identity_of(gsm), gsm.arfcn, gsm.band, gsm.bsic, gsm.rssi_dbm) == (
        (None, None, 0x2A3B, 0x3C4E),
        637,
        1800,
        36,
        -84.0,
    )
    assert (wcdma.psc, wcdma.rscp_dbm, wcdma.ecio_db) == (305, -98.0, -13.0)
    assert (lte.pci, lte.rsrp_dbm, lte.rsrq_db, lte.rssi_dbm) == (0x9C, -90.0, -13.0, -62.0)
    assert (nr.pci, nr.sinr_db) == (0x2A5, 0.0)
    assert (identity_of(one("^MONNC: GSM,2,637,,,,-84")), one("^MONNC: GSM,2,637,,,,-84").bsic) == (
        NO_IDENTITY,
        None,
    )


def test_values_that_are_not_measured_or_unknown():
    nr = one("^MONNC: NR,632448,2A5,-157,-44,-24")
    assert (nr.pci, nr.rsrp_dbm, nr.rsrq_db, nr.sinr_db) == (0x2A5, None, None, None)
    assert (
        one("^MONNC: NR,632448,1B,-824,-104,-296").rsrp_dbm is None
    )  # eighths of a dB, on some firmware
    assert identity_of(one(GSM.replace("3C4D,2A3B", "FFFF,FFFE"))) == ("262", "01", None, None)
    assert identity_of(one(GSM.replace("262,01", "000,00"))) == NO_IDENTITY


def test_a_comma_within_the_area_makes_no_other_area():
    for row in (GSM, WCDMA, LTE, NR, NR.replace(",17", "")):
        whole, at = one(row), row.rindex(",", 0, row.index(",-"))
        for cut in range(at + 2, row.index(",-")):
            for moved in MODEM.rows_in([row[:cut] + "," + row[cut:]]):
                assert identity_of(moved) in {identity_of(whole), NO_IDENTITY}


def test_a_row_of_zeros_has_no_level():
    zeros = one("^MONSC: LTE,000,00,0,0,0,0,0,0,0")
    assert (identity_of(zeros), zeros.level_dbm, zeros.rsrq_db) == (NO_IDENTITY, None, None)


def test_no_cell():
    assert one("^MONSC: NONE") == NoCell(status="NONE")
    assert MODEM.rows_in(["^MONNC: NONE"]) == ()
    assert one('^HCSQ: "NOSERVICE"') == one("^HCSQ: NOSERVICE") == NoCell(status="NOSERVICE")
    assert MODEM.rows_in(['^HCSQ: "LTE"']) == ()


@pytest.mark.parametrize(
    "text", ['"LTE",41,28,70,0', "LTE,41,28,70,0", ' "LTE", 41,28,70,0', '"lte",41,28,70,0']
)
def test_signal_of_lte(text):
    assert one(f"^HCSQ:{text}") == Signal(
        "LTE",
        rssi_dbm=-80.0,
        rsrp_dbm=-113.0,
        sinr_db=-6.2,
        rsrq_db=None,
        more={"raw": [41, 28, 70, 0]},
    )


def test_signal_of_others():
    assert one('^HCSQ: "GSM",33,255') == Signal("GSM", rssi_dbm=-88.0, more={"raw": [33, 255]})
    wcdma = one('^HCSQ: "WCDMA",35,255,52')
    assert (wcdma.rssi_dbm, wcdma.rscp_dbm, wcdma.ecio_db) == (-86.0, None, -6.5)
    assert one('^HCSQ: "NR",70,80,60') == Signal("NR", more={"raw": [70, 80, 60]})


def test_cells_of_the_gsm_modules():
    assert one("^SMONC: 262,01,2A3B,3C4D,27,58,42,30,30").cell == "262-01-10811-15437"


def test_logs_around_a_row():
    for text in (
        f"[17:03:01.250] < {GSM}",
        GSM.lower(),
        f"'\\r\\n{GSM}\\r\\n\\r\\nOK\\r\\n'",
        f'"{GSM}"',
        GSM.replace(",", ", "),
    ):
        assert one(text).cell == "262-01-10811-15437"


def test_unsolicited_rows():
    assert MODEM.role_of(GSM) == "serving"
    assert MODEM.role_of(NEIGHBOURS[0]) == "neighbour"
    assert MODEM.role_of('^HCSQ:"LTE",41,28,70,0') is None


# --- damage


@pytest.mark.parametrize(
    "row",
    [
        GSM.replace("262,01", "26201"),
        GSM.replace("3C4D,2A3B", "3C4D2A3B"),
        GSM.replace("27,3C4D", "273C4D"),
        GSM.replace(",2A3B", ""),
        GSM.replace("GSM", "TD_SCDMA"),
        LTE.replace("12F,4E5F", "12F4E5F"),
        LTE.replace("1444", "14G4"),
        GSM + ",1,2,3",
        GSM[: GSM.index(",-72")],
    ],
)
def test_damaged_row_names_no_cell(row):
    assert MODEM.rows_in([row]) == ()


@pytest.mark.parametrize("sample", SAMPLES)
def test_cut_rows_read_nothing_else(sample):
    check_cuts(MODEM, sample)


# --- conversation


COMMON = {
    "AT+COPS?": (['+COPS: 0,2,"26203",7'], "OK"),
    "AT+CEREG?": (['+CEREG: 2,1,"4E5F","2D3C4B5",7'], "OK"),
    "AT^HCSQ?": (['^HCSQ: "LTE",41,51,70,10'], "OK"),
}


def test_poll():
    rows = run_dialogue(
        MODEM.poll(), {"AT^MONSC": ([GSM], "OK"), "AT^MONNC": (NEIGHBOURS[:1], "OK"), **COMMON}
    )[0]
    assert [row.role for row in rows if isinstance(row, CellReading)] == ["serving", "neighbour"]
    rows = run_dialogue(
        MODEM.poll(), {"AT^SMOND": (["^SMOND:262,01,2A3B,3C4D,27,58,72,,,0,,,0"], "OK")}
    )[0]
    assert [row.cell for row in rows if isinstance(row, CellReading)] == ["262-01-10811-15437"]


def test_poll_of_a_modem_that_does_not_know_monsc():
    serving, *_ = run_dialogue(MODEM.poll(), COMMON)[0]
    assert (serving.role, serving.cell, serving.rsrp_dbm) == (
        "serving",
        "262-03-20063-47432885",
        -90.0,
    )


def test_rows_before_a_time_out_are_kept():
    assert run_dialogue(MODEM.poll(), {"AT^MONSC": ([GSM], None)}, ((), None))[0] == (one(GSM),)


def test_a_pci_of_lte_above_all_pcis_was_no_hexadecimal_number():
    # written after the ME909s manual's form of ^MONSC, with a PCI that is 303 in decimal
    assert (one(LTE.replace(",12F,", ",303,")).pci, one(LTE).pci) == (None, 303)
    assert one("^MONNC: LTE,1850,303,-90,-13,-62").pci is None
    assert one("^MONNC: NR,632448,303,-88,-13,0").pci == 0x303
