"""Work shared out over processes, where that is worth it and possible."""

import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

from threadpoolctl import threadpool_limits

_ITEMS_EACH = 2
"""Items that are worth starting a process for: that takes about as long as one cell."""
_MOST_PROCESSES = 4
"""A quarter of a gigabyte each, beside the run itself."""

Item = TypeVar("Item")
Result = TypeVar("Result")


def each(work: Callable[[Item], Result], items: Sequence[Item], processes: int) -> Iterator[Result]:
    """Results of `work` for the items in their order, from several processes where that pays."""
    done, count = 0, min(processes, _MOST_PROCESSES, len(items) // _ITEMS_EACH)
    if count > 1:
        try:
            # fresh processes: a fork would copy the locks of threads that it does not copy
            with ProcessPoolExecutor(count, get_context("spawn"), _begin_process) as pool:
                for result in pool.map(work, items):
                    done += 1
                    yield result
        except (
            NotImplementedError,
            OSError,
            BrokenExecutor,
        ):  # this machine gives no process, or has killed one
            pass
    # the matrices are small: threads of BLAS would only wait for each other
    with threadpool_limits(1):
        for item in items[done:]:
            yield work(item)


def _begin_process() -> None:
    threadpool_limits(1)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # ends without a traceback
