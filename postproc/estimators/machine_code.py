"""Machine code for loops over readings, by numba where it is installed.

numba compiles a function at its first call and keeps the result on disk for the next start. Without
numba the same functions run as they are, with the same results and many times slower.
"""

from collections.abc import Callable
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

HAS_NUMBA = find_spec("numba") is not None
"""Whether the extra `post` is installed and not the smaller `desk`."""


def jit(function: Callable[..., Any]) -> Any:
    """The function in machine code, cached on disk where a cache can be written."""
    if not HAS_NUMBA:
        return function
    from numba import njit  # noqa: PLC0415 (optional)

    try:
        return njit(cache=True)(function)
    except RuntimeError:  # no directory for the cache
        return njit(function)


def jitable(function: Callable[..., Any]) -> Any:
    """The function itself, which numba compiles where a compiled one calls it."""
    if not HAS_NUMBA:
        return function
    from numba.extending import register_jitable  # noqa: PLC0415 (optional)

    return register_jitable(function)


def callable_in_loops(module: ModuleType, *names: str) -> str:
    """Let numba compile functions of a module where they are called; the hash of its source.

    numba's cache notices a change of what a function closes over, not of what it calls. So each
    loop closes over the hash of the module that its step comes from.
    """
    for name in names:
        jitable(getattr(module, name))
    return sha256(Path(str(module.__file__)).read_bytes()).hexdigest()
