"""The run file: a journal while recording, plain HDF5 afterwards, read through one function.

The only part of `core` that touches files, and the only one of the logger that imports h5py.
"""

from logger.core.runfile.finish import convert_journal, finish_journal, unfinished
from logger.core.runfile.meta import Damage, RunEnd, RunMeta, Truth
from logger.core.runfile.names import journal_path
from logger.core.runfile.recover import SOMETHING_LOST, Recovered, recover
from logger.core.runfile.room import FLOOR_BYTES, free_bytes, make_room
from logger.core.runfile.run import Run, read_run
from logger.core.runfile.verify import Sealing, sealing_of
from logger.core.runfile.writer import RunWriter

__all__ = [
    "FLOOR_BYTES",
    "SOMETHING_LOST",
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
    "recover",
    "sealing_of",
    "unfinished",
]
