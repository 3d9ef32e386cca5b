"""Patterns of personal numbers and texts in the output of devices, line by line.

IMEI and IMSI have 15 digits, IMEISV 16 (3GPP TS 23.003), a SIM 18 to 22 (ITU-T E.118). Data of
cells, positions and times have at most 14 digits in a row, so longer ones are redacted everywhere.
Telephone numbers are shorter: a plus, groups, quotes or the result that prints them show them
(3GPP TS 27.007, TS 27.005).
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

NUMBER = re.compile(
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
"""A number of a person or a device in any line."""

LABEL = re.compile(
    rb"(?<![A-Za-z])(?:IMEI(?:[ _-]?SV)?|IMSI|U?ICCID|CCID|MSISDN|MEID|ESN"
    rb"|phone|caller|calling|tel|subscriber"
    rb"|(?:serial|phone|own|SIM|mobile)[ _-]?(?:number|no\.?|nr\.?))(?![A-Za-z])",
    re.IGNORECASE,
)
"""Words before such a number; the digits to the end of the line are redacted."""

NAMES = frozenset(
    b"CLIP CCWA CNUM CLCC COLP CDIP CNAP DSCI SLCC CCFC CCFCU CRSL CMT CMGR CMGL CMGW QCMGR QCMGL"
    b" SMGR SMGL CDS CDU CLASS0 CUSD CUSDR CUSATP STGI CPBR CPBF CPBW CPBFEX CSCA CIMI CGSN GSN"
    b" EGMR SIMEI CCID ICCID QCCID SCID SICCID"
    b" CRSM CSIM CGLA CCHO MEID SN".split()
)
"""Results that print such numbers, names or messages, without their sign (+CCID, ^SCID)."""

MESSAGES = frozenset((b"CMT", b"CDS"))
"""A message follows in the next line, or lines, up to an empty one."""
LISTED = frozenset((b"CMGR", b"CMGL", b"QCMGR", b"QCMGL", b"SMGR", b"SMGL"))
"""The same in a reply: the message goes up to the next result."""

RESULT = re.compile(rb"[ \t]*[+^*#!$%]([A-Z][A-Z0-9]*)[ ]?:")
_PRIVATE = re.compile(rb"[+^*#!$%](?:" + b"|".join(sorted(NAMES, reverse=True)) + rb")[ ]?:")
_NEXT_RESULT = re.compile(rb"[+^*#!$%][A-Z]{2}[A-Z0-9]*[ ]?:")
"""A result that begins in the middle of a line, where something of it was lost."""
_SENTENCE = re.compile(rb"\$[A-Z][A-Z0-9]{2,7},[A-Z0-9,.-]*(?:\*[0-9A-F]{0,2})?[ \r]*")
"""One of a receiver, or its beginning, with nothing in it but numbers and capitals."""
_LONG_RUN = re.compile(rb"[0-9]{15}")

OF_DEVICE = re.compile(
    rb"[ \t]*(?:[+^*#!%][A-Z][A-Z0-9]*[ ]?:|\$[A-Z]{2}[A-Z0-9]+,|\{\"class\"|AT[+^*#!$%]"
    rb"|(?:OK|ERROR|RDY|NO CARRIER)[ \t]*\Z)"
)
"""The beginning of a line that is no message text: a result, a final code, an echo."""
_FIELD = rb"[ \t]*\"?-?(?:0x)?[0-9A-Fa-f.]{0,10}\"?[ \t]*"
ROW = re.compile(
    rb"(?:[ \t]*[A-Za-z_][\w ()/]{0,19}:[ ]*-?[\w.]+[ \t,]*){3,}\Z|"
    + _FIELD
    + b"(?:,"
    + _FIELD
    + rb"){4,}\Z"
    rb"|[ \t]*(?:-?[0-9A-Fa-f]{1,8}[ \t]+){6,}[^\r\n]{0,40}\Z"
)
"""An unnamed row of a table of cells: three named values, five fields, or seven columns."""

UNDER_WAY = re.compile(
    rb"(?:[\"+(]{0,3}[0-9+(\"][0-9A-Fa-f ()./*#+-]{0,63}[\" ,]{0,3}[0-9]{0,3})\Z"
)
"""The beginning of such a number, five times as long as one, so that no end is missed."""

_COMMAND = re.compile(
    rb"[ \t]*AT(?:\+(?:CPIN|CLCK|CPWD|CPBW|CMGS|CMGW|CSCA|CUSD)[ ]?=|D(?=[0-9+TPI\"*#]))",
    re.IGNORECASE,
)
"""Commands with a secret, which another program may send and the modem echo."""

_DIGIT = re.compile(rb"[0-9]")
_LETTERS = re.compile(rb"[0-9A-Za-z\x80-\xff]")


def mask_digits(data: bytes) -> bytes:
    """The same with an x for each digit."""
    return _DIGIT.sub(b"x", data)


def mask_text(data: bytes) -> bytes:
    """The same with an x for each letter and digit, of any alphabet."""
    return _LETTERS.sub(b"x", data)


def name_of(line: bytes) -> bytes:
    """Name of the last result in a line that prints numbers or messages, else empty."""
    found: bytes = b""
    for result in _PRIVATE.finditer(line):
        found = result[0][1:].rstrip(b" :")
    return found


def is_private(line: bytes) -> bool:
    """True for the beginning of a line that is private to its end."""
    return (
        name_of(line) != b"" or _COMMAND.match(line) is not None or LABEL.search(line) is not None
    )


def redact_line(line: bytes) -> bytes:
    """A line, or the beginning of one, with personal numbers and texts redacted."""
    if _SENTENCE.fullmatch(line) and not _LONG_RUN.search(line):
        return line
    private = _PRIVATE.search(line)
    if private:
        begun = private.end()
        following = _NEXT_RESULT.search(line, begun)
        end = following.start() if following else len(line)
        return _redact_numbers(line[:begun]) + mask_text(line[begun:end]) + redact_line(line[end:])
    command = _COMMAND.match(line)
    if command:
        return line[: command.end()] + mask_text(line[command.end() :])
    return _redact_numbers(line)


def _redact_numbers(line: bytes) -> bytes:
    label = LABEL.search(line)
    if label:
        line = line[: label.end()] + mask_digits(line[label.end() :])
    return NUMBER.sub(lambda number: mask_digits(number[0]), line)
