"""Timing advance: distances from one base station that no place can have."""

from collections.abc import Iterator
from math import hypot

from logger.core.suspicion.broken import Broken, Taken
from logger.core.suspicion.heard import HeardCell, Memory, Moment

STEP_M = {"GSM": 553.5, "LTE": 78.12}
"""Metres of a step: 3GPP TS 45.010 and TS 36.211 (16 Ts)."""
_MARGIN_M = {"GSM": 600.0, "LTE": 250.0}
"""Reflections and the error of the advance: a step in GSM, three in LTE."""
_LARGEST = {"GSM": 63, "LTE": 1282}
_APART_M = 50.0
_FEWEST = 5
_MOST = 24
_SHARE = 0.2


class TimingRules:
    """T1."""

    def check(self, now: Moment, memory: Memory, taken: Taken) -> Iterator[Broken]:  # noqa: ARG002
        """As `FamilyRules`."""
        if now.x_m is None or now.y_m is None:
            return
        for cell, heard in taken:
            ta = heard.reading.ta
            if ta is None or not heard.is_serving or cell.rat not in STEP_M:
                continue
            if ta >= _LARGEST[cell.rat] or not _is_new(cell, now.x_m, now.y_m, ta):
                continue
            cell.rings.append((now.x_m, now.y_m, ta))
            del cell.rings[:-_MOST]
            share = _disjoint_share(cell)
            if len(cell.rings) >= _FEWEST and share > _SHARE:
                yield Broken("T1", cell.name, {"rings": len(cell.rings), "share": round(share, 2)})


def _is_new(cell: HeardCell, x_m: float, y_m: float, ta: int) -> bool:
    """Whether this ring says more than the last: an idle modem repeats the last value."""
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
