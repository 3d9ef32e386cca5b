"""The hash chain over the frames of a run, and what it says of a run that is read.

    digest 0 = 32 zero bytes
    digest n+1 = SHA-256(digest n | number u32 | kind u8 | payload), little-endian

The payload is taken before it is compressed, so that journal and HDF5 give the same digest. There
is no key: the chain proves that a run is the one whose digest was noted elsewhere, not who recorded
it. A third party needs nothing but the file in either form.
"""

import struct
from dataclasses import dataclass, field
from hashlib import sha256

from logger.core.runfile.frames import Kind
from logger.core.runfile.meta import Damage, RunEnd, stop_text

_LINK = struct.Struct("<IB")


class Chain:
    """A hash chain fed with frames in the order of their numbers.

    `broken_at` is the first missing number.
    """

    def __init__(self) -> None:
        self._digest = bytes(32)
        self._expected = 0
        self.broken_at: int | None = None

    @property
    def digest(self) -> str:
        """Digest of all frames so far, hexadecimal."""
        return self._digest.hex()

    def add(self, number: int, kind: int, payload: bytes) -> None:
        if number != self._expected and self.broken_at is None:
            self.broken_at = self._expected
        self._expected = number + 1
        self._digest = sha256(self._digest + _LINK.pack(number, kind) + payload).digest()


@dataclass(frozen=True, slots=True)
class Sealing:
    """Results of the hash chain of a run.

    `recomputed_digest` covers the frames before the END frame, or all frames without one. `surplus`
    names a table of the HDF5 file with rows that are in no frame, `differences` everything else
    that differs from the chained frames; `stop_is_sealed` is False for a run of an earlier version,
    whose chain leaves the stop out. `continues` is whether the run begins with all of the one that
    was asked for.
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
        """True when the run was sealed and all frames are as they were then."""
        if self.end is None or self.broken_at is not None or self.surplus:
            return False
        return self.recomputed_digest == self.end.digest

    @property
    def chain_alteration(self) -> str:
        """What the chain shows to have been altered; a missing frame is damage only."""
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
