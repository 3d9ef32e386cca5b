"""Checks that a run is complete and unchanged since it was sealed.

A third party needs nothing but the file in either form.
"""

from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from logger.core.errors import RunFileError
from logger.core.runfile import hdf5_tasks
from logger.core.runfile.chain import Chain
from logger.core.runfile.frames import Kind
from logger.core.runfile.isolation import run_isolated
from logger.core.runfile.journal_reader import JournalParts
from logger.core.runfile.meta import Damage, RunEnd, stop_text
from logger.core.runfile.run_names import is_hdf5


@dataclass(frozen=True, slots=True)
class Sealing:
    """Results of the hash chain of a run.

    `recomputed_digest` covers the frames before the END frame, or all frames without one.

    `surplus` names a table of the HDF5 file with rows that are in no frame. `differences`
    lists everything else that differs from the chained frames; `stop_is_sealed` is False for a run
    of an earlier version, whose chain leaves the stop out. `continues` is whether the run begins
    with all of the one that was asked for.
    """

    end: RunEnd | None
    damage: Damage
    recomputed_digest: str
    broken_at: int | None
    surplus: str = ""
    differences: tuple[str, ...] = ()
    stop_is_sealed: bool = True
    continues: bool = False

    @property
    def holds(self) -> bool:
        """True when the run was sealed, and all frames are there as they were then."""
        if self.end is None or self.broken_at is not None or self.surplus:
            return False
        return self.recomputed_digest == self.end.digest

    @property
    def chain_alteration(self) -> str:
        """What the chain shows to have been altered; a frame that is missing is damage only."""
        if self.broken_at is not None:
            return ""
        if self.surplus:
            return f"{self.surplus} has rows that were not recorded"
        if self.end is not None and self.recomputed_digest != self.end.digest:
            return f"sealed with {self.end.digest}, recomputed {self.recomputed_digest}"
        return ""

    @property
    def alterations(self) -> tuple[str, ...]:
        """Everything that is not as it was recorded."""
        return (*filter(None, [self.chain_alteration]), *self.differences)


@dataclass(slots=True)
class Sealed:
    """A chain that keeps the STOP frame and the digest before the END frame, the last one.

    `continues` is whether it has been at the digest `earlier`.
    """

    earlier: str = ""
    continues: bool = False
    chain: Chain = field(default_factory=Chain)
    before_end: str | None = None
    stop: bytes | None = None
    n_after_end: int = 0

    def add(self, number: int, kind: int, payload: bytes) -> None:
        if self.before_end is not None:
            self.n_after_end += 1
        elif kind == Kind.END:
            self.before_end = self.chain.digest
        elif kind == Kind.STOP:
            self.stop = payload
        self.chain.add(number, kind, payload)
        if self.earlier:
            self.continues |= self.chain.digest == self.earlier

    @property
    def recomputed_digest(self) -> str:
        return self.before_end or self.chain.digest

    def differences(self, end: RunEnd | None) -> list[str]:
        """What contradicts the stated end of the run."""
        found = []
        if self.n_after_end:
            found.append(f"frames: {self.n_after_end} stand after the seal")
        if (end is None) != (self.before_end is None):
            found.append("end: it differs from the last frame")
        elif end is not None and self.stop is not None and self.stop != stop_text(end):
            found.append("end: it is not the stop that was sealed")
        return found


def sealing_of(path: Path, earlier: str = "") -> Sealing:
    """Compute the hash chain of a run again, from its journal or its HDF5.

    `earlier` is the digest of a run that may be a part of it. Raises `RunFileError`.
    """
    return _of_hdf5(path, earlier) if is_hdf5(path) else _of_journal(path, earlier)


def _of_journal(path: Path, earlier: str) -> Sealing:
    sealed = Sealed(earlier)
    parts = JournalParts(path)
    for part in parts:
        sealed.add(part.number, part.kind, part.payload)
    differences = sealed.differences(parts.end)
    if parts.end is not None and parts.end_text != msgspec.json.encode(parts.end):
        differences.append("end: it has more fields than a stop")
    return Sealing(
        parts.end,
        parts.damage,
        sealed.recomputed_digest,
        sealed.chain.broken_at,
        differences=tuple(differences),
        stop_is_sealed=parts.end is None or sealed.stop is not None,
        continues=sealed.continues,
    )


def _of_hdf5(path: Path, earlier: str) -> Sealing:
    try:
        return msgspec.convert(run_isolated(path, hdf5_tasks.sealing, earlier)[0], Sealing)
    except OSError as error:
        raise RunFileError(f"{path} cannot be read: {error.strerror}") from error
