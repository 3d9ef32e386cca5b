"""Memory that is freed goes back to the system, so that what a walk needs is what it takes."""

import ctypes
import platform

_BLOCK_BYTES, _END_BYTES = 128 * 1024, 1024 * 1024
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8


def give_back() -> None:
    """Make glibc use one heap for all threads, and no heap for blocks of over 128 kB.

    Other C libraries are left as they are.

    By itself it raises that bound with each larger block that is freed, and gives each thread a
    heap: the arrays of forty cells, freed here and kept there, then took 20 MB more and kept
    growing. Up to 1 MB at the end of the heap is kept, or each reading would ask for it anew. To be
    called before threads start. Source: mallopt(3).
    """
    if platform.libc_ver()[0] != "glibc":
        return
    libc = ctypes.CDLL(None)
    for option, value in (
        (_M_ARENA_MAX, 1),
        (_M_MMAP_THRESHOLD, _BLOCK_BYTES),
        (_M_TRIM_THRESHOLD, _END_BYTES),
    ):
        libc.mallopt(option, value)
