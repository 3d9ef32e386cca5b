"""Settings of malloc, so that freed memory returns to the system."""

import ctypes
import platform

_BLOCK_BYTES, _END_BYTES = 128 * 1024, 1024 * 1024
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8


def give_back() -> None:
    """Make glibc use one heap for all threads, and no heap for blocks of over 128 kB.

    Other C libraries are left as they are.

    By itself it raises that bound with each larger block that is freed, and gives each thread a
    heap: the arrays of forty cells then took 20 MB more, and more with time. Up to 1 MB at
    the end of the heap stays allocated, or each reading would allocate it again. To be
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
