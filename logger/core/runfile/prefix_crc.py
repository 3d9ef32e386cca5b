"""Checksums of many overlapping stretches of a file, in one pass over it.

A forged journal may announce 200 000 frames of 64 MB, each to be checked against its CRC: that is
hours. The CRC of any stretch follows from those of what stands before its begin and before its end
(Mark Adler's crc32_combine in zlib).
"""

from collections.abc import Sequence
from itertools import pairwise
from zlib import crc32

import numpy as np
import numpy.typing as npt

from logger.core.runfile.frames import Buffer

_STEP_BYTES = 1 << 20
_POLYNOMIAL = np.uint32(0xEDB88320)
_TOP = np.uint32(1 << 31)
_ONE = np.uint32(1)

Words = npt.NDArray[np.uint32]


def crc32_of_each(data: Buffer, starts: Sequence[int], ends: Sequence[int]) -> Words:
    """CRC-32 of `data[start:end]` for each pair."""
    offsets = sorted({*starts, *ends})
    before, crc = dict.fromkeys(offsets[:1], 0), 0
    for start, end in pairwise(offsets):
        for at in range(start, end, _STEP_BYTES):
            crc = crc32(data[at : min(at + _STEP_BYTES, end)], crc)
        before[end] = crc
    first = np.array([before[start] for start in starts], np.uint32)
    total = np.array([before[end] for end in ends], np.uint32)
    return total ^ _shift(first, np.subtract(ends, starts))


def _shift(crc: Words, n_bytes: npt.NDArray[np.int64]) -> Words:
    """CRCs after so many zero bytes each: times x^(8 n) modulo the polynomial."""
    shifted, power, left = (
        crc.copy(),
        np.uint32(1 << 23),
        n_bytes.copy(),
    )  # x^8, the highest power in the lowest bit
    while left.any():
        odd = (left & 1).astype(bool)
        shifted[odd] = _times(shifted[odd], power)
        power = _times(np.array([power]), power)[0]
        left >>= 1
    return shifted


def _times(a: Words, b: np.uint32) -> Words:
    """Products of polynomials over GF(2), bits reflected."""
    product, factor = np.zeros_like(a), a.copy()
    for bit in range(32):
        if b & (_TOP >> np.uint32(bit)):
            product ^= factor
        factor = np.where(factor & _ONE, (factor >> _ONE) ^ _POLYNOMIAL, factor >> _ONE)
    return product
