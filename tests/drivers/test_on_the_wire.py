"""Replies as bytes, through redaction and the framer to the driver: variants of firmware."""

from dataclasses import asdict, fields, replace

import pytest

from logger.core.types import CellReading
from logger.drivers.protocols.at import AtFramer, Command, Reply, Unsolicited
from logger.drivers.protocols.redaction import Redactor, redact
from logger.drivers.reading.standard_replies import names_of
from logger.drivers.registry import FAMILIES
from tests.kit.drivers import cells_of, on_the_wire, own_replies, poll_on_the_wire
from tests.kit.nmea_sentences import gga

CPSI_WITH_INDICES = "+CPSI: LTE,Online,262-02,0x333C,39589680,308,EUTRAN-BAND3,1650,5,0,28,50,0,6"


def cells(name, replies):
    rows = poll_on_the_wire(FAMILIES[name], replies)
    return [row for row in rows if isinstance(row, CellReading)]


def test_an_a76xx_has_its_level_of_lte_from_cesq():
    replies = {
        "AT+CPSI?": f"{CPSI_WITH_INDICES}\n\nOK",
        "AT+CESQ": "+CESQ: 38,0,255,255,28,50\n\nOK",
    }
    (serving,) = cells("sim7600", replies)
    assert (serving.cid, serving.rsrp_dbm, serving.rsrq_db) == (39589680, -91.0, -6.0)
    assert serving.rssi_dbm is None, "the level of GSM is that of another cell"


@pytest.mark.parametrize("printed", ["5", "0", "00", "150"])
def test_an_index_that_has_lost_a_digit_is_no_level(printed):
    replies = {
        "AT+CPSI?": f"{CPSI_WITH_INDICES}\n\nOK",
        "AT+CESQ": f"+CESQ: 99,99,255,255,28,{printed}\n\nOK",
    }
    (serving,) = cells("sim7600", replies)
    assert (serving.cid, serving.level_dbm) == (39589680, None)
    damaged = CPSI_WITH_INDICES.replace(",28,50,", ",28,5,")
    replies = {"AT+CPSI?": f"{damaged}\n\nOK", "AT+CESQ": "+CESQ: 99,99,255,255,28,50\n\nOK"}
    assert [one.level_dbm for one in cells("sim7600", replies)] == [None]


def test_cesq_replaces_no_level_of_the_row():
    replies = {
        "AT+CPSI?": "+CPSI: LTE,Online,262-01,0x2D18,28573696,236,EUTRAN-BAND3,1300,5,5,-94,-987,"
        "-663,15\n\nOK",
        "AT+CESQ": "+CESQ: 99,99,255,255,28,50\n\nOK",
    }
    (serving,) = cells("sim7600", replies)
    assert serving.rsrp_dbm == -98.7


SARA_R4 = {
    "AT+COPS?": '+COPS: 0,2,"26202",7\n\nOK',
    "AT+UCGED?": '+RSRP: 135,1300,"-098.00",136,1300,"-105.10",\n'
    '+RSRQ: 135,1300,"-11.50",136,1300,"-15.50",\n\nOK',
    "AT+CEREG?": '+CEREG: 2,1,"1A2B","2D00A0B",7\n\nOK',
    "AT+CESQ": "+CESQ: 99,99,255,255,20,43\n\nOK",
}


def test_a_sara_r4_answers_ucged_with_rows_of_two_other_names():
    serving, neighbour = cells("ublox", SARA_R4)
    assert (serving.cell, serving.pci) == (f"262-02-{0x1A2B}-{0x2D00A0B}", 135)
    assert (serving.rsrp_dbm, serving.rsrq_db) == (-98.0, -11.5)
    assert (neighbour.pci, neighbour.rsrp_dbm, neighbour.cell) == (136, -105.1, None)


def test_a_negative_number_is_no_code_of_a_cell():
    replies = SARA_R4 | {"AT+UCGED?": '+RSRP: -1,1300,"-098.00",136,1300,"-105.10",\n\nOK'}
    assert [one.pci for one in cells("ublox", replies)] == [136]


def test_a_cell_of_another_technology_names_no_cell():
    replies = SARA_R4 | {"AT+CEREG?": "ERROR", "AT+CREG?": '+CREG: 2,1,"1A2B","3C4D",0\n\nOK'}
    assert [one.cid for one in cells("ublox", replies)] == [None, None]


def test_the_heading_of_a_neighbour_is_not_masked():
    """Without it the neighbours of a SARA-G would be serving cells."""
    reply = "+CGED: Service Cell:\n" + "".join(
        f"{heading}MCC:262, MNC:02, LAC:1a2b, CI:3c4{n}, BSIC:18\nArfcn:0007{n}, {label}:034\n"
        for n, heading, label in (
            (1, "", "RxLevServ"),
            (2, "Neighbour Cell 1:\n", "RxLev"),
            (3, "Neighbour Cell 12:\n", "RxLev"),
        )
    )
    found = cells("ublox", {"AT+CGED=5": f"{reply}OK"})
    assert [(one.role, one.cid) for one in found] == [
        ("serving", 0x3C41),
        ("neighbour", 0x3C42),
        ("neighbour", 0x3C43),
    ]


@pytest.mark.parametrize("act", [7, 8])
def test_a_sara_r4_that_says_lte_m_is_named_too(act):
    replies = SARA_R4 | {"AT+CEREG?": f'+CEREG: 2,1,"1A2B","2D00A0B",{act}\n\nOK'}
    assert cells("ublox", replies)[0].cell == f"262-02-{0x1A2B}-{0x2D00A0B}"


def test_a_report_behind_the_head_of_ucged_costs_no_cell():
    reply = "+UCGED: 2\n{}6,4,262,02\n1300,3,25,50,1a2b,2d00a0b,135,a1b2c3d4,40,20,46,255,255\n\nOK"
    plain = cells("ublox", {"AT+UCGED?": reply.format("")})
    assert [one.cid for one in plain] == [0x2D00A0B]
    assert cells("ublox", {"AT+UCGED?": reply.format("\n+CREG: 1\n\n")}) == plain


def test_a_report_behind_a_heading_costs_no_neighbour():
    reply = "^SMONP:\n2G:\n{}653,22,-88,262,02,1,3,17,17,0143,83BB,-,-\n\nOK"
    plain = cells("cinterion", {"AT^SMONP=255": reply.format("")})
    assert [one.cid for one in plain] == [0x83BB]
    assert cells("cinterion", {"AT^SMONP=255": reply.format("\n+CREG: 1\n\n")}) == plain


def test_a_report_without_a_colon_is_no_line_of_a_reply():
    reply = "+GTCCINFO:\nLTE service cell:\n{}1,4,262,02,1A2B,2D00A0B,514,87,3,100,46,42,42,26\nOK"
    plain = cells("fibocom", {"AT+GTCCINFO?": reply.format("")})
    assert [one.cid for one in plain] == [0x2D00A0B]
    for report in ("+PBREADY", "+SIM READY", "*EMRDY"):
        assert cells("fibocom", {"AT+GTCCINFO?": reply.format(f"\n{report}\n\n")}) == plain


def test_a_cut_header_makes_no_second_cell():
    """The report takes the technology from the header; CPSI has the same cell with it."""
    row = '+CENG: 0,"1550,339,-73,-47,-12,17,102,30361701,284,05,255"'
    cpsi = (
        "+CPSI: LTE CAT-M1,Online,284-05,0x0066,30361701,339,EUTRAN-BAND3,1550,3,3,-12,-73,-47,17"
    )
    replies = {
        "AT+CENG?": f"+CENG: 1,1,1,LTE CAT-M1\n\n+CREG: 1\n\n{row}\n\nOK",
        "AT+CPSI?": f"{cpsi}\n\nOK",
    }
    (serving,) = cells("sim7000", replies)
    assert (serving.rat, serving.cid, serving.identity_unsure) == ("LTE-M", 30361701, False)


def test_a_scrambling_code_of_a_survey_is_not_masked():
    row = (
        "uarfcn: 10638 rxLev: -70 mcc: 262 mnc: 02 scr code: 279 cellId: 47188491 lac: 12345"
        " cellStatus: CELL_SUITABLE rscp: -84 ecio: -6.5"
    )
    lines = f"Network survey started ...\r\n{row}\r\nNetwork survey ended\r\n"
    assert redact(lines.encode(), "AT#CSURV=0,62").decode() == lines


GSM_STATUS = """!GSTATUS:
System mode:   GSM        \tPS state:    Attached
GSM band:      {}
GSM channel:   72
RX level (dBm): -71
OK"""


@pytest.mark.parametrize(("printed", "band"), [("GSM900", "GSM900"), ("SOMEBAND", None)])
def test_a_masked_band_is_unknown(printed, band):
    (serving,) = cells("sierra", {"AT!GSTATUS?": GSM_STATUS.format(printed)})
    assert (serving.arfcn, serving.rssi_dbm, serving.band) == (72, -71.0, band)


@pytest.mark.parametrize(("cell", "is_sure"), [("10A000001", True), ("A000001C", False)])
def test_a_cell_of_nr_is_read_although_its_decimal_number_is_masked(cell, is_sure):
    status = f"""!GSTATUS:
System mode:   NR5G       \tPS state:    Attached
NR5G band:     n78
NR5G Rx chan:  627264\t\tNR5G Tx chan: 627264
NR5G RSRP (dBm):  -95\tNR5G RSRQ (dB):  -11
Tx Power:      -- \t\tTAC:         1A2B (6699)
Cell ID:     {cell} ({int(cell, 16)})
OK"""
    network = '+COPS: 0,2,"26202",11\n\nOK'
    (serving,) = cells("sierra", {"AT+COPS?": network, "AT!GSTATUS?": status})
    assert (serving.mcc, serving.tac, serving.cid) == ("262", 0x1A2B, int(cell, 16))
    assert serving.identity_unsure is not is_sure


LTE_ROW = '+QENG: "servingcell","NOCONN","LTE","FDD",262,01,1A2D001,212,1300,3,5,5,1B2C,-97,-8,-7'


def test_a_row_in_small_letters_is_read_too():
    # written from the EC2x manual 6.17
    command = 'AT+QENG="servingcell"'
    (small,) = cells("quectel", {command: f"{LTE_ROW.lower()}\n\nOK"})
    (large,) = cells("quectel", {command: f"{LTE_ROW}\n\nOK"})
    assert small.cell == large.cell == f"262-01-{0x1B2C}-{0x1A2D001}"
    assert small.rsrp_dbm == large.rsrp_dbm == -97.0


@pytest.mark.parametrize("blank", ["", " "])
def test_a_padded_cell_of_nr_is_read_with_blanks_between_the_values_too(blank):
    # written from the FM160 manual 9.1.15; an FM350 pads the cell
    row = "1,9,262,01,A0C100,06CE5C2002,627264,385,5078,100,60,80,80,65".replace(",", f",{blank}")
    (serving,) = cells("fibocom", {"AT+GTCCINFO?": f"+GTCCINFO:\n{row}\n\nOK"})
    assert (serving.cid, serving.tac, serving.arfcn) == (0x6CE5C2002, 0xA0C100, 627264)


def test_a_cell_of_nr_is_read_with_blanks_between_the_values_too():
    row = "NR5G_SA, Online, 262-01, 0xA0C100, 29231947778, 385, NR5G_BAND78, 627264, -880, -110, 24"
    (serving,) = cells("sim7600", {"AT+CPSI?": f"+CPSI: {row}\n\nOK"})
    assert (serving.cid, serving.rsrp_dbm) == (29231947778, -88.0)


def test_a_channel_without_a_cell_has_no_code():
    heading = "InterFreq: EARFCN ThresholdLow ThresholdHi Priority PCI  RSRQ   RSRP   RSSI RXLV"
    rows = (
        "             6300            0           0        0  77 -15.0 -101.0  -72.0   0",
        "             3050            0           0        0   0   0.0    0.0    0.0   0",
    )
    reply = "\n".join(("!LTEINFO:", heading, *rows, "", "OK"))
    assert [one.pci for one in cells("sierra", {"AT!LTEINFO?": reply})] == [77]


def test_a_channel_of_3g_without_a_cell_is_none():
    heading = "WCDMA:     UARFCN ThreshL ThreshH Prio PSC   RSCP   ECN0 RXLV"
    rows = (
        "            10737       0       0    0   0    0.0    0.0    0",
        "            10713       0       0    0   0  -94.0   -7.5   20",
    )
    reply = "\n".join(("!LTEINFO:", heading, *rows, "", "OK"))
    assert [(one.arfcn, one.psc) for one in cells("sierra", {"AT!LTEINFO?": reply})] == [(10713, 0)]


@pytest.mark.parametrize("banner", ["^SYSSTART", "^SYSSTART AIRPLANE MODE"])
def test_a_start_in_any_mode_is_a_restart(banner):
    assert FAMILIES["cinterion"].is_restart(banner)


@pytest.mark.parametrize(
    ("name", "command", "rows"),
    [
        (
            "sim800",
            "AT+CENG?",
            '+CENG: 1,1\n\n+CENG: 0,"0082,41,99,240,08,09,48fa,05,05,0fb3,255"\n',
        ),
        (
            "quectel_gsm",
            "AT+QENG?",
            "+QENG: 1,4\n\n+QENG: 0,262,02,1b2c,4d5e,72,11,-70,33,33,5,0,x,x,x,x,x,x,x\n",
        ),
    ],
)
def test_a_caller_who_hangs_up_refuses_no_command(name, command, rows):
    """What came before is read; to a GSM modem AT+QENG=0 would mean: engineering mode off."""
    asked = {command: rows + "\nNO CARRIER", "AT+QENG=0": None}
    assert len(cells(name, asked)) == 1


def _command_of(driver, reply):
    # rows without a name answer any command that has such rows
    names = names_of(reply.partition(":")[0]) or frozenset(driver.unnamed_rows)
    return next((text for text in driver.sends() if names_of(text) & names), None)


def _is_part(reading, whole):
    names = {field.name for field in fields(CellReading)} - {"more", "broadcast", "identity_unsure"}
    return all(getattr(reading, name) in {None, getattr(whole, name)} for name in names)


@pytest.mark.parametrize("report", ["RING", '+CREG: 5,"1A2B","3C4D"', "NO CARRIER"])
@pytest.mark.parametrize("name", FAMILIES)
def test_a_report_within_a_row_makes_no_other_values(name, report):
    driver = FAMILIES[name]

    def read(text):
        rows = on_the_wire(driver, driver.ask([Command(command)]), {command: f"{text}\n\nOK"})
        return [row for row in rows or () if isinstance(row, CellReading)]

    for reply in own_replies(name):
        if command := _command_of(driver, reply):
            whole = cells_of(driver, reply.split("\n"))
            for at in range(1, len(reply)):
                text = f"{reply[:at]}\n{report}\n{reply[at:]}"
                for reading in read(text):
                    assert any(_is_part(reading, one) for one in whole), text


BLANKS_BETWEEN_VALUES = [
    ("fibocom", "AT+GTCCINFO?", "+GTCCINFO:\n1,4,262,02,1A2B,2D00A0B,514,87,3,100,46,42,42,26"),
    ("sim7000", "AT+CENG?", '+CENG: 3740,1,137,"02D3C4B5",-101,-11,-92,6,20,"4E5F",0,9'),
    ("sim7000", "AT+CENG?", "+CENG: 3740,1,138,-108"),
    ("ublox", "AT+UCGED?", '+RSRP: 135,1300,"-098.00",136,1300,"-105.10",'),
    ("cinterion", "AT^SMONP=255", "^SMONP:\n2G:\n653,22,-88,262,02,1,3,17,17,0143,83BB,-,-"),
    ("telit", "AT#CSURV=0,62", "Network survey started ...\n62,-77\nNetwork survey ended"),
]


@pytest.mark.parametrize("blanks", [", ", " ,"])
@pytest.mark.parametrize(("name", "command", "rows"), BLANKS_BETWEEN_VALUES)
def test_blanks_between_values_cost_no_row(name, command, rows, blanks):
    def read(text):
        data = f"\n{text}\n\nOK\n".replace("\n", "\r\n").encode()
        return read_on_the_wire(FAMILIES[name], command, data)

    assert read(rows)
    assert read(rows.replace(",", blanks)) == read(rows)


# --- the standard replies


def test_of_lte_the_area_of_creg_is_a_tracking_area():
    replies = {
        "AT+COPS?": '+COPS: 0,2,"26202",7\n\nOK',
        "AT+CREG?": '+CREG: 2,1,"1A2B","02D00A0B",7\n\nOK',
        "AT+CSQ": "+CSQ: 99,99\n\nOK",
        "AT+CESQ": "+CESQ: 38,0,255,255,20,50\n\nOK",
    }
    (serving,) = cells("generic", replies)
    assert (serving.lac, serving.tac) == (None, 0x1A2B)
    assert (serving.rsrp_dbm, serving.rssi_dbm) == (-91.0, None)


def test_an_answer_is_newer_than_a_report_and_names_the_technology():
    replies = {
        "AT+CREG?": '+CREG: 1,"0FB3","48FA"\n\n+CREG: 2,1,"1A2B","3C4D"\n\nOK',
        "AT+CGREG?": '+CGREG: 2,1,"1A2B","3C4D",0\n\nOK',
    }
    (serving,) = cells("generic", replies)
    assert (serving.lac, serving.cid, serving.rat) == (0x1A2B, 0x3C4D, "GSM")


@pytest.mark.parametrize("network", ['0,2,"26202"', '0,2,"26202F"', "0,2,26202", "0,2,26202,0"])
def test_the_number_of_a_network_with_and_without_marks(network):
    replies = {
        "AT+COPS?": f"+COPS: {network}\n\nOK",
        "AT+CREG?": '+CREG: 2,1,"1A2B","3C4D"\n\nOK',
    }
    assert [one.cell for one in cells("generic", replies)] == [f"262-02-{0x1A2B}-{0x3C4D}"]


def test_the_network_in_use_has_the_technology_where_creg_has_none():
    """As an E173 prints it, which has no level but that of +CSQ."""
    replies = {
        "AT+COPS?": '+COPS: 0,2,"26202",2\n\nOK',
        "AT+CREG?": "+CREG: 2,1,1A2B,2D00A0B\n\nOK",
        "AT+CSQ": "+CSQ: 20,99\n\nOK",
    }
    (serving,) = cells("huawei", replies)
    assert (serving.rat, serving.lac, serving.cid, serving.rssi_dbm) == (
        "WCDMA",
        0x1A2B,
        0x2D00A0B,
        -73.0,
    )


def test_cesq_gives_the_quality_of_a_cell_of_3g_too():
    replies = {
        "AT+COPS?": '+COPS: 0,2,"26202",2\n\nOK',
        "AT+CREG?": '+CREG: 2,1,"1A2B","00B5EEFF",2\n\nOK',
        "AT+CESQ": "+CESQ: 99,99,27,34,255,255\n\nOK",
    }
    (serving,) = cells("generic", replies)
    assert (serving.rscp_dbm, serving.ecio_db) == (-94.0, -7.5)


@pytest.mark.parametrize("report", ["", "\n\n+CTZV: +32", "\n\nRING"])
def test_a_report_behind_csq_costs_no_level(report):
    replies = {
        "AT+CREG?": '+CREG: 2,1,"1A2B","3C4D",0\n\nOK',
        "AT+CSQ": f"+CSQ: 20,0{report}\n\nOK",
    }
    assert [one.rssi_dbm for one in cells("generic", replies)] == [-73.0]
    replies["AT+CSQ"] = "+CSQ: 2\n\nRING\n\nOK"
    assert [one.rssi_dbm for one in cells("generic", replies)] == [None]


@pytest.mark.parametrize("plmn", ["2620X", "262", "000000"])
def test_what_is_no_number_of_a_network_names_none(plmn):
    replies = {
        "AT+COPS?": f'+COPS: 0,2,"{plmn}",0\n\nOK',
        "AT+CREG?": '+CREG: 2,1,"1A2B","3C4D"\n\nOK',
    }
    assert [(one.mcc, one.mnc) for one in cells("generic", replies)] == [(None, None)]


@pytest.mark.parametrize("words", ["COMMAND NOT SUPPORT", "TOO MANY PARAMETERS", "ABORTED"])
def test_refusals_in_words_of_a_maker_end_a_reply(words):
    framer = AtFramer()
    framer.send("AT^MONSC")
    assert list(framer.feed(redact(f"\r\n{words}\r\n".encode(), "AT^MONSC"))) == [
        Reply("AT^MONSC", (), "ERROR")
    ]
    assert list(framer.feed(b"\r\nRING\r\n")) == [Unsolicited("RING")]


SENTENCE = gga().encode()


def read_on_the_wire(driver, command, data):
    framer, redactor = AtFramer(), Redactor()
    framer.send(command, rows=driver.other_rows)
    redactor.send(command.encode())
    events = list(framer.feed(redactor.feed(data)))
    replies = [event for event in events if isinstance(event, Reply)]
    reply = replies[0] if replies else framer.expire()
    return cells_of(driver, [command, *reply.marked_lines])


def values_of(cell):
    known = asdict(replace(cell, more={}, broadcast=None, identity_unsure=False))
    return {name: value for name, value in known.items() if value not in (None, {}, False)}


@pytest.mark.parametrize(
    "inserted",
    [
        SENTENCE,
        SENTENCE + b"\r\n",
        b"\r\n" + SENTENCE + b"\r\n",
        SENTENCE.replace(b"N", b"S"),
        SENTENCE[:25] + b"\r\n",
        b"\r\nRING\r\n",
    ],
    ids=["sentence", "and its end", "between line ends", "damaged", "cut", "call"],
)
@pytest.mark.parametrize("name", FAMILIES)
def test_what_interrupts_a_row_changes_no_value(name, inserted):
    driver = FAMILIES[name]
    n_places = n_whole = 0
    for reply in own_replies(name):
        data = f"\n{reply}\n\nOK\n".replace("\n", "\r\n").encode("latin-1")
        command = max(driver.sends(), key=lambda one: len(read_on_the_wire(driver, one, data)))
        whole = [values_of(cell) for cell in read_on_the_wire(driver, command, data)]
        for at in range(2, len(data) - 6, 3):
            torn = data[:at] + inserted + data[at:]
            found = [values_of(cell) for cell in read_on_the_wire(driver, command, torn)]
            n_places += 1
            n_whole += found == whole
            assert all(any(one.items() <= cell.items() for cell in whole) for one in found), torn
    if SENTENCE in inserted and not inserted.startswith(b"\r\n"):
        assert n_whole >= 0.75 * n_places


def test_a_report_between_the_rows_of_a_scan_costs_none_of_them():
    """It may have cut the last value of the row before, which is left out with no more."""
    rows = [
        f'Operator:"Example",MCC:262,MNC:02,Rxlev:38,Cellid:5E6{n},Arfcn:6{n},Lac:3C4D,Bsic:25\r\n'
        for n in (1, 2)
    ]
    data = "\r\n+CREG: 5\r\n".join(rows) + "\r\nOK\r\n"
    found = read_on_the_wire(FAMILIES["sim800"], "AT+CNETSCAN", data.encode())
    assert [(cell.cid, cell.arfcn, cell.bsic) for cell in found] == [
        (0x5E61, 61, None),
        (0x5E62, 62, 0x25),
    ]
