"""Rows of AT+CENG as a SIM800 prints them (SIM800 AT Command Manual V1.09 p161-163, and captures).

A cell that is received but not decoded has its level and blanks; empty slots are printed in mode 3
only.
"""

from logger.sim.air import NEIGHBOURS, Air, ReceivedCell

DBM_OF_RXL_0 = -113
RXL_MAX = 64
"""The manual counts to 63, one modem printed 64."""
RLA, TXP = 5, 5  # as captured; access is allowed from -110 dBm + RLA (3GPP TS 45.008 6.4)
IDLE = ",x,x,x,x,x,x,x"  # tch to ch_mod, which only a call fills


def rxl(one: ReceivedCell) -> int:
    return min(max(one.dbm - DBM_OF_RXL_0, 0), RXL_MAX)


def rows(mode: int, ncell: int, air: Air) -> list[str]:
    """Rows from the serving cell on; none without it and in mode 0."""
    if air.serving is None or mode == 0:
        return []
    texts = [_serving(mode, air.serving)]
    texts += [
        text
        for one in (air.neighbours if air.serving else air.others)
        if (text := _neighbour(mode, ncell, one))
    ]
    if mode == 3:
        texts += [",,0000,0000,00,00"] * NEIGHBOURS
    return [f'+CENG: {number},"{text}"' for number, text in enumerate(texts[: 1 + NEIGHBOURS])]


def _serving(mode: int, one: ReceivedCell) -> str:
    cell = one.cell
    if mode == 3:
        return _location(one)
    text = (
        f"{cell.arfcn:04d},{rxl(one):02d},00,{cell.mcc},{cell.mnc},{cell.bsic:02d},{cell.cid:04x}"
        f",{RLA:02d},{TXP:02d},{cell.lac:04x},255"  # 255: no timing advance without a call
    )
    return text if mode != 4 else f"{text},{rxl(one) + DBM_OF_RXL_0},{one.c1},{one.c2}{IDLE}"


def _neighbour(mode: int, ncell: int, one: ReceivedCell) -> str | None:
    """Text of a neighbour's row; None where no form is known of one that is not decoded."""
    if mode in {3, 4} and not one.is_decoded:
        return None
    cell = one.cell
    if mode == 3:
        return _location(one)
    head = f"{cell.arfcn:04d},{rxl(one):02d},{cell.bsic if one.is_decoded else 0:02d}"
    if not one.is_decoded:
        return f"{head},ffff,,,0000" if ncell else f"{head},,,0000"
    cid = f",{cell.cid:04x}" if ncell else ""
    criteria = f",{one.c1},{one.c2}" if mode == 4 else ""
    return f"{head}{cid},{cell.mcc},{cell.mnc},{cell.lac:04x}{criteria}"


def _location(one: ReceivedCell) -> str:
    cell = one.cell
    return f"{cell.mcc},{cell.mnc},{cell.lac:04x},{cell.cid:04x},{cell.bsic:02d},{rxl(one):02d}"
