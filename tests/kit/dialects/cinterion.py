"""Siemens and Cinterion: BGS2 (^SMONI, ^MONI, ^MONP), MC55 (^SMONC), TC63 (^SMOND); 120 to 126."""

from itertools import chain, repeat

from logger.sim.dialects import (
    COPS_SCAN_S,
    SETTINGS,
    Answer,
    Dialect,
    Settings,
    block,
    identity_replies,
)
from logger.sim.world import NEIGHBOURS, Air, ReceivedCell

NO_CELL = "000,000,0000,0000,00,0,0,-,-"


def smoni(air: Air, _: Settings) -> Answer:
    """The serving cell with its two colour codes apart."""
    one = air.serving
    if one is None:
        return ["^SMONI: 2G,SEARCH,SEARCH"]
    cell = one.cell
    where = f"{cell.arfcn},{one.dbm},{cell.mcc},{cell.mnc},{cell.lac:04X},{cell.cid:04X}"
    return [
        f"^SMONI: 2G,{where},{one.c1},{one.c2},{cell.bsic // 8},{cell.bsic % 8},G,5,-107,LIMSRV"
    ]


def smonc(air: Air, _: Settings) -> Answer:
    """Seven cells of nine values in one line; the level is an index."""
    received = (air.serving, *air.neighbours) if air.serving else ()
    cells = chain(map(_smonc, received), repeat(NO_CELL))
    return ["^SMONC: " + ",".join(next(cells) for _ in range(1 + NEIGHBOURS))]


def _smonc(one: ReceivedCell) -> str:
    cell = one.cell
    if not one.is_decoded:
        return f"000,000,0000,0000,00,{cell.arfcn},{one.rxlev},-,-"
    who_and_where = (
        f"{cell.mcc},{cell.mnc},{cell.lac:04X},{cell.cid:04X},{cell.bsic:02d},{cell.arfcn}"
    )
    return f"{who_and_where},{one.rxlev},{one.c1},{one.c2}"


def smond(air: Air, _: Settings) -> Answer:
    """Serving cell, six neighbours, TA, level and errors in one line; levels without sign."""
    if air.serving is None:
        return ["^SMOND: ,,,,,,0,,,0,,,0" + ",,,,,,,0" * NEIGHBOURS + ",,99,99"]
    cells = chain((_smond(one) for one in air.decoded_neighbours), repeat(",,,,,,0"))
    near = ",".join(next(cells) for _ in range(NEIGHBOURS))
    csq = min(max((air.serving.dbm + 113) // 2, 0), 31)
    return [f"^SMOND: {_smond(air.serving)},,,0,,,0,{near},1,{csq},99"]


def _smond(one: ReceivedCell) -> str:
    cell = one.cell
    identity = f"{cell.mcc},{cell.mnc},{cell.lac:04X},{cell.cid:04X}"
    return f"{identity},{cell.bsic:02d},{cell.arfcn},{-one.dbm}"


def moni(air: Air, _: Settings) -> Answer:
    """Columns of text."""
    titles = (
        "chann rs  dBm MCC MNC LAC  cell NCC BCC PWR  RXLev  C1 I chann TS timAdv PWR  dBm Q ChMod"
    )
    head = ["Serving Cell" + " " * 42 + "I Dedicated channel", titles]
    one = air.serving
    if one is None:
        return block([*head, "Searching"])
    cell = one.cell
    where = f"{cell.arfcn:4d} {one.rxlev:3d} {one.dbm:4d} {cell.mcc}  {cell.mnc}"
    where += f" {cell.lac:04X} {cell.cid:04X}"
    colours = f"{cell.bsic // 8:3d} {cell.bsic % 8:3d}"
    return block([*head, f"{where} {colours}   33   -105 {one.c1:3d} I Limited Service"])


def monp(air: Air, _: Settings) -> Answer:
    """Columns of text with one of the two colour codes, and no cell identity."""
    lines = [
        f"{one.cell.arfcn:4d} {one.rxlev:3d} {one.dbm:4d} {one.cell.mcc}  {one.cell.mnc}"
        f" {one.cell.bsic % 8:3d} {one.c1:3d} {one.c2:3d}"
        for one in air.decoded_neighbours
    ]
    return block(["chann rs  dBm MCC MNC BCC  C1  C2", *lines])


SCAN = {"+COPS=?": COPS_SCAN_S}
BGS2 = Dialect(
    "bgs2",
    identity_replies(
        ["Cinterion", "BGS2-W", "REVISION 02.000"], "Cinterion", "BGS2-W", "REVISION 02.000"
    ),
    replies={"^SMONI": smoni, "^MONI": moni, "^MONP": monp},
    settings=SETTINGS,
    takes_s=SCAN,
    boot=("^SYSSTART",),
)
MC55 = Dialect(
    "mc55",
    identity_replies(["SIEMENS", "MC55", "REVISION 04.00"], "SIEMENS", "MC55", "REVISION 04.00"),
    replies={"^SMONC": smonc, "^MONI": moni, "^MONP": monp},
    settings=SETTINGS,
    takes_s=SCAN,
    boot=("^SYSSTART",),
)
TC63 = Dialect(
    "tc63",
    identity_replies(["SIEMENS", "TC63", "REVISION 02.000"], "SIEMENS", "TC63", "REVISION 02.000"),
    replies={"^SMOND": smond, "^SMONC": smonc, "^MONI": moni, "^MONP": monp},
    settings=SETTINGS,
    takes_s=SCAN,
    boot=("^SYSSTART",),
)
