"""The run file: a journal while recording, plain HDF5 afterwards, read through one function.

The only part of `core` that touches files, and the only one of the logger that imports h5py.
"""

from logger.core.runfile.finish import convert_journal, finish_journal, journal_path, unfinished
from logger.core.runfile.meta import Damage, RunEnd, RunMeta, Truth
from logger.core.runfile.run import Run, read_run
from logger.core.runfile.writer import RunWriter

__all__ = [
    "Damage",
    "Run",
    "RunEnd",
    "RunMeta",
    "RunWriter",
    "Truth",
    "convert_journal",
    "finish_journal",
    "journal_path",
    "read_run",
    "unfinished",
]
