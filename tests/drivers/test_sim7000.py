import pytest

from logger.core.types import CellReading
from logger.drivers.family import AUTOBAUD_TRIES
from logger.drivers.generic import NAME as NAMING
from logger.drivers.generic import Generic
from logger.drivers.reading.row_language import NoCell, as_json
from logger.drivers.sim7000 import Sim7000
from tests.kit.corpus import check_entry, entries, lines_of
from tests.kit.drivers import NO_IDENTITY, identity_of, poll_on_the_wire, run_exchange

MODEM = Sim7000()

# Values of our own in the layouts of firmware_notes/simcom.md; the GSM rows are of the corpus.
LTE_HEADER = "+CENG: 1,1,2,LTE CAT-M1"
LTE_SERVING = '+CENG: 0,"1444,207,-81,-55,-9,13,4660,30541322,262,03,255"'
LTE_NEIGHBOUR = '+CENG: 1,"1444,91,-95,-60,-16,13"'
GSM_HEADER = "+CENG: 1,1,6,GSM"
GSM_SERVING = '+CENG: 0,"0665,35,02,4b2c,404,95,c1c0"'
GSM_NEIGHBOUR = '+CENG: 1,"0662,31,08,48aa,404,95,c1c0"'
CPSI = "+CPSI: LTE CAT-M1,Online,262-03,0x1234,30541322,207,EUTRAN-BAND3,1444,5,5,-10,-82,-56,12"


def one(line, header=None):
    readings = MODEM.read([line] if header is None else [header, line])
    assert len(readings) <= 1
    return readings[0] if readings else None


# --- rows


def test_lte_serving_cell_has_decimal_identity():
    assert one(LTE_SERVING, LTE_HEADER) == CellReading(
        role="serving",
        rat="LTE-M",
        mcc="262",
        mnc="03",
        tac=4660,
        cid=30541322,
        arfcn=1444,
        pci=207,
        rsrp_dbm=-81.0,
        rssi_dbm=-55.0,
        rsrq_db=-9.0,
        sinr_db=13.0,
    )


def test_lte_neighbour():
    row = one(LTE_NEIGHBOUR, LTE_HEADER)
    assert (row.role, row.rat, identity_of(row), row.arfcn, row.pci) == (
        "neighbour",
        "LTE-M",
        NO_IDENTITY,
        1444,
        91,
    )
    assert (row.rsrp_dbm, row.rssi_dbm, row.rsrq_db, row.sinr_db) == (-95.0, -60.0, -16.0, 13.0)


@pytest.mark.parametrize(
    ("header", "rat"),
    [
        ("+CENG: 1,1,3,LTE NB-IOT", "NB-IoT"),
        ("+CENG: 1,1,1,NB-IOT", "NB-IoT"),
        (None, None),
        ("+CENG: 1,1,1,LTE", None),
    ],
)
def test_header_reports_the_technology(header, rat):
    assert (one(LTE_SERVING, header).rat, identity_of(one(LTE_SERVING, header))) == (
        rat,
        ("262", "03", 4660, 30541322),
    )


@pytest.mark.parametrize("header", [GSM_HEADER, None])
def test_gsm_rows_are_alike_and_hexadecimal(header):
    serving, neighbour = one(GSM_SERVING, header), one(GSM_NEIGHBOUR, header)
    assert serving == CellReading(
        role="serving",
        rat="GSM",
        mcc="404",
        mnc="95",
        lac=0xC1C0,
        cid=0x4B2C,
        arfcn=665,
        arfcn_raw=665,
        bsic=2,
        rxlev_raw=35,
    )
    assert (neighbour.role, identity_of(neighbour), neighbour.bsic) == (
        "neighbour",
        ("404", "95", 0xC1C0, 0x48AA),
        8,
    )


@pytest.mark.parametrize(
    "row",
    [
        GSM_SERVING.replace('"0665', "0665").replace('c1c0"', "c1c0"),
        GSM_SERVING + "\r",
        "12:00:01 -> " + GSM_SERVING,
        GSM_SERVING.replace('"', '\\"') + "\\r\\n",
        GSM_SERVING[:-1],
        GSM_SERVING.replace(": ", ":"),
        GSM_SERVING.upper(),
        GSM_SERVING.replace(",", ", "),
    ],
)
def test_writing_of_a_row(row):
    assert one(row, GSM_HEADER) == one(GSM_SERVING)


def test_a_complete_reply_as_text_in_one_line():
    text = f"AT+CENG?\\r\\n{LTE_HEADER}\\r\\n{LTE_SERVING}\\r\\n{LTE_NEIGHBOUR}\\r\\nOK"
    assert MODEM.read([f"b'{text}'"]) == MODEM.read([LTE_HEADER, LTE_SERVING, LTE_NEIGHBOUR])
    assert len(MODEM.read([text])) == 2


@pytest.mark.parametrize("header", ["+CENG: 1,1", "+CENG: 3,0", "+CENG: 0,0"])
def test_under_a_header_of_a_sim800_nothing_is_read(header):
    assert one(GSM_NEIGHBOUR, header) is None
    assert one('+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"', header) is None


def test_rows_of_a_sim800_without_a_header():
    assert one('+CENG: 0,"0154,28,00,310,411,12,000f,00,05,178d,255"') is None
    assert one('+CENG: 1,"0128,15,30,310,411,178d"') is None
    assert one('+CENG: 1,"262,01,2b3c,4d5e,27,31"') is None


@pytest.mark.parametrize(
    ("row", "channel", "rxl"),
    [
        ('+CENG: 2,"0663,26,00,0000,000,00,0000"', 663, 26),
        ('+CENG: 2,"0663,26,00,ffff,,,0000"', 663, 26),
        ('+CENG: 2,"0663,26,61,4b2b,404,95c1c0"', 663, 26),
        ('+CENG: 2,"0663,26,61,4g2b,404,95,c1c0"', 663, 26),
        ('+CENG: 2,"0663,26,61,04b2b,404,95,c1c0"', 663, 26),
    ],
)
def test_gsm_row_without_a_complete_identity_keeps_its_level(row, channel, rxl):
    reading = one(row, GSM_HEADER)
    assert (identity_of(reading), reading.arfcn, reading.rxlev_raw) == (NO_IDENTITY, channel, rxl)


@pytest.mark.parametrize(
    "row",
    [
        '+CENG: 5,"0000,00,00,0000,000,00,0000"',
        '+CENG: 5,",,,,,,"',
        '+CENG: 5,""',
        '+CENG: 5,"066',
        "+CENG: 5",
    ],
)
def test_empty_slot_and_stump_are_no_cell(row):
    assert one(row, GSM_HEADER) is None


def test_values_that_stand_for_unknown():
    row = one('+CENG: 0,"1444,999,-81,-55,0,99,65535,268435455,262,03,255"', LTE_HEADER)
    assert (identity_of(row), row.pci, row.rsrq_db, row.sinr_db) == (
        ("262", "03", None, None),
        None,
        None,
        None,
    )
    row = one('+CENG: 0,"0665,35,99,ffff,404,95,fffe"', GSM_HEADER)
    assert (identity_of(row), row.bsic) == (("404", "95", None, None), None)
    assert (
        identity_of(one('+CENG: 0,"1444,207,-81,-55,-9,13,4660,30541322,000,00,255"', LTE_HEADER))
        == NO_IDENTITY
    )
    assert one('+CENG: 1,"1444,91,-999,-60,-16,13"', LTE_HEADER) is None


def test_cut_lte_rows():
    uncut = ("262", "03", 4660, 30541322)
    assert identity_of(one(LTE_SERVING[:-1], LTE_HEADER)) == uncut
    assert identity_of(one(LTE_SERVING.replace(',255"', ""), LTE_HEADER)) == NO_IDENTITY
    short = one(LTE_SERVING[: LTE_SERVING.index(",30541322")], LTE_HEADER)
    assert (identity_of(short), short.rsrp_dbm) == (NO_IDENTITY, -81.0)
    assert one(LTE_NEIGHBOUR[:-1], LTE_HEADER).sinr_db is None
    assert one(LTE_NEIGHBOUR[:-5], LTE_HEADER) is None


def test_rows_run_into_each_other():
    rows = MODEM.read([LTE_HEADER, LTE_SERVING[:-5] + LTE_NEIGHBOUR])
    assert [(row.role, row.rsrp_dbm) for row in rows] == [("serving", -81.0), ("neighbour", -95.0)]
    row = one(GSM_SERVING + '0662,31,08,48aa,404,95,c1c0"', GSM_HEADER)
    assert row is None or identity_of(row) == NO_IDENTITY


def test_no_service():
    assert one("+CENG: 1,1,0,NO SERVICE") == NoCell(status="NO SERVICE")


def test_cpsi_and_the_receiver_are_read_too():
    rows = MODEM.read([CPSI, "+CGNSINF: 0,,,,,,,,,,,,,,,,,,,,"])
    assert [as_json(row)["role"] for row in rows] == ["serving", "gnss"]


# --- conversation


QUIET = [(text, [], "OK") for text in ("AT", "ATE0", "ATV1", "AT+CMEE=1")]


@pytest.mark.parametrize("final", ["OK", "ERROR", "+CME ERROR: 4", None])
def test_setup_with_and_without_engineering_mode(final):
    assert run_exchange(MODEM.setup(), [*QUIET, ("AT+CENG=1,1", [], final)]) is True


def test_setup_of_a_modem_that_is_not_there():
    assert run_exchange(MODEM.setup(), [("AT", [], None)] * AUTOBAUD_TRIES) is False


def test_poll_names_the_serving_cell_once():
    answers = [
        ("AT+CENG?", [LTE_HEADER, LTE_SERVING, LTE_NEIGHBOUR], "OK"),
        ("AT+CPSI?", [CPSI], "OK"),
    ]
    serving, neighbour = run_exchange(MODEM.poll(), answers)
    assert (serving.rsrp_dbm, serving.band, neighbour.pci) == (-81.0, 3, 91)


@pytest.mark.parametrize("ceng", [([], "ERROR"), ([], None), ([], "+CME ERROR: 3")])
def test_poll_with_one_of_the_two_answers(ceng):
    rows = run_exchange(MODEM.poll(), [("AT+CENG?", *ceng), ("AT+CPSI?", [CPSI], "OK")])
    assert [row.cid for row in rows if isinstance(row, CellReading)] == [30541322]
    rows = run_exchange(
        MODEM.poll(), [("AT+CENG?", [LTE_HEADER, LTE_SERVING], None), ("AT+CPSI?", [], None)]
    )
    assert [row.cid for row in rows] == [30541322]


def test_poll_without_an_answer():
    assert run_exchange(MODEM.poll(), [("AT+CENG?", [], None), ("AT+CPSI?", [], None)]) is None
    refused = [("AT+CENG?", [], "ERROR"), ("AT+CPSI?", [], "ERROR")]
    common = [(one.text, [], "ERROR") for one in (*NAMING, *Generic.poll_commands)]
    assert run_exchange(MODEM.poll(), [*refused, *common]) is None


@pytest.mark.parametrize("header", ["+CENG: 0,0", "+CENG: 0,1,0,LTE CAT-M1"])
def test_poll_switches_engineering_mode_on_again(header):
    answers = [("AT+CENG?", [header], "OK"), ("AT+CPSI?", [CPSI], "OK"), ("AT+CENG=1,1", [], "OK")]
    assert [row.cid for row in run_exchange(MODEM.poll(), answers)] == [30541322]


def test_poll_without_service():
    answers = [
        ("AT+CENG?", ["+CENG: 1,1,0,NO SERVICE"], "OK"),
        ("AT+CPSI?", ["+CPSI: NO SERVICE,Online"], "OK"),
    ]
    assert all(isinstance(row, NoCell) for row in run_exchange(MODEM.poll(), answers))


# --- SIM7020

SIM7020 = '3740,1,137,"02D3C4B5",-101,-11,-92,6,20,"4E5F",0,9'
NAME = {
    "AT+COPS?": '+COPS: 0,2,"26202",9\n\nOK',
    "AT+CEREG?": '+CEREG: 2,1,"4E5F","02D3C4B5",9\n\nOK',
}


@pytest.mark.parametrize(("first", "second"), [("", ""), ("0,", "1,")])
def test_cells_of_a_sim7020(first, second):
    ceng = f"+CENG: {first}{SIM7020}\n+CENG: {second}3740,1,138,-108\n\nOK"
    serving, neighbour = poll_on_the_wire(MODEM, {"AT+CENG?": ceng, **NAME})
    assert serving == CellReading(
        "serving",
        "NB-IoT",
        "262",
        "02",
        tac=0x4E5F,
        cid=0x2D3C4B5,
        arfcn=3740,
        band=20,
        pci=137,
        rssi_dbm=-92.0,
        rsrp_dbm=-101.0,
        rsrq_db=-11.0,
    )
    assert (neighbour.role, neighbour.pci, neighbour.rsrp_dbm) == ("neighbour", 138, -108.0)


def test_a_sim7020_that_has_changed_its_cell_meanwhile_has_no_network():
    other = NAME | {"AT+CEREG?": '+CEREG: 2,1,"4E5F","02D3C4B6",9\n\nOK'}
    (serving,) = poll_on_the_wire(MODEM, {"AT+CENG?": f"+CENG: {SIM7020}\n\nOK", **other})
    assert (serving.cid, serving.mcc) == (0x2D3C4B5, None)


@pytest.mark.parametrize("ceng", ["ERROR", "+CENG: 7,8,9\n\nOK"])
def test_a_sim7020_without_such_rows_has_the_cell_of_the_standard_commands(ceng):
    replies = {"AT+CENG?": ceng, "AT+CESQ": "+CESQ: 99,99,255,255,20,60\n\nOK", **NAME}
    serving = poll_on_the_wire(MODEM, replies)[0]
    assert (serving.cell, serving.rsrp_dbm) == (f"262-02-{0x4E5F}-{0x2D3C4B5}", -81.0)


# --- recorded


def test_recorded_replies(corpus):
    found = entries(
        corpus,
        "simcom_sim7000",
        "simcom_cpsi",
        "simcom_boot",
        "simcom_cgnsinf",
        "simcom_csq",
        "simcom_nosim",
    )
    assert len(found) >= 20
    for entry in found:
        check_entry(entry, [as_json(row) for row in MODEM.read(lines_of(corpus, entry))])


@pytest.mark.parametrize(("system", "level_dbm"), [("LTE NB-IOT", -145.0), ("LTE XY", None)])
def test_the_carrier_does_not_stand_for_a_level_below_the_range(system, level_dbm):
    # written after the SIM7000 series manual, with a system whose name is not known
    header = f"+CENG: 1,1,1,{system}"
    row = '+CENG: 0,"3740,60,-145,-120,-20,-9,23070,187214066,460,00,255"'
    assert MODEM.read([header, row])[0].level_dbm == level_dbm
