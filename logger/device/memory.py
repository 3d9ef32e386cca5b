"""What the recorder may use, and settings of malloc that return freed memory."""

import logging
import platform
import sys

import msgspec

from logger.core.live_settings import LiveSettings

log = logging.getLogger(__name__)

MEMORY_MB = 384
"""MemoryMax= of fieldlogger.service: beyond it the kernel ends the recorder."""
_SERVICE_MB, _STREETS_MB, _BASELINE_MB, _CELL_MB = 105.0, 64.0, 16.0, 2.9
"""Memory of a service that answers for one cell, what the largest street file and baseline add
while they are read, and a cell's (benchmarks/soak.py, 20 minutes)."""
MOST_CELLS = int((MEMORY_MB - _SERVICE_MB - _STREETS_MB - _BASELINE_MB) / _CELL_MB)

_BLOCK_BYTES = 2**20 if sys.maxsize > 2**32 else 2**19  # the largest that a 32-bit glibc takes
_END_BYTES = 2**22
# with 128 kB and 1 MB a third of the live estimate's time went into pages, mapped for one product
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8


def within_memory(live: LiveSettings) -> LiveSettings:
    """The settings with no more cells at once than the memory allows."""
    if live.most_cells <= MOST_CELLS:
        return live
    log.warning("[live] most_cells: there is memory for %d cells at once", MOST_CELLS)
    return msgspec.structs.replace(live, most_cells=MOST_CELLS)


def give_back() -> None:
    """Make glibc use one heap for all threads, and no heap for blocks of over 1 MB.

    By itself glibc raises that bound with each larger block that is freed, and gives each thread a
    heap: the arrays of forty cells then took 20 MB more, and more with time. Up to 4 MB of its
    end stay. To be called before threads start. Source: mallopt(3).
    """
    if platform.libc_ver()[0] != "glibc":
        return
    import ctypes  # noqa: PLC0415 (not before a run has begun)

    libc = ctypes.CDLL(None)
    for option, value in (
        (_M_ARENA_MAX, 1),
        (_M_MMAP_THRESHOLD, _BLOCK_BYTES),
        (_M_TRIM_THRESHOLD, _END_BYTES),
    ):
        libc.mallopt(option, value)
