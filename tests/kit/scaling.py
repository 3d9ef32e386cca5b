"""How work grows with its amount, by measures that do not depend on how quick the machine is."""

import time
from collections.abc import Callable

TRIES = 3
"""The least of so many times counts: what else the machine does only ever adds."""


def check_growth(work: Callable[[int], object], small: int, large: int, most: float = 4.0) -> None:
    """The processor time of `large` is less than `most` times as much for each unit as of `small`.

    Linear work has 1. Amounts eight times apart show quadratic work as 8, whatever the machine.
    The large amount is tried again only while it appears too slow.
    """
    limit_s = most * min(_time_s(work, small) for _ in range(TRIES)) * large / small
    times_s = []
    while len(times_s) < TRIES:
        times_s.append(_time_s(work, large))
        if times_s[-1] < limit_s:
            return
    raise AssertionError(f"{large} take {min(times_s):.3f} s, of which {limit_s:.3f} s are allowed")


def _time_s(work: Callable[[int], object], amount: int) -> float:
    begun_s = time.process_time()
    work(amount)
    return max(time.process_time() - begun_s, 1e-6)
