"""Machine code for loops over readings, by numba where it is installed.

numba compiles a function at its first call and keeps the result on disk for the next start. Without
numba the same functions run as they are, with the same results and many times slower.
"""

from collections.abc import Callable, Sequence
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

HAS_NUMBA = find_spec("numba") is not None
"""Whether the extra `post` is installed and not the smaller `desk`."""
_MANY_ROWS = 50_000
"""Python takes about 10 us a row; to import numba and load what it has compiled takes 0.8 s."""


def jit(function: Callable[..., Any]) -> Any:
    """The function in machine code, cached on disk where a cache can be written."""
    if not HAS_NUMBA:
        return function
    from numba import njit  # noqa: PLC0415 (optional)

    try:
        return njit(cache=True)(function)
    except RuntimeError:  # no directory for the cache
        return njit(function)


class Loop:
    """A loop over rows: Python at first, machine code once this process has had many rows.

    `build` gives the function that loops, closed over a text. `steps` are modules, each with the
    names of its functions that the loop calls and numba has to compile.
    """

    _rows = 0
    """Of all loops in this process: they share the cost of numba."""

    def __init__(
        self, build: Callable[[str], Callable[..., Any]], *steps: tuple[ModuleType, Sequence[str]]
    ) -> None:
        self._build, self._steps = build, steps
        self._plain = build("not compiled")
        self._compiled: Callable[..., Any] | None = None

    def __call__(self, rows: int, *arguments: Any) -> Any:
        """Run over this many rows."""
        Loop._rows += rows
        if Loop._rows < _MANY_ROWS or not HAS_NUMBA:
            return self._plain(*arguments)
        if self._compiled is None:
            sources = [callable_in_loops(*step) for step in self._steps]
            self._compiled = jit(self._build("".join(sources)))
        return self._compiled(*arguments)


def callable_in_loops(module: ModuleType, names: Sequence[str]) -> str:
    """Let numba compile functions of a module where they are called; the hash of its source.

    numba's cache notices a change of what a function closes over, not of what it calls. So each
    loop closes over the hash of the module that its step comes from.
    """
    from numba.extending import register_jitable  # noqa: PLC0415 (optional)

    for name in names:
        register_jitable(getattr(module, name))
    return sha256(Path(str(module.__file__)).read_bytes()).hexdigest()
