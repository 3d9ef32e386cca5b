"""SIMCom SIM7000 and SIM7600 on GSM: AT+CENG, AT+CPSI, AT+CCINFO (022, 029, 049)."""

from logger.sim.air import Air, ReceivedCell
from logger.sim.dialects import modes, receivers
from logger.sim.dialects.common import COPS_SCAN_S, EPS, EPS_SETTINGS, SETTINGS
from logger.sim.dialects.dialect import (
    IMEI,
    Answer,
    Dialect,
    Settings,
    block,
    identity_replies,
    setting,
)


def engineering(air: Air, settings: Settings) -> Answer:
    """Rows of seven values for the serving cell and its neighbours; the header counts them."""
    mode, ncell = settings["+CENG"].split(",")
    cells = (air.serving, *air.decoded_neighbours) if air.serving and mode != "0" else ()
    system = "GSM" if air.serving else "NO SERVICE"
    header = f"+CENG: {mode},{ncell},{len(cells)},{system}"
    return [header, *block([f'+CENG: {number},"{_row(one)}"' for number, one in enumerate(cells)])]


def _row(one: ReceivedCell) -> str:
    cell = one.cell
    radio = f"{cell.arfcn:04d},{one.rxlev:02d},{cell.bsic:02d}"
    return f"{radio},{cell.cid:04x},{cell.mcc},{cell.mnc},{cell.lac:04x}"


LTE_ONLY = "38"
"""Value of +CNMP with which the transmitters are reported as LTE cells without neighbours."""
RSSI_OVER_RSRP_DB = 28  # of 10 MHz


def system_information(air: Air, settings: Settings) -> Answer:
    """The serving cell; the area is hexadecimal and the cell decimal."""
    one = air.serving
    if one is None:
        return ["+CPSI: NO SERVICE,Online"]
    cell = one.cell
    if settings["+CNMP"] == LTE_ONLY:
        where = f"{cell.mcc}-{cell.mnc},0x{cell.lac:04X},{cell.cid},{cell.bsic},EUTRAN-BAND3"
        levels = f"-80,{one.dbm * 10},{(one.dbm + RSSI_OVER_RSRP_DB) * 10},12"
        return [f"+CPSI: LTE,Online,{where},{1200 + cell.arfcn},5,5,{levels}"]
    band = "EGSM 900" if cell.arfcn < 512 or cell.arfcn > 885 else "DCS 1800"
    where = f"{cell.mcc}-{cell.mnc},0x{cell.lac:04X},{cell.cid},{cell.arfcn} {band}"
    return [f"+CPSI: GSM,Online,{where},{one.dbm},0,{one.c1}-{one.c2}"]


def cell_information(air: Air, settings: Settings) -> Answer:
    """Serving cell and neighbours with labels, all of it decimal."""
    if air.serving is None or settings["+CNMP"] == LTE_ONLY:
        return []
    serving = f"+CCINFO:[SCELL],{_labels(air.serving)},TA:0,TXPWR:0"
    found = enumerate(air.decoded_neighbours, 1)
    return block([serving, *(f"+CCINFO:[NCell{number}],{_labels(one)}" for number, one in found)])


def _labels(one: ReceivedCell) -> str:
    cell = one.cell
    return (
        f"ARFCN:{cell.arfcn},MCC:{cell.mcc},MNC:{cell.mnc},LAC:{cell.lac},ID:{cell.cid}"
        f",BSIC:{cell.bsic},RXLev:{one.dbm}dbm,C1:{one.c1},C2:{one.c2}"
    )


SIM7000 = Dialect(
    "sim7000",
    identity_replies(
        ["SIM7000E R1351"], "SIMCOM_Ltd", "SIMCOM_SIM7000E", "Revision:1351B03SIM7000E"
    ),
    replies={
        "+CENG?": engineering,
        "+CPSI?": system_information,
        "+CGNSINF": receivers.cgnsinf,
        **EPS,
        **modes.CNMP,
    },
    settings=SETTINGS
    | EPS_SETTINGS
    | receivers.CGNS_SETTINGS
    | modes.CNMP_SETTINGS
    | {"+CENG": setting("0,0", "[0-4](?:,[01])?")},
    takes_s={"+COPS=?": COPS_SCAN_S},
)
SIM7600 = Dialect(
    "sim7600",
    identity_replies(
        [
            "Manufacturer: SIMCOM INCORPORATED",
            "Model: SIMCOM_SIM7600E-H",
            "Revision: SIM7600M22_V2.0",
            f"IMEI: {IMEI}",
            "+GCAP: +CGSM",
        ],
        "SIMCOM INCORPORATED",
        "SIMCOM_SIM7600E-H",
        "+CGMR: LE20B03SIM7600M22",
    ),
    replies={
        "+CPSI?": system_information,
        "+CCINFO": cell_information,
        "+CGPSINFO": receivers.cgpsinfo,
        **EPS,
        **modes.CNMP,
    },
    settings=SETTINGS | EPS_SETTINGS | receivers.CGPS_SETTINGS | modes.CNMP_SETTINGS,
    takes_s={"+COPS=?": COPS_SCAN_S},
    boot=("RDY", "+CPIN: NOT INSERTED", "SMS DONE", "PB DONE"),
)
