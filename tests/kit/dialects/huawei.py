"""Huawei ME909s on a GSM network: ^MONSC, ^MONNC and ^HCSQ (captures 135 to 138)."""

from logger.sim.dialects import (
    COPS_SCAN_S,
    EPS,
    EPS_SETTINGS,
    IMEI,
    SETTINGS,
    Answer,
    Dialect,
    Settings,
    block,
    identity_replies,
)
from logger.sim.world import Air
from tests.kit.dialects import modes

GSM_900 = 1


def serving_cell(air: Air, _: Settings) -> Answer:
    """Area and cell are hexadecimal, the cell first; two values are empty without a call."""
    one = air.serving
    if one is None:
        return ["^MONSC: NONE"]
    cell = one.cell
    where = f"{cell.mcc},{cell.mnc},{GSM_900},{cell.arfcn},{cell.bsic},{cell.cid:X},{cell.lac:X}"
    return [f"^MONSC: GSM,{where},{one.dbm},,"]


def neighbour_cells(air: Air, _: Settings) -> Answer:
    """Zero for the cell and the area of one that is not decoded."""
    lines = [
        f"^MONNC: GSM,{GSM_900},{one.cell.arfcn},{one.cell.bsic if one.is_decoded else 0}"
        + (f",{one.cell.cid:X},{one.cell.lac:X}" if one.is_decoded else ",0,0")
        + f",{one.dbm}"
        for one in air.neighbours
    ]
    return block(lines or ["^MONNC: NONE"])


def quality(air: Air, _: Settings) -> Answer:
    one = air.serving
    return [
        "^HCSQ: NOSERVICE" if one is None else f'^HCSQ: "GSM",{min(max(one.dbm + 121, 0), 96)},255'
    ]


ME909S = Dialect(
    "me909s",
    identity_replies(
        [
            "Manufacturer: Huawei",
            "Model: ME909s-120",
            "Revision: 11.617.01.00.00",
            f"IMEI: {IMEI}",
            "+GCAP: +CGSM",
        ],
        "Huawei",
        "ME909s-120",
        "11.617.01.00.00",
    ),
    replies={
        "^MONSC": serving_cell,
        "^MONNC": neighbour_cells,
        "^HCSQ?": quality,
        **EPS,
        **modes.SYSCFGEX,
    },
    settings=SETTINGS | EPS_SETTINGS | modes.SYSCFGEX_SETTINGS,
    takes_s={"+COPS=?": COPS_SCAN_S},
    boot=("^SYSSTART",),
)
