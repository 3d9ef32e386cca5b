"""The hash chain over the frames of a run, which lets a third party detect any change.

    digest 0 = 32 zero bytes
    digest n+1 = SHA-256(digest n | number u32 | kind u8 | payload), little-endian

The payload is taken before it is compressed, so that journal and HDF5 give the same digest. There
is no key: the chain proves that a run is the one whose digest was noted elsewhere, not who recorded
it.
"""

import struct
from hashlib import sha256

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
