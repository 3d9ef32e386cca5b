"""How work grows with its amount, by measures that do not depend on how quick the machine is."""

import time
from collections.abc import Callable

TRIES = 3
"""The least of so many times counts: what else the machine does only ever adds."""


def cost_growth(work: Callable[[int], object], small: int, large: int) -> float:
    """Processor time of `large` by that of `small`, over the ratio of the amounts: 1 is linear.

    Amounts eight times apart show quadratic work as 8, whatever the machine.
    """
    return _least_s(work, large) / _least_s(work, small) * small / large


def _least_s(work: Callable[[int], object], amount: int) -> float:
    took_s = []
    for _ in range(TRIES):
        begun_s = time.process_time()
        work(amount)
        took_s.append(time.process_time() - begun_s)
    return max(min(took_s), 1e-6)
