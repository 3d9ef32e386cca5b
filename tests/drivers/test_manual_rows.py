# Written from the layouts that firmware_notes takes from the manuals, with values of our own:
# variants that no capture has.

import pytest

from logger.core.types import CellReading
from logger.drivers.registry import FAMILIES
from tests.kit.drivers import poll_on_the_wire

SERVING, NEIGHBOUR = "serving", "neighbour"
FULL = f"262-02-{0x1A2B}-{0x1A2D001}"
GSM_CELL = f"262-02-{0x1A2B}-{0x3C4D}"
NR_CELL = f"262-02-{0xA0C100}-{0x6CE5C2002}"

# family, manual, commands with replies, what is right: role, technology, cell, channel, code, level
MANUALS = [
    (
        "quectel", "RG50x and RM5xx: EN-DC whose NR carrier has no level",
        {'AT+QENG="servingcell"': '+QENG: "servingcell","CONNECT"\n+QENG: "LTE","FDD",262,02,'
         '1A2D001,212,1300,3,5,5,1A2B,-97,-8,-70,14,9,230,-\n'
         '+QENG: "NR5G-NSA",262,02,60,-,-,-,630000,78'},
        [(SERVING, "LTE", FULL, 1300, 212, -97.0), (SERVING, "NR", None, 630000, 60, None)],
    ),
    (
        "quectel", "EC2x manual 6.17: limited service, nothing decoded",
        {'AT+QENG="servingcell"': '+QENG: "servingcell","LIMSRV","GSM",262,02,FFFE,FFFF,18,73,-,'
         '-71,255,255,0,39,39,1,-,-,-,-,-,-,-,-,-,"-"'},
        [(SERVING, "GSM", None, 73, 18, -71.0)],
    ),
    (
        "quectel", "EC2x manual 6.17: camped on WCDMA",
        {'AT+QENG="neighbourcell"': '+QENG: "neighbourcell","WCDMA",10663,5,37,-1010,-120,1,5,10\n'
         '+QENG: "neighbourcell","LTE",1300,212,-97,-8,20',
         'AT+QENG="servingcell"': '+QENG: "servingcell","SEARCH"'},
        [(NEIGHBOUR, "WCDMA", None, 10663, 37, -101.0),
         (NEIGHBOUR, "LTE", None, 1300, 212, -97.0)],
    ),
    (
        "quectel_gsm", "BC26 manual 4.8: levels not measured",
        {"AT+QENG?": "ERROR", "AT+QENG=0": '+QENG: 0,3740,,137,"01A2D001",,,,,20,"1A2B",0,9,3',
         "AT+COPS?": '+COPS: 0,2,"26202",9', "AT+CEREG?": '+CEREG: 2,1,"1A2B","01A2D001",9'},
        [(SERVING, "NB-IoT", FULL, 3740, 137, None)],
    ),
    (
        "sim7600", "SIM7500 SIM7600 manual: C1 and C2 below 0, GSM at the limit",
        {"AT+CPSI?": "+CPSI: GSM,Online,262-02,0x1A2B,15437,73 EGSM 900,-104,2110,-3--5"},
        [(SERVING, "GSM", GSM_CELL, 73, None, -104.0)],
    ),
    (
        "sim7600", "SIM82xx: LTE with NR beside it",
        {"AT+CPSI?": "+CPSI: LTE,Online,262-02,0x1A2B,27447297,212,EUTRAN-BAND3,1300,5,5,-80,-970,"
         "-700,15\n+CPSI: NR5G_NSA,644,NR5G_BAND78,630000,-960,-120,95"},
        [(SERVING, "LTE", FULL, 1300, 212, -97.0), (SERVING, "NR", None, 630000, 644, -96.0)],
    ),
    (
        "sim7000", "SIM7000 series: a neighbour without values",
        {"AT+CENG?": '+CENG: 1,1,2,LTE CAT-M1\n\n+CENG: 0,"1300,212,-97,-70,-8,14,6699,27447297,'
         '262,02,255"\n+CENG: 1,"0,0,0,0,0,0"'},
        [(SERVING, "LTE-M", FULL, 1300, 212, -97.0)],
    ),
    (
        "sim800", "SIM800 manual V1.09: PCS channel, undecoded and empty neighbours",
        {"AT+CENG?": '+CENG: 1,1\n\n+CENG: 0,"0073,45,00,262,02,37,3c4d,05,00,1a2b,255"\n'
         '+CENG: 1,"0975,24,63,ffff,,,0000"\n+CENG: 2,"0000,00,00,0000,000,00,0000"'},
        [(SERVING, "GSM", GSM_CELL, 73, 37, -68.0), (NEIGHBOUR, "GSM", None, 975, 63, -89.0)],
    ),
    (
        "telit", "LE910 V2 manual: network code and PCI in the row",
        {"AT#MONI": "#MONI: Cc:262 Nc:02 RSRP:-97 RSRQ:-8 TAC:1A2B Id:1A2D001 EARFCN:1300"
         " PWR:-69dbm DRX:128 pci:212 QRxLevMin:-128"},
        [(SERVING, "LTE", FULL, 1300, 212, -97.0)],
    ),
    (
        "ublox", "ubxlib: +UCGED of LTE with neighbours behind, of no documented layout",
        {"AT+UCGED?": "+UCGED: 2\n4,0,262,02\n1300,3,50,50,1a2b,1a2d001,212,a1b2c3d4,8001,01,44,24,"
         "11.25,2,1,8,20,-40,-4,0,255,255,0\n2\n1300,213,40,15\n1300,214,30,12"},
        [(SERVING, "LTE", FULL, 1300, 212, -97.0)],
    ),
    (
        "cinterion", "EHS6 manual: hopping in a call",
        {"AT^SMONI": "^SMONI: 2G,73,-80,262,02,1A2B,3C4D,35,35,4,5,G,h,4,3,-80,0,S_FR"},
        [(SERVING, "GSM", GSM_CELL, 73, 37, -80.0)],
    ),
    (
        "sierra", "public logs of EM75xx: inactive carriers beside the cell",
        {"AT!GSTATUS?": "!GSTATUS: \nSystem mode:   LTE              PS state:    Attached\n"
         "LTE band:      B3               LTE bw:      20 MHz\n"
         "LTE Rx chan:   1300             LTE Tx chan: 19300\n"
         "LTE SSC1 state:INACTIVE         LTE SSC1 band: B7\n"
         "LTE SSC1 bw:   20 MHz           LTE SSC1 chan: 3150\n"
         "PCC RxM RSSI:  -62              PCC RxM RSRP:  -97\n"
         "PCC RxD RSSI:  -65              PCC RxD RSRP:  -99\n"
         "SCC1 RxM RSSI: -67              SCC1 RxM RSRP: -90\n"
         "Tx Power:      --               TAC:         1A2B (6699)\n"
         "RSRQ (dB):     -12.2            Cell ID:     01A2D001 (27447297)",
         "AT+COPS?": '+COPS: 0,2,"26202",7'},
        [(SERVING, "LTE", FULL, 1300, None, -97.0)],
    ),
    (
        "huawei", "HiSilicon format strings: NR with its area, no neighbours",
        {"AT^MONSC": "^MONSC: NR,262,02,630000,1,6CE5C2002,181,A0C100,-88,-11,24",
         "AT^MONNC": "^MONNC: NONE"},
        [(SERVING, "NR", NR_CELL, 630000, 385, -88.0)],
    ),
    (
        "fibocom", "FM160 manual 9.1.15: NR alone, a neighbour without a name",
        {"AT+GTCCINFO?": "+GTCCINFO:\nNR service cell:\n"
         "1,9,262,02,A0C100,6CE5C2002,99CF0,181,5078,100,60,80,80,65\nNR neighbor cell:\n"
         "2,9,,,,,99CF0,182,60,70,70,65"},
        [(SERVING, "NR", NR_CELL, 630000, 385, -77.0),
         (NEIGHBOUR, "NR", None, 630000, 386, -87.0)],
    ),
    (
        "generic", "3GPP TS 27.007 7.2: area FFFE of +CREG on LTE, cell of eight digits",
        {"AT+COPS?": '+COPS: 0,2,"26202",7', "AT+CREG?": '+CREG: 2,1,"FFFE","1A2D001",7',
         "AT+CEREG?": '+CEREG: 2,1,"1A2B","01A2D001",7', "AT+CESQ": "+CESQ: 99,99,255,255,24,44"},
        [(SERVING, "LTE", FULL, None, None, -97.0)],
    ),
]  # fmt: skip


def read(family, replies):
    rows = poll_on_the_wire(
        FAMILIES[family],
        {
            command: reply if reply == "ERROR" else f"{reply}\n\nOK"
            for command, reply in replies.items()
        },
    )
    return [
        (one.role, one.rat, one.cell, one.arfcn, code_of(one), one.level_dbm)
        for one in rows
        if isinstance(one, CellReading)
    ]


def code_of(reading):
    return next(
        (code for code in (reading.bsic, reading.psc, reading.pci) if code is not None), None
    )


@pytest.mark.parametrize(("family", "manual", "replies", "right"), MANUALS)
def test_a_reply_as_the_manual_has_it(family, manual, replies, right):
    assert read(family, replies) == right, manual


@pytest.mark.parametrize(("family", "manual", "replies", "right"), MANUALS)
def test_blanks_and_line_ends_change_nothing(family, manual, replies, right):
    spaced = {command: reply.replace(",", ", ") for command, reply in replies.items()}
    doubled = {command: reply.replace("\n", "\n\n") for command, reply in replies.items()}
    assert read(family, spaced) == read(family, doubled) == right, manual
