"""Words by which a modem names its maker, model and firmware, without the numbers of the device."""

import re

from logger.drivers.privacy.patterns import (
    NOISE,
    mask_digits,
    mask_labelled,
    mask_noise,
    mask_text,
)
from logger.drivers.reading.interruption import names_of
from logger.drivers.registry import FAMILIES, IDENTITY

COMMANDS = frozenset(command.encode() for command in IDENTITY)
NAMES = frozenset(name.encode() for name in names_of(" ".join(IDENTITY)))
"""Names in front of some answers to them."""
_DIGIT = re.compile(rb"[0-9]")
_CLAIMS = tuple(family.claim for family in FAMILIES.values())
_LABEL = re.compile(rb"([A-Za-z][A-Za-z /]*|[A-Z_]+)[ ]?[:=](?![0-9]{2}:)")
_LABELS = frozenset((b"manufacturer", b"model", b"revision", b"firmware", b"version"))
_DATE = rb"20[0-9]{2}/[0-9]{2}/[0-9]{2}(?: [0-9]{2}:[0-9]{2}:[0-9]{2})?"
_NUMBERS = re.compile(
    rb"(?<![0-9A-Za-z])" + _DATE + rb"(?![0-9])"
    rb"|(?<![0-9A-Za-z])[0-9]+(?:[" + NOISE + rb" ./()_-]{1,2}[0-9]+)*"
    rb"|[0-9]{6,}"
)
_VERSION = re.compile(
    rb"(?!(?:[0-9]{3}\.)+[0-9]{3}\Z)(?!(?:[0-9]{2}\.){4})[0-9]{1,3}(?:\.[0-9]{1,3}){1,4}"
    rb"|[0-9]{5}\.[0-9]{4}(?:\.[0-9]{2}){4}|" + _DATE
)
"""Numbers of a version, in which a telephone number or an IMEI has no place."""
_LONGEST_OF_IDENTITY = 120
_MOST_OF_MODEL = 5
"""Digits in a row, or in groups, in the name of a model or its firmware."""
_NAME_OF_MODEL = re.compile(
    rb"(?!(?:.*?(?<![^ ])[0-9]){2}|(?:[0-9]{1,3}\.){3}[0-9]{1,3}\Z)"
    rb"[0-9A-Za-z][0-9A-Za-z ._,+&-]{0,47}"
)
"""A line of few words, one of them at most with a digit in front; no address of a network."""
_SURE_NAME = re.compile(rb"(?=.*[0-9])(?![0-9A-F]{8,}\Z)[0-9A-Z]*[A-Z][0-9A-Z._-]{1,23}")
"""One word of capitals and digits, which is no message in hexadecimal digits."""
_MAKER = re.compile(
    rb"\b(?:quectel|simcom|telit|u-?blox|cinterion|gemalto|thales|siemens|sierra|huawei|fibocom"
    rb"|neoway|meig|zte|nokia|sequans|nordic|qualcomm|mediatek|unisoc|asr)(?:_|\b)",
    re.IGNORECASE,
)


def words_of_model(line: bytes, *, is_sure: bool) -> bytes | None:
    """A line of a reply to ATI and its like, without the numbers of the device.

    None where it names something else than maker, model and firmware. A line that may belong to a
    message (not `is_sure`) has to look like a name of a model, or to contain that of a maker.
    """
    if len(line) > _LONGEST_OF_IDENTITY:
        return None
    labels = list(_LABEL.finditer(line))
    n_known = sum(label[1].split()[-1].lower() in _LABELS for label in labels)
    if n_known < len(labels):
        other = labels[n_known].start()
        kept = words_of_model(line[:other], is_sure=is_sure) if n_known else None
        return None if kept is None else kept + mask_text(line[other:])
    kept = without_device_numbers(line)
    name = line.strip(b' \t"')
    form = _NAME_OF_MODEL if is_sure else _SURE_NAME
    if labels or (kept == line and form.fullmatch(name)) or _MAKER.search(name):
        return mask_noise(mask_labelled(kept))
    is_claimed = any(claim.rank(kept.decode("latin-1")) for claim in _CLAIMS)
    return mask_noise(mask_labelled(kept)) if is_claimed else None


def without_device_numbers(text: bytes) -> bytes:
    """The text without numbers that are no part of a version or of the name of a model."""
    return _NUMBERS.sub(_part_of_name, text)


def _part_of_name(number: re.Match[bytes]) -> bytes:
    is_model = len(_DIGIT.findall(number[0])) <= _MOST_OF_MODEL
    return number[0] if is_model or _VERSION.fullmatch(number[0]) else mask_digits(number[0])
