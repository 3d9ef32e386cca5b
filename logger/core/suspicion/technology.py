"""A good cell of 4G or 5G left for 2G, as a rogue cell without these wants."""

from collections.abc import Iterator
from math import hypot

from logger.core.suspicion.heard import Heard, HeardCell, Memory, Moment, serving_cell
from logger.core.suspicion.rule import GSM, Evidence, Rate, ScanRule

_GOOD_DBM = -105.0
"""RSRP at which a telephone stays."""
_BEFORE_S = 30.0
_HELD_S = 8.0
"""A telephone in a call went from 3G to 2G for 14 s; none left 4G. With 12 s instead, a fourth of
the weak stations are named in a car, with 30 s none."""
_PASSING_S = 10.0
"""A stay on 3G that is no call: one on the way down, as where band after band is jammed."""
_FEWEST_SCANS = 2
_PAUSE_S = 10.0  # without a scan: a modem needs more for a start, for another technology less
# where nothing was heard for longer: near enough for 4G that was good to be on the air still
_SILENT_S, _PLACE_M = 300.0, 150.0
# Walls that take 4G of -105 dBm below -120 take as much of 2G, which is some 20 dB stronger, as
# RSRP is of one subcarrier: they leave -100 dBm, and 15 dB more are two deviations of shadowing.
_OUTDOORS_DBM = -85.0
_LATER = frozenset({"LTE", "LTE-M", "NB-IoT", "NR"})


class _Downgrade:
    """`good` is the last cell of 4G or 5G if it was good, None once reported; since when 3G, 2G."""

    good: tuple[float, str, float, str] | None = None
    at: Moment | None = None  # of the last
    silent_s = 0.0  # of the last, or of a scan after it and without any cell
    on_3g_s: float | None = None
    down_s: float | None = None


def _left_for_2g(memory: Memory) -> Iterator[HeardCell]:
    """The named 2G cell that serves where a good cell of 4G or 5G did before."""
    now, serving, past = memory.now, memory.now.serving, memory.of(_Downgrade)
    if not now.cells and now.t_s - past.silent_s <= _BEFORE_S and past.down_s is None:
        past.silent_s = now.t_s
    if serving is None:
        return
    t_s, level_dbm = memory.now.t_s, serving.level_dbm
    if _was_paused(memory):
        past.good = None
    if serving.rat == "WCDMA":
        past.on_3g_s = t_s if past.on_3g_s is None else past.on_3g_s
        past.down_s = None
        if t_s - past.on_3g_s > _PASSING_S:  # calls go on to 2G from there
            past.good = None
    elif serving.rat in _LATER:
        past.on_3g_s = past.down_s = None
        if level_dbm is not None:
            is_good = level_dbm >= _GOOD_DBM
            past.good = (t_s, serving.rat, level_dbm, serving.operator) if is_good else None
            past.at, past.silent_s = now, t_s
    elif serving.rat == "GSM" and past.good is not None:
        past.down_s = t_s if past.down_s is None else past.down_s
        yield from serving_cell(memory)


def _was_paused(memory: Memory) -> bool:
    # a modem that starts again may look for 2G first
    times_s = [moment.t_s for moment in list(memory.latest)[-3:]]
    if len(times_s) < 3:
        return False
    pause_s = times_s[2] - times_s[1]
    return pause_s > max(_PAUSE_S, 2.0 * (times_s[1] - times_s[0]))


@ScanRule(
    id="R1",
    family="technology",
    needs=("second technology", "level"),
    gate="4G or 5G of the same network, at last of at least -105 dBm, in the 30 s before, at most "
    "10 s of 3G between, or 300 s without any cell within 150 m and then 2G of -85 dBm; 2G held "
    "for 8 s by a cell with an identity; the modem scans all the time; each change counts once",
    sentence="{before} was left at {level_dbm} dBm, {between}and 2G was kept for {held_s} s",
    harmless="a call, where the operator has no voice over 4G",
    about=_left_for_2g,
    detection=0.6,
    elsewhere=Rate(0, 814, 36.1, "62 runs of telephones, by cells of 4G"),
    rats=GSM,
    strength="suffices",
)
def _stays_on_2g(memory: Memory, cell: HeardCell) -> Evidence | None:
    serving, past = memory.now.serving, memory.of(_Downgrade)
    if serving is None or past.good is None or past.down_s is None:
        return None
    good_s, rat, level_dbm, operator = past.good
    held_s = memory.now.t_s - past.down_s
    if memory.are_apart(serving.operator, operator):
        return None
    if held_s < _HELD_S or cell.n_scans < _FEWEST_SCANS:
        return None
    between, gap_s = "", past.down_s - good_s
    if gap_s > _BEFORE_S:
        if not _is_jammed(past, memory.now, serving):
            return None
        between = f"no cell was heard for {gap_s:.0f} s, "
    past.good = None
    level_and_time = {"level_dbm": round(level_dbm), "held_s": round(held_s)}
    return {"before": rat, "between": between, **level_and_time}


def _is_jammed(past: _Downgrade, now: Moment, serving: Heard) -> bool:
    # no cell between; not in a lift or a cellar
    before, down_s, level_dbm = past.at, past.down_s, serving.level_dbm
    if before is None or before.x_m is None or before.y_m is None or down_s is None:
        return False
    if now.x_m is None or now.y_m is None or level_dbm is None or level_dbm < _OUTDOORS_DBM:
        return False
    if down_s - past.silent_s > _BEFORE_S or down_s - before.t_s > _SILENT_S:
        return False
    return hypot(now.x_m - before.x_m, now.y_m - before.y_m) <= _PLACE_M
