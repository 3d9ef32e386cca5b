"""Work shared out over processes, where that is worth it and possible."""

import ctypes
import platform
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

_KEPT_BYTES = 32 << 20
"""The largest bound that malloc accepts (mallopt(3))."""
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3

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
    keep_freed_memory()
    with threadpool_limits(1):
        for item in items[done:]:
            yield work(item)


def keep_freed_memory() -> None:
    """Make glibc keep up to 32 MB that are freed; other C libraries are left as they are.

    By itself it returns each temporary array of over 128 kB to the system and fetches it again,
    page by page: a tenth of the time of an estimate.
    """
    if platform.libc_ver()[0] == "glibc":
        libc = ctypes.CDLL(None)
        for option in (_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD):
            libc.mallopt(option, _KEPT_BYTES)


def _begin_process() -> None:
    keep_freed_memory()
    threadpool_limits(1)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # ends without a traceback
