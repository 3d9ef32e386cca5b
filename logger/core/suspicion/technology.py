"""A good cell of 4G or 3G left for 2G, as a rogue cell without 4G or 3G wants."""

from collections.abc import Iterator

from logger.core.suspicion.heard import HeardCell, Memory, serving_cell
from logger.core.suspicion.rule import GSM, Evidence, Rate, ScanRule, on_telephones

_GOOD_DBM = -105.0
"""RSRP or RSCP at which a telephone stays."""
_BEFORE_S = 30.0
_HELD_S = 30.0
_LATER = frozenset({"LTE", "LTE-M", "NB-IoT", "NR", "WCDMA"})


class _Downgrade:
    """The last good cell of a later technology, and since when a cell of 2G serves."""

    good: tuple[float, str, float, str] | None = None
    down_s: float | None = None


def _left_for_2g(memory: Memory) -> Iterator[HeardCell]:
    """The named 2G cell that serves where a good cell of a later technology did before."""
    serving, past = memory.now.serving, memory.of(_Downgrade)
    if serving is None:
        return
    if serving.rat in _LATER:
        past.down_s = None
        if serving.level_dbm is not None and serving.level_dbm >= _GOOD_DBM:
            past.good = memory.now.t_s, serving.rat, serving.level_dbm, serving.operator
    elif serving.rat == "GSM" and past.good is not None:
        past.down_s = memory.now.t_s if past.down_s is None else past.down_s
        yield from serving_cell(memory)


@ScanRule(
    id="R1",
    family="technology",
    needs=("second technology", "level"),
    gate="4G or 3G of the same network of at least -105 dBm in the 30 s before, 2G held for 30 s",
    sentence="{before} was left at {level_dbm} dBm, and 2G was kept for {held_s} s",
    harmless="a call, where the operator has no voice over 4G",
    about=_left_for_2g,
    detection=0.6,
    measured=on_telephones(GSM=(0, 2, 0.7)),
    elsewhere=Rate(2, 1500, 60.0, "60 h of telephones, about 1500 cells"),
    rats=GSM,
)
def _stays_on_2g(memory: Memory, _cell: HeardCell) -> Evidence | None:
    serving, past = memory.now.serving, memory.of(_Downgrade)
    if serving is None or past.good is None or past.down_s is None:
        return None
    good_s, rat, level_dbm, operator = past.good
    held_s = memory.now.t_s - past.down_s
    if memory.are_apart(serving.operator, operator):
        return None
    if past.down_s - good_s > _BEFORE_S or held_s < _HELD_S:
        return None
    return {"before": rat, "level_dbm": round(level_dbm), "held_s": round(held_s)}
