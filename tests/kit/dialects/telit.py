"""Telit GE864: #MONI, #SERVINFO, #CSURV, #CSURVC (GM862 manual p273-278, p376-379)."""

import re
from collections.abc import Sequence

from logger.sim.dialects import (
    COPS_SCAN_S,
    NETWORK_NAME,
    NO_SERVICE,
    SETTINGS,
    Answer,
    Dialect,
    Settings,
    block,
    identity_replies,
    setting,
)
from logger.sim.world import NEIGHBOURS, Air, ReceivedCell

SURVEY_S = 60.0  # the manual allows two minutes
SLICE_S = 6.0  # of some of the channels
HEADER = "#MONI: Cell  BSIC  LAC  CellId  ARFCN    Power  C1  C2  TA  RxQual  PLMN"
NO_CELL = "FF FFFF 0000 1024 -111dbm -1 -1"
SUITABLE = "CELL_SUITABLE"
RESELECTION_EXTENT = 3  # of #CSURVEXT; older models end at 2 and print no such values


def bsic_octal(bsic: int) -> str:
    """Network and base station colour code, a digit each."""
    return f"{bsic:02o}"


def monitor(air: Air, settings: Settings) -> Answer:
    """A table of seven cells where that is set, else a line with labels."""
    one = air.serving
    if one is None:
        return NO_SERVICE
    if settings["#MONI"] != "7":
        cell = one.cell
        who_and_where = (
            f"BSIC:{bsic_octal(cell.bsic)} RxQual:0 LAC:{cell.lac:04X} Id:{cell.cid:04X}"
        )
        return [f"#MONI: {NETWORK_NAME} {who_and_where} ARFCN:{cell.arfcn} PWR:{one.dbm}dbm TA:0"]
    rows = [_row(one) for one in air.neighbours]
    rows += [NO_CELL] * (NEIGHBOURS - len(rows))
    serving = f"#MONI: S  {_row(one)} 0 0 {NETWORK_NAME}"
    return block(
        [HEADER, serving, *(f"#MONI: N{number} {row}" for number, row in enumerate(rows, 1))]
    )


def _row(one: ReceivedCell) -> str:
    cell = one.cell
    if not one.is_decoded:
        return f"FF FFFF 0000 {cell.arfcn} {one.dbm}dbm -1 -1"
    identity = f"{bsic_octal(cell.bsic)} {cell.lac:04X} {cell.cid:04X}"
    return f"{identity} {cell.arfcn} {one.dbm}dbm {one.c1} {one.c2}"


def serving_information(air: Air, _: Settings) -> Answer:
    one = air.serving
    if one is None:
        return NO_SERVICE
    cell = one.cell
    network = f'"{NETWORK_NAME}","{cell.mcc}{cell.mnc}"'
    return [
        f"#SERVINFO: {cell.arfcn},{one.dbm},{network},{bsic_octal(cell.bsic)},{cell.lac:04X},0,1"
    ]


def survey(air: Air, settings: Settings) -> Answer:
    """A line with labels for each carrier."""
    chosen = _cells_in_range(air, settings)
    lines = [
        _labels(one, settings) + _lists(one, air, settings) for one in chosen if one.is_decoded
    ]
    return _survey(chosen, lines, "arfcn: {} rxLev: {}")


def numeric_survey(air: Air, settings: Settings) -> Answer:
    """The same as values alone."""
    chosen = _cells_in_range(air, settings)
    lines = [
        f"{one.cell.arfcn},{','.join(_numbers(one, settings))},{SUITABLE}"
        + _without_labels(_lists(one, air, settings))
        for one in chosen
        if one.is_decoded
    ]
    return _survey(chosen, lines, "{},{}")


def _cells_in_range(air: Air, settings: Settings) -> tuple[ReceivedCell, ...]:
    """Cells in the range of channels that the command names, or all."""
    cells = air.others if air.serving is None else (air.serving, *air.others)
    low, _, high = settings["="].partition(",")
    return tuple(one for one in cells if not high or int(low) <= one.cell.arfcn <= int(high))


def _survey(chosen: Sequence[ReceivedCell], lines: list[str], unread: str) -> Answer:
    """Between first and last line; of an undecoded carrier channel and level are printed."""
    others = [unread.format(one.cell.arfcn, one.dbm) for one in chosen if not one.is_decoded]
    return ["Network survey started ...", *block([*lines, *others]), "Network survey ended"]


def _labels(one: ReceivedCell, settings: Settings) -> str:
    bsic, level, errors, mcc, mnc, lac, cid = _numbers(one, settings)
    arfcn = one.cell.arfcn
    return (
        f"arfcn: {arfcn} bsic: {bsic} rxLev: {level} ber: {errors}.00"
        f" mcc: {mcc} mnc: {mnc} lac: {lac} cellId: {cid}"
        f" cellStatus: {SUITABLE}"
    )


def _lists(one: ReceivedCell, air: Air, settings: Settings) -> str:
    """Channels of the cell; by #CSURVEXT those of its neighbours too, and how it is selected."""
    extent, broadcast = int(settings["#CSURVEXT"]), one.cell.broadcast
    if broadcast is None:
        return " numArfcn: 0"
    text = f" numArfcn: 1 arfcn: {one.cell.arfcn}"
    if not extent and one is not air.serving:
        return text
    channels = broadcast.neighbour_arfcns or ()
    text += f" numChannels: {len(channels)}"
    text += f" array: {' '.join(map(str, channels))}" if channels else ""
    if extent < RESELECTION_EXTENT:
        return text
    return (
        f"{text} pbcch: 0 mstxpwr: 5 rxaccmin: 5 croffset: {(broadcast.cro_db or 0) // 2}"
        f" penaltyt: {broadcast.penalty_time or 0} t3212: {broadcast.t3212_raw or 0} CRH: 4"
    )


def _without_labels(text: str) -> str:
    return re.sub(r"\s+[A-Za-z]\w*:\s*", ",", text)


def _numbers(one: ReceivedCell, settings: Settings) -> tuple[str, ...]:
    """Decimal with #CSURVF=0; else hexadecimal, and colour codes octal."""
    cell = one.cell
    decimal = settings["#CSURVF"] == "0"
    bsic = f"{cell.bsic:02d}" if decimal else bsic_octal(cell.bsic)
    lac, cid = (f"{number}" if decimal else f"{number:04X}" for number in (cell.lac, cell.cid))
    return bsic, f"{one.dbm}", "0", cell.mcc, cell.mnc, lac, cid


GE864 = Dialect(
    "ge864",
    identity_replies(["332"], "Telit", "GE864-QUAD-V2", "10.00.144"),
    replies={
        "#MONI": monitor,
        "#SERVINFO": serving_information,
        "#CSURV": survey,
        "#CSURV=": survey,
        "#CSURVC": numeric_survey,
        "#CSURVC=": numeric_survey,
    },
    settings=SETTINGS
    | {
        "#SELINT": setting("0", "[012]"),
        "#MONI": setting("0", "[0-7]"),
        "#CSURVF": setting("0", "[012]"),
        "#CSURVEXT": setting("0", "[0-3]"),
    },
    takes_s={
        "+COPS=?": COPS_SCAN_S,
        **dict.fromkeys(("#CSURV", "#CSURVC"), SURVEY_S),
        **dict.fromkeys(("#CSURV=", "#CSURVC="), SLICE_S),
    },
    boot=(),
)
