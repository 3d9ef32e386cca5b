"""The run file: a journal while recording, plain HDF5 afterwards, read through one function.

The only part of `core` that touches files, and the only one of the logger that imports h5py.
Recording needs neither numpy nor h5py: a run begins before they are imported, and what needs them
is imported when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from logger.core.runfile.meta import Damage, RunEnd, RunMeta, Truth
from logger.core.runfile.retention import FLOOR_BYTES, free_bytes, make_room, remove_oldest_runs
from logger.core.runfile.run_names import journal_path
from logger.core.runfile.writer import RunWriter

if TYPE_CHECKING:
    from logger.core.runfile.finish import convert_journal, finish_journal, unfinished_journals
    from logger.core.runfile.recovery import Recovered, recover
    from logger.core.runfile.run import (
        Run,
        read_run,
        read_small_runs,
        read_sound_run,
        read_unaltered_run,
    )
    from logger.core.runfile.verify import Sealing, sealing_of

__all__ = [
    "FLOOR_BYTES",
    "Damage",
    "Recovered",
    "Run",
    "RunEnd",
    "RunMeta",
    "RunWriter",
    "Sealing",
    "Truth",
    "convert_journal",
    "finish_journal",
    "free_bytes",
    "journal_path",
    "make_room",
    "read_run",
    "read_small_runs",
    "read_sound_run",
    "read_unaltered_run",
    "recover",
    "remove_oldest_runs",
    "sealing_of",
    "unfinished_journals",
]

_ROOM_OF = {
    **dict.fromkeys(("convert_journal", "finish_journal", "unfinished_journals"), "finish"),
    **dict.fromkeys(("Recovered", "recover"), "recovery"),
    **dict.fromkeys(
        ("Run", "read_run", "read_small_runs", "read_sound_run", "read_unaltered_run"), "run"
    ),
    **dict.fromkeys(("Sealing", "sealing_of"), "verify"),
}
"""The modules that need numpy and h5py, by what they offer."""


def __getattr__(name: str) -> Any:
    """Import the modules that need HDF5 at the first use of their names."""
    if name not in _ROOM_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_ROOM_OF[name]}"), name)
