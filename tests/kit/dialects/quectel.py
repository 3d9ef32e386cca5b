"""Quectel EC25 and M95 on a GSM network: the two forms of AT+QENG, and AT+QOPS.

Sources: captures 059 to 069, 088; 091, 092; the example of QOPS in the EC2x AT Commands Manual.
"""

from logger.sim.dialects import (
    COPS_SCAN_S,
    EPS,
    EPS_SETTINGS,
    NETWORK_NAME,
    SETTINGS,
    Answer,
    Dialect,
    Settings,
    block,
    identity_replies,
    setting,
)
from logger.sim.world import Air, ReceivedCell
from tests.kit.dialects import modes, receivers

QOPS_S = 12.0  # documented nowhere
QOPS_SETTINGS = {"+QOPSCFG": setting('"SCANCONTROL",0', '"SCANCONTROL",[0-2]')}
STATE = "LIMSRV"  # without a SIM card


def serving_cell(air: Air, _: Settings) -> Answer:
    """Area and cell are hexadecimal without zeros to the left; what only a call has is a hyphen."""
    one = air.serving
    if one is None:
        return ['+QENG: "servingcell","SEARCH"']
    cell = one.cell
    where = f"{cell.mcc},{cell.mnc},{cell.lac:X},{cell.cid:X},{cell.bsic},{cell.arfcn},-,{one.dbm}"
    return [
        f'+QENG: "servingcell","{STATE}","GSM",{where},255,255,0,{one.c1},{one.c2},1,{"-," * 9}"-"'
    ]


def neighbour_cells(air: Air, _: Settings) -> Answer:
    return block([_neighbour(one) for one in air.decoded_neighbours])


def _neighbour(one: ReceivedCell) -> str:
    cell = one.cell
    where = f"{cell.mcc},{cell.mnc},{cell.lac:X},{cell.cid:X},{cell.bsic},{cell.arfcn}"
    return f'+QENG: "neighbourcell","GSM",{where},{one.dbm},{one.c1},{one.c2},0,0'


def quality(air: Air, _: Settings) -> Answer:
    return ['+QCSQ: "NOSERVICE"' if air.serving is None else f'+QCSQ: "GSM",{air.serving.dbm}']


def survey(air: Air, settings: Settings) -> Answer:
    """All cells of the chosen technology, 2G here, below their network; levels are indices."""
    if not settings["+QOPSCFG"].endswith("0") or air.serving is None:
        return []
    first = air.serving.cell
    rows = [
        f'{number},"2G",{one.cell.arfcn},{one.cell.lac:X},{one.cell.cid:X},{one.cell.bsic},'
        f"{one.rxlev},{one.c1},0,1"
        for number, one in enumerate(air.decoded_cells, 1)
    ]
    return block([f'+QOPS: "{NETWORK_NAME}","{NETWORK_NAME}","{first.mcc}{first.mnc}"', *rows])


def engineering(air: Air, settings: Settings) -> Answer:
    """The header; a row with the serving cell; one row with all neighbours, ten values each."""
    mode, dump = settings["+QENG"].split(",")
    header = f"+QENG: {mode},{dump}"
    if mode == "0" or air.serving is None:
        return [header]
    rows = [_serving_row(air.serving)]
    if dump != "0" and (near := air.decoded_neighbours):
        rows.append(
            "+QENG: 1," + ",".join(f"{number},{_near(one)}" for number, one in enumerate(near, 1))
        )
    return [header, *block(rows)]


def _serving_row(one: ReceivedCell) -> str:
    cell = one.cell
    who_and_where = f"{cell.mcc},{cell.mnc},{cell.lac:04x},{cell.cid:04x},{cell.arfcn},{cell.bsic}"
    return f"+QENG: 0,{who_and_where},{one.dbm},{one.c1},{one.c2},5,5" + ",x" * 7


def _near(one: ReceivedCell) -> str:
    cell = one.cell
    identity = f"{cell.mcc},{cell.mnc},{cell.lac:04x},{cell.cid:04x}"
    return f"{cell.arfcn},{one.dbm},{cell.bsic},{one.c1},{one.c2},{identity}"


EC25 = Dialect(
    "ec25",
    identity_replies(
        ["Quectel", "EC25", "Revision: EC25EFAR06A03M4G"], "Quectel", "EC25", "EC25EFAR06A03M4G"
    ),
    replies={
        '+QENG="SERVINGCELL"': serving_cell,
        '+QENG="NEIGHBOURCELL"': neighbour_cells,
        "+QCSQ": quality,
        "+QOPS": survey,
        "+QGPSLOC=2": receivers.qgpsloc,
        **EPS,
        **modes.NWSCANMODE,
    },
    settings=SETTINGS
    | EPS_SETTINGS
    | receivers.QGPS_SETTINGS
    | QOPS_SETTINGS
    | modes.NWSCANMODE_SETTINGS,
    takes_s={"+COPS=?": COPS_SCAN_S, "+QOPS": QOPS_S},
    boot=("RDY", "+CFUN: 1", "+QIND: SMS DONE"),
)
M95 = Dialect(
    "m95",
    identity_replies(
        ["Quectel_Ltd", "Quectel_M95", "Revision: M95FAR02A08"],
        "Quectel_Ltd",
        "Quectel_M95",
        "Revision: M95FAR02A08",
    ),
    replies={"+QENG?": engineering},
    settings=SETTINGS | {"+QENG": setting("0,0", "[0-2](?:,[0-4])?")},
    takes_s={"+COPS=?": COPS_SCAN_S},
    boot=("RDY", "+CFUN: 1", "+CPIN: NOT INSERTED"),
)
