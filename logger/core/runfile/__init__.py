"""The run file: a journal while recording, plain HDF5 afterwards, read through one function.

The only part of `core` that touches files, and the only one of the logger that imports h5py.
Recording needs neither numpy nor h5py: they are imported when first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from logger.core.runfile.journal import RunWriter
from logger.core.runfile.meta import Damage, RunEnd, RunMeta, Truth
from logger.core.runfile.retention import FLOOR_BYTES, free_bytes, make_room, remove_oldest_runs
from logger.core.runfile.run_names import RESULTS, journal_path, keep_number

if TYPE_CHECKING:
    from logger.core.runfile.finish import (
        Recovered,
        convert_journal,
        finish_journal,
        recover,
        unfinished_journals,
    )
    from logger.core.runfile.frames import Sealing
    from logger.core.runfile.run import (
        Run,
        read_latest,
        read_results,
        read_run,
        read_sealed_run,
        read_sound_run,
        read_unaltered_run,
        sealing_of,
    )

__all__ = [
    "FLOOR_BYTES",
    "RESULTS",
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
    "keep_number",
    "make_room",
    "read_latest",
    "read_results",
    "read_run",
    "read_sealed_run",
    "read_sound_run",
    "read_unaltered_run",
    "recover",
    "remove_oldest_runs",
    "sealing_of",
    "unfinished_journals",
]

_OF_FINISH = {
    "Recovered",
    "convert_journal",
    "finish_journal",
    "recover",
    "unfinished_journals",
}


def __getattr__(name: str) -> Any:
    """Imports the modules that need HDF5 at the first use of their names."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{'finish' if name in _OF_FINISH else 'run'}"), name)
