"""Rows of AT+CENG as a SIM800 prints them (SIM800 AT Command Manual V1.09 p161-163, and captures).

A cell that is heard but not decoded has its level and blanks; empty slots are printed in mode 3 only.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from logger.sim.world import Transmitter

NEIGHBOURS = 6
DBM_OF_RXL_0 = -113
RXL_MAX = 64
"""The manual counts to 63, one modem printed 64."""
RLA, TXP = 5, 5  # as captured; access is allowed from -110 dBm + RLA (3GPP TS 45.008 6.4)
IDLE = ",x,x,x,x,x,x,x"  # tch to ch_mod, which only a call fills


@dataclass(frozen=True, slots=True)
class Heard:
    """One cell at its level; not decoded means that the modem knows no more than channel and level."""

    cell: Transmitter
    level_dbm: float
    decoded: bool

    @property
    def rxl(self) -> int:
        return min(max(round(self.level_dbm) - DBM_OF_RXL_0, 0), RXL_MAX)

    @property
    def c1(self) -> int:
        """Path loss criterion: the level above that from which access is allowed."""
        return round(self.level_dbm) - (RLA - 110)


def rows(mode: int, ncell: int, heard: Sequence[Heard]) -> list[str]:
    """Rows from the serving cell on, the strongest decoded one; none without it and in mode 0."""
    by_level = sorted(heard, key=lambda one: one.level_dbm, reverse=True)
    serving = next((one for one in by_level if one.decoded), None)
    if serving is None or mode == 0:
        return []
    neighbours = [one for one in by_level if one is not serving]
    texts = [_serving(mode, serving)] + [text for one in neighbours if (text := _neighbour(mode, ncell, one))]
    if mode == 3:
        texts += [",,0000,0000,00,00"] * NEIGHBOURS
    return [f'+CENG: {number},"{text}"' for number, text in enumerate(texts[: 1 + NEIGHBOURS])]


def _serving(mode: int, one: Heard) -> str:
    cell = one.cell
    if mode == 3:
        return _location(one)
    text = (
        f"{cell.arfcn:04d},{one.rxl:02d},00,{cell.mcc},{cell.mnc},{cell.bsic:02d},{cell.cid:04x}"
        f",{RLA:02d},{TXP:02d},{cell.lac:04x},255"  # 255: no timing advance without a call
    )
    return text if mode != 4 else f"{text},{one.rxl + DBM_OF_RXL_0},{one.c1},{one.c1}{IDLE}"


def _neighbour(mode: int, ncell: int, one: Heard) -> str | None:
    """Text of a neighbour's row; None where no form is known of one that is not decoded."""
    if mode in {3, 4} and not one.decoded:
        return None
    cell = one.cell
    if mode == 3:
        return _location(one)
    head = f"{cell.arfcn:04d},{one.rxl:02d},{cell.bsic if one.decoded else 0:02d}"
    if not one.decoded:
        return f"{head},ffff,,,0000" if ncell else f"{head},,,0000"
    cid = f",{cell.cid:04x}" if ncell else ""
    criteria = f",{one.c1},{one.c1}" if mode == 4 else ""
    return f"{head}{cid},{cell.mcc},{cell.mnc},{cell.lac:04x}{criteria}"


def _location(one: Heard) -> str:
    cell = one.cell
    return f"{cell.mcc},{cell.mnc},{cell.lac:04x},{cell.cid:04x},{cell.bsic:02d},{one.rxl:02d}"
