"""Lines with secrets (`secret_lines`) whose numbers are drawn anew for each.

`Planted` knows each secret byte, so that a test can look at what became of it, wherever the line
was planted and whatever the line has done to it.
"""

import random
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Self

from tests.kit.secret_lines import WORDS

_FIELD = re.compile(r"\{(\w+)(?::([^}]*))?\}")


@dataclass
class Planted:
    """Bytes, and which of them are secret: 0 for none, else the number of the secret."""

    data: bytes = b""
    marks: tuple[int, ...] = ()

    def __add__(self, other: Self) -> "Planted":
        first = max(self.marks, default=0)
        marks = tuple(mark and mark + first for mark in other.marks)
        return Planted(self.data + other.data, self.marks + marks)

    def secrets(self) -> Iterator[bytes]:
        """The secrets themselves, of those that cannot be there by chance."""
        for n in range(1, max(self.marks, default=0) + 1):
            text = bytes(b for b, mark in zip(self.data, self.marks, strict=True) if mark == n)
            if len(text) > 6 or text.decode("latin-1") in WORDS:
                yield text

    def with_noise(self, rng: random.Random, n: int) -> "Planted":
        """The same after noise has come in between, has replaced bytes, or bytes were lost."""
        data, marks = bytearray(self.data), list(self.marks)
        for _ in range(n):
            at = rng.randrange(len(data))
            way = rng.randrange(3)
            if way == 0:
                data.insert(at, rng.randrange(256))
                marks.insert(at, 0)
            elif way == 1:
                data[at], marks[at] = rng.randrange(256), 0
            else:
                del data[at], marks[at]
        return Planted(bytes(data), tuple(marks))

    def readable(self, out: bytes, most: int = 0) -> list[bytes]:
        """Secrets of which more than `most` letters and digits are left in the redacted bytes."""
        assert len(out) == len(self.data)
        left: dict[int, bytes] = {}
        for before, mark, after in zip(self.data, self.marks, out, strict=True):
            if mark and after == before and chr(after).isalnum() and after not in b"xX\xff":
                left[mark] = left.get(mark, b"") + bytes((after,))
        return [text for text in left.values() if len(text) > most]


def plain(data: bytes) -> Planted:
    """Bytes without a secret."""
    return Planted(data, (0,) * len(data))


def plant(form: str, rng: random.Random) -> Planted:
    """A line of the form with numbers of its own."""
    text = _FIELD.sub(lambda field: _in_groups(_NUMBERS[field[1]](rng), field[2]), form)
    data, marks, n, is_secret = bytearray(), [], 0, False
    for char in text:
        if char in "«»":
            is_secret = char == "«"
            n += is_secret
        else:
            data += char.encode("latin-1")
            marks.append(n if is_secret else 0)
    return Planted(bytes(data), tuple(marks))


def _digits(rng: random.Random, n: int, first: str = "123456789") -> str:
    return rng.choice(first) + "".join(rng.choices("0123456789", k=n - 1))


_NUMBERS: dict[str, Callable[[random.Random], str]] = {
    "imei": lambda rng: "35" + _digits(rng, 13),
    "imei14": lambda rng: "35" + _digits(rng, 12),
    "imsi": lambda rng: "26201" + _digits(rng, 10),
    "sim": lambda rng: "8949" + _digits(rng, 15),
    "national": lambda rng: _digits(rng, 3, "23456789") + _digits(rng, 7, "23456789"),
    "home": lambda rng: "0176" + _digits(rng, 8),
    "abroad": lambda rng: "49176" + _digits(rng, 8),
    "pin": lambda rng: _digits(rng, 4, "3456789"),
    "serial": lambda rng: rng.choice("KLMNP") + rng.choice("HJKLM") + _digits(rng, 9),
    "mac": lambda rng: ":".join(f"{rng.randrange(16, 256):02x}" for _ in range(6)),
    "hex": lambda rng: rng.randbytes(12).hex().upper(),
    "ucs2": lambda rng: _digits(rng, 10).encode("utf-16-be").hex().upper(),
    "imsi_swapped": lambda rng: "0829" + _semi_octets("26201" + _digits(rng, 10)),
    "sim_swapped": lambda rng: _semi_octets("8949" + _digits(rng, 15)),
    "pdu": lambda rng: (
        f"0791{_semi_octets('49176' + _digits(rng, 8))}040D91{rng.randbytes(20).hex().upper()}"
    ),
}


def _semi_octets(digits: str) -> str:
    """Semi-octets, as in a PDU and on a SIM."""
    digits += "F" * (len(digits) % 2)
    return "".join(digits[i + 1] + digits[i] for i in range(0, len(digits), 2))


def _in_groups(digits: str, groups: str | None) -> str:
    """The digits in groups: `3 3 4` gives `415 555 1234`."""
    if groups is None:
        return digits
    out = ""
    for part in re.findall(r"\d+|\D+", groups):
        if part.isdecimal():
            out, digits = out + digits[: int(part)], digits[int(part) :]
        else:
            out += part
    return out + digits
