"""Estimates where a rogue base station stands, from the runs that `logger` records.

    from postproc import read_run, smooth

    result = smooth(read_run("run-000017.h5"))

`docs/api.md` describes each function. The names are imported when they are first used (PEP 562),
since the estimators take seconds to import and most commands need few of them.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from postproc.api import (
        by_place,
        export,
        locate,
        observations,
        read_run,
        smooth,
        suspect,
        verify,
    )
    from postproc.result import CellResult, ObservedRun, Options, Result
    from postproc.verification.claims import Claim

__all__ = [
    "CellResult",
    "Claim",
    "ObservedRun",
    "Options",
    "Result",
    "by_place",
    "export",
    "locate",
    "observations",
    "read_run",
    "smooth",
    "suspect",
    "verify",
]

__version__: str

_MODULE_OF = {
    **dict.fromkeys((name for name in __all__ if name.islower()), "api"),
    **dict.fromkeys(("CellResult", "ObservedRun", "Options", "Result"), "result"),
    "Claim": "verification.claims",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return version("cellwalk")
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
