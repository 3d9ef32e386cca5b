"""SIMCom SIM808, a SIM800 with a receiver, and SIM7000 on GSM (022, 049)."""

from dataclasses import replace

from logger.sim.dialects import (
    CNMP,
    CNMP_SETTINGS,
    COPS_SCAN_S,
    EPS,
    EPS_SETTINGS,
    SETTINGS,
    SIM800,
    Answer,
    Dialect,
    Settings,
    block,
    identity_replies,
    setting,
    system_information,
)
from logger.sim.world import Air, ReceivedCell
from tests.kit.dialects import receivers


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


SIM808 = replace(
    SIM800,
    name="sim808",
    identity=identity_replies(
        ["SIM808 R14.18"], "SIMCOM_Ltd", "SIMCOM_SIM808", "Revision:1418B03SIM808M32"
    ),
    replies={**SIM800.replies, "+CGNSINF": receivers.cgnsinf},
    settings={**SIM800.settings, **receivers.CGNS_SETTINGS},
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
        **CNMP,
    },
    settings=SETTINGS
    | EPS_SETTINGS
    | receivers.CGNS_SETTINGS
    | CNMP_SETTINGS
    | {"+CENG": setting("0,0", "[0-4](?:,[01])?")},
    takes_s={"+COPS=?": COPS_SCAN_S},
)
