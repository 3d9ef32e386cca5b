"""Personal numbers in text of any form, and masks of the same length.

IMEI and IMSI have 15 digits, IMEISV 16 (3GPP TS 23.003), a SIM 18 to 22 (ITU-T E.118). Telephone
numbers are shorter: a plus, groups, quotes or their type show them (3GPP TS 27.007). This is the
second look at lines whose form is known (`rows`), and the only one at text of the program itself.
"""

import re

# gpsd prints decimals to the last bit; 0x begins a mask; binary data has a byte many times over
_LONG = rb"(?<![0-9]\.)(?<![0-9xX])(?!(?P<same>[0-9])(?P=same)*(?![0-9]))[0-9]{15,}"
_IMEI = (
    rb"(?<![0-9])(?:(?:[0-9]{2}(?P<a>[ ./-])[0-9]{6}(?P=a)[0-9]{6}"
    rb"|[0-9]{6}(?P<b>[ ./-])[0-9]{2}(?P=b)[0-9]{6})"
    rb"(?:[ ./-][0-9]{1,2})?|[0-9]{8}(?P<d>[ ./-])[0-9]{6}(?P=d)[0-9]{1,2}"
    rb"|[0-9]{8}[ ./-][0-9]{7}|[0-9]{7}[ ./-][0-9]{8})(?![0-9])"
)
# a number that is a time of Unix after the networks' code would be taken for one, so these are left
# out
_IMSI = (
    rb"(?<![0-9])[2-7](?:[0-9]{2}(?P<c>[ ./-])[0-9]{2,3}(?P=c)[0-9]{9,10}"
    rb"|[0-9]{4}[ ./-](?!1[5-9])[0-9]{10})(?![0-9])"
)
_SIM = rb"(?<![0-9A-Za-z])89[0-9]{2}[0-9A-Fa-f]{14,18}(?![0-9A-Za-z])"
_SIM_GROUPED = (
    rb"(?<![0-9])(?:89[0-9]{2}|8[0-9]{3}|98[0-9]{2})(?:[ ./-][0-9]{2,4}){3,7}"
    rb"(?:[ ./-]?[0-9A-F]{1,4})?(?![0-9])"
)
# a cell's name has the same dashes, and four groups at most; a time may have more
_DASHED = rb"(?<![0-9-])(?!(?:19|20)[0-9]{2}-[01][0-9]-)(?:[0-9]{2,5}-){4,9}[0-9]{1,5}(?![0-9-])"
_INTERNATIONAL = rb"\+[0-9](?:[ ()./-]{0,2}[0-9]){7,}"
_NATIONAL = rb"(?<![0-9.,A-Za-z:])0(?:0[1-9][0-9]{7,12}|[1-9][0-9]{9,12})(?![0-9.])"
# an area code in brackets or a leading 0, and two groups more; four groups of dots would be an
# address of a network
_AREA_CODE = (
    rb"\([0-9]{2,5}\)[ ]?[0-9]{3,4}[ ./-][0-9]{3,5}(?![0-9])"
    rb"|(?<![0-9.,A-Za-z:])0[1-9][0-9]{1,3}\.[0-9]{3}\.[0-9]{3,5}(?![0-9.])"
    rb"|(?<![0-9.-])[2-9][0-9]{2}(?P<e>[.-])[0-9]{3}(?P=e)[0-9]{4}(?![0-9])"  # of North America
)
_NATIONAL_GROUPED = (
    rb"(?<![0-9.,A-Za-z:])\(?0[1-9][0-9]{1,4}\)?[/-][ ]?[0-9]{2,}(?:[ /-][0-9]{2,}){0,4}(?![0-9.])"
)
# no time, no decimal
_QUOTED = (
    rb'(?<=")(?!(?:19|20)[0-9]{12}"|[0-9]{1,3}\.[0-9]{4,}")'
    rb'\(?[0-9](?:[ ()./*#-]{0,2}[0-9]){9,}(?=["\r\n]|\Z)'
)
# 27.007 writes the type of an address (129 national, 145 international, ...) behind the number
_TYPED = rb'(?<=")[0-9*#][0-9 ()./*#-]{2,}(?="[ ]?,[ ]?(?:128|129|145|161|177|208)\b)'

_NUMBER = re.compile(
    b"|".join(
        (
            _LONG,
            _IMEI,
            _IMSI,
            _SIM,
            _SIM_GROUPED,
            _DASHED,
            _INTERNATIONAL,
            _NATIONAL,
            _NATIONAL_GROUPED,
            _AREA_CODE,
            _QUOTED,
            _TYPED,
        )
    )
)
_LABEL = re.compile(
    rb"(?<![A-Za-z])(?:IMEI(?:[ _-]?SV)?|IMSI|U?ICCID|CCID|MSISDN|MEID|ESN|FSN|PIN|PUK"
    rb"|phone|caller|calling|tel|subscriber"
    rb"|(?:serial|phone|own|SIM|mobile)[ _-]?(?:number|no\.?|nr\.?))(?![A-Za-z])",
    re.IGNORECASE,
)
"""Words before such a number; the digits to the end of the line are masked."""

NOISE = rb"\x00-\x08\x0b-\x1f\x7f-\xff"
"""Bytes that are no text, for a class of a pattern."""
_DIGIT = re.compile(rb"[0-9]")
_NOISE_TO_MASK = bytes.maketrans(bytes(range(0x80, 0x100)), b"\xff" * 128)
_TEXT_TO_MASK = bytes.maketrans(
    bytes(range(0x80, 0x100)) + b"0123456789abcdefghijklmnopqrstuvwyzABCDEFGHIJKLMNOPQRSTUVWXYZ",
    b"\xff" * 128 + b"x" * 61,
)


def mask_digits(data: bytes) -> bytes:
    """The same with an x for each digit."""
    return _DIGIT.sub(b"x", data)


def mask_text(data: bytes) -> bytes:
    """The same with an x for each letter and digit, and FF for bytes of other alphabets.

    What was line noise to a framer, or text, still is.
    """
    return data.translate(_TEXT_TO_MASK)


def mask_noise(data: bytes) -> bytes:
    """The same with FF for each byte that is no ASCII."""
    return data.translate(_NOISE_TO_MASK)


def mask_numbers(data: bytes) -> bytes:
    """The same line with an x for each digit of what looks like a number of a person or device."""
    return _NUMBER.sub(lambda number: mask_digits(number[0]), data)


def mask_labelled(data: bytes) -> bytes:
    """The same, also for the digits behind a word that names such a number."""
    label = _LABEL.search(data)
    if label:
        data = data[: label.end()] + mask_digits(data[label.end() :])
    return mask_numbers(data)
