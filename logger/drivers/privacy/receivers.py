"""NMEA 0183 sentences and gpsd reports, of which numbers and the texts that are read remain."""

import re
from functools import reduce
from operator import xor

from logger.drivers.privacy.identity import without_device_numbers
from logger.drivers.privacy.patterns import (
    mask_digits,
    mask_labelled,
    mask_numbers,
    mask_text,
)

_DIGIT = re.compile(rb"[0-9]")
_FIELD = rb"(?:-?[0-9]{0,6}(?:\.[0-9]{0,9})?|[A-Z]{1,2}[0-9]{0,2}|[0-9A-F]{1,2}|[ADEFMNPRS]{3,6})"
_FIELD_FORM = re.compile(_FIELD)
SENTENCE = re.compile(rb"\$[A-Z][A-Z0-9]{2,9},[ -#%-)+-~]*(?:\*[0-9A-Fa-f]{0,2})?")
"""A sentence of NMEA 0183, or what is left of one."""
_NUMBERS_ALONE = re.compile(
    rb"\$[A-Z][A-Z0-9]{2,9}(?>," + _FIELD + rb"(?=[,*]|\Z))++(?:\*[0-9A-Fa-f]{0,2})?"
)

REPORT = re.compile(rb"[ \t\r]*\{\"class\":")
"""The beginning of a report of gpsd."""
_JSON = re.compile(
    rb"\"((?:[^\"\\]|\\.)*)(\"?)([ ]*:)?|[0-9]+(?:\.[0-9]+)?(?:e[+-]?[0-9]+)?|[a-z_\x80-\xff]+",
    re.IGNORECASE,
)
_KEY = re.compile(rb"[A-Za-z][A-Za-z0-9_]{0,15}")
_KEPT_TEXTS = frozenset(b"class device path driver time activated release message".split())
_ESCAPE = re.compile(rb"\\u[0-9A-Fa-f]{4}|\\.|[0-9A-Za-z\x80-\xff]")
_MOST_OF_REPORT = 7
"""Digits before the point: metres from the centre of the Earth."""


def sentence(data: bytes) -> bytes:
    """A sentence with its numbers; where a text is masked, the checksum is that of what is left."""
    if _NUMBERS_ALONE.fullmatch(data):
        return data
    body, star, checksum = data.partition(b"*")
    address, *values = body.split(b",")
    text = _receiver_text if address.endswith(b"TXT") else mask_text
    kept = b",".join(
        [address, *(one if _FIELD_FORM.fullmatch(one) else text(one) for one in values)]
    )
    if len(checksum) == 2 and reduce(xor, body[1:]) == int(checksum, 16):
        checksum = b"%02X" % reduce(xor, kept[1:])
    return kept + star + checksum


def _receiver_text(text: bytes) -> bytes:
    """What a receiver says of itself, without its numbers."""
    return mask_labelled(without_device_numbers(text))


def report(line: bytes) -> bytes:
    """A report of gpsd with its numbers; of its texts only those that are read."""
    key = b""

    def value_of(found: re.Match[bytes]) -> bytes:
        nonlocal key
        text, value = found[0], found[1]
        if value is None:
            if not text[:1].isdigit():
                return text if text in {b"true", b"false", b"null"} else mask_text(text)
            is_long = len(text.partition(b".")[0]) > _MOST_OF_REPORT and key not in _KEPT_TEXTS
            return _DIGIT.sub(b"1", text) if is_long else text
        if found[3] and _KEY.fullmatch(value):
            key = value
            return text
        if not found[3] and key in _KEPT_TEXTS:
            return mask_digits(text) if key == b"message" else mask_numbers(text)
        masked = _ESCAPE.sub(lambda escape: b"x" * len(escape[0]), value)
        return b'"' + masked + found[2] + (found[3] or b"")

    return _JSON.sub(value_of, line)
