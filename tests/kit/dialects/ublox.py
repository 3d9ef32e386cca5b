"""u-blox SARA-G350: AT+CGED, AT+COPS=5, AT+UCELLINFO (UBX-13002752, captures 107-113)."""

from logger.sim.dialects import (
    COPS_SCAN_S,
    NO_SERVICE,
    SETTINGS,
    Answer,
    Dialect,
    Settings,
    identity_replies,
    setting,
)
from logger.sim.world import Air, ReceivedCell

DEEP_SCAN_S = 30.0  # measured; up to three minutes
UNKNOWN = 255


def serving_cell(air: Air, _: Settings) -> Answer:
    return NO_SERVICE if air.serving is None else ['+CGED: RAT:"GSM",', _line(air.serving)]


def all_cells(air: Air, _: Settings) -> Answer:
    """The serving cell first, then its neighbours, without a mark."""
    if air.serving is None:
        return NO_SERVICE
    return ['+CGED: RAT:"GSM",', *(_line(one) for one in (air.serving, *air.decoded_neighbours))]


def deep_scan(air: Air, _: Settings) -> Answer:
    """A line for each cell, without prefix."""
    return [_line(one) for one in air.decoded_cells] or NO_SERVICE


def _line(one: ReceivedCell) -> str:
    cell = one.cell
    network = f"MCC:{cell.mcc}, MNC:{int(cell.mnc):3d}"
    return (
        f"{network}, LAC:{cell.lac:04x}, CI:{cell.cid:04x}, BSIC:{cell.bsic:02x}"
        f", Arfcn:{cell.arfcn:05d}, RXLEV:{one.rxlev:03d}"
    )


def cell_information(air: Air, settings: Settings) -> Answer:
    """Type 0 is the serving cell, 1 a neighbour; numbers are padded with blanks."""
    if air.serving is None:
        return NO_SERVICE
    cells = (air.serving, *air.decoded_neighbours)
    return [
        f"+UCELLINFO: {settings['+UCELLINFO']:>7}, {min(n, 1):5d}, {_columns(one)}"
        for n, one in enumerate(cells)
    ]


def _columns(one: ReceivedCell) -> str:
    cell = one.cell
    identity = f"{int(cell.mcc):4d}, {int(cell.mnc):4d}, {cell.lac:4x}, {cell.cid:4x}"
    return f"{identity}, {one.rxlev:3d}, {UNKNOWN}"


SARA_G350 = Dialect(
    "sara-g350",
    identity_replies(["SARA-G350-02S-01"], "u-blox", "SARA-G350", "08.70"),
    replies={
        "+CGED=3": serving_cell,
        "+CGED=5": all_cells,
        "+COPS=5": deep_scan,
        "+UCELLINFO?": cell_information,
    },
    settings=SETTINGS | {"+UCELLINFO": setting("0", "[01]")},
    takes_s={"+COPS=?": COPS_SCAN_S, "+COPS=5": DEEP_SCAN_S},
    boot=(),
    registered=True,
)
