"""Timing advance: distances from one base station that no place can have."""

from math import hypot

from logger.core.suspicion.heard import HeardCell, Memory
from logger.core.suspicion.rule import Evidence, Rate, ScanRule, on_telephones

STEP_M = {"GSM": 553.5, "LTE": 78.12}
"""Metres of a step: 3GPP TS 45.010 and TS 36.211 (16 Ts)."""
_MARGIN_M = {"GSM": 600.0, "LTE": 250.0}
"""Reflections and the error of the advance: a step in GSM, three in LTE."""
_LARGEST = {"GSM": 63, "LTE": 1282}
_APART_M = 50.0
_FEWEST = 5
_MOST = 24
_SHARE = 0.2


@ScanRule(
    id="T1",
    family="timing",
    needs=("identity", "timing advance", "position"),
    gate="5 rings at places 50 m apart, more than 20 % of the pairs disjoint",
    sentence="{share:.0%} of its distances by timing advance exclude each other",
    harmless="a modem that repeats an old value",
    detection=0.5,
    measured=on_telephones(GSM=(0, 21, 2.0), LTE=(1, 258, 5.3)),
    elsewhere=Rate(4, 251, 0.0, "walks with 251 cells"),
    rats=frozenset(STEP_M),
)
def _rings_apart(memory: Memory, cell: HeardCell) -> Evidence | None:
    now, ta = memory.now, cell.heard.reading.ta
    if now.x_m is None or now.y_m is None or ta is None or not cell.heard.is_serving:
        return None
    if cell.rat not in STEP_M or ta >= _LARGEST[cell.rat]:
        return None
    if not _is_new(cell, now.x_m, now.y_m, ta):
        return None
    cell.rings.append((now.x_m, now.y_m, ta))
    del cell.rings[:-_MOST]
    share = _disjoint_share(cell)
    if len(cell.rings) < _FEWEST or share <= _SHARE:
        return None
    return {"rings": len(cell.rings), "share": round(share, 2)}


def _is_new(cell: HeardCell, x_m: float, y_m: float, ta: int) -> bool:
    """An idle modem repeats its last value."""
    if not cell.rings:
        return True
    last_x_m, last_y_m, last_ta = cell.rings[-1]
    apart_m = hypot(x_m - last_x_m, y_m - last_y_m)
    return apart_m >= _APART_M or (ta != last_ta and apart_m >= 0.5 * _APART_M)


def _disjoint_share(cell: HeardCell) -> float:
    """Share of pairs of rings that have no point in common."""
    step_m, margin_m = STEP_M[cell.rat], _MARGIN_M[cell.rat]
    n_pairs = n_apart = 0
    for i, (x_m, y_m, ta) in enumerate(cell.rings):
        for other_x_m, other_y_m, other_ta in cell.rings[:i]:
            apart_m = hypot(x_m - other_x_m, y_m - other_y_m)
            outer_m = (ta + other_ta + 2) * step_m + margin_m
            gap_m = (abs(ta - other_ta) - 1) * step_m - margin_m
            n_pairs += 1
            n_apart += apart_m > outer_m or apart_m < gap_m
    return n_apart / n_pairs if n_pairs else 0.0
