"""SIMCom SIM800 and SIM808: AT+CENG and AT+CNETSCAN (SIM800 manual V1.09; captures 001 to 018)."""

from dataclasses import replace

from logger.sim.air import Air
from logger.sim.dialects import ceng, receivers
from logger.sim.dialects.common import SETTINGS
from logger.sim.dialects.dialect import (
    NETWORK_NAME,
    NO_SERVICE,
    Answer,
    Dialect,
    Settings,
    block,
    identity_replies,
    setting,
)

NETSCAN_S = 40.0  # up to 45 by the manual, p197


def engineering(air: Air, settings: Settings) -> Answer:
    return [f"+CENG: {settings['+CENG']}", *block(_rows(air, settings))]


def unsolicited(air: Air, settings: Settings) -> Answer:
    return block(_rows(air, settings)) if settings["+CENG"].startswith("2") else []


def _rows(air: Air, settings: Settings) -> list[str]:
    mode, ncell = settings["+CENG"].split(",")
    return ceng.rows(int(mode), int(ncell), air)


def netscan(air: Air, settings: Settings) -> Answer:
    """A line for each cell, without prefix; here the colour codes are hexadecimal."""
    long = settings["+CNETSCAN"] == "1"
    lines = [
        f'Operator:"{NETWORK_NAME}",MCC:{one.cell.mcc},MNC:{one.cell.mnc},Rxlev:{one.rxlev}'
        f",Cellid:{one.cell.cid:04X},Arfcn:{one.cell.arfcn}"
        + (f",Lac:{one.cell.lac:04X},Bsic:{one.cell.bsic:02X}" if long else "")
        for one in air.decoded_cells
    ]
    return block(lines) or NO_SERVICE


def csq(air: Air, _: Settings) -> Answer:
    """By the table of this manual, where 2 is -110 dBm."""
    return [f"+CSQ: {min(max((air.serving.dbm if air.serving else -115) + 114, 0) // 2, 31)},0"]


SIM800 = Dialect(
    "sim800",
    identity_replies(
        ["SIM800 R14.18"], "SIMCOM_Ltd", "SIMCOM_SIM800L", "Revision:1418B05SIM800L24"
    ),
    replies={"+CENG?": engineering, "+CNETSCAN": netscan, "+CSQ": csq},
    settings=SETTINGS
    | {"+CENG": setting("0,0", "[0-4](?:,[01])?"), "+CNETSCAN": setting("0", "[01]")},
    takes_s={"+CNETSCAN": NETSCAN_S},
    unsolicited=unsolicited,
    boot=("RDY", "+CFUN: 1", "+CPIN: NOT INSERTED", "Call Ready", "SMS Ready"),
)
SIM808 = replace(
    SIM800,
    name="sim808",
    identity=identity_replies(
        ["SIM808 R14.18"], "SIMCOM_Ltd", "SIMCOM_SIM808", "Revision:1418B03SIM808M32"
    ),
    replies={**SIM800.replies, "+CGNSINF": receivers.cgnsinf},
    settings={**SIM800.settings, **receivers.CGNS_SETTINGS},
)
