"""Redaction of everything that may be personal, before anything is recorded or read.

Nothing here asks for IMSI, IMEI, SIM or telephone numbers or for messages, but modems volunteer
them (ATI of a Sierra prints a serial number, +CLIP the caller, +CMT a message), each maker in its
own forms. So a line passes only where its form is known, of cells and levels or of a receiver, or
where it answers a command that was sent; of all other lines the length and the name remain. Every
port is redacted alike, since a modem may be behind any of them.
"""

import re
from collections import deque
from collections.abc import Iterable
from functools import reduce
from operator import and_, or_, xor

from logger.drivers.protocols.at import REFUSALS
from logger.drivers.protocols.line_noise import goes_on, sentences, without
from logger.drivers.reading.standard_replies import names_of
from logger.drivers.registry import FAMILIES, IDENTITY

# IMEI and IMSI have 15 digits, IMEISV 16 (3GPP TS 23.003), a SIM 18 to 22 (ITU-T E.118). Telephone
# numbers are shorter: a plus, groups, quotes or their type show them (3GPP TS 27.007). This is the
# second look at lines whose form is known, and the only one at text of the program itself.

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


COMMANDS = frozenset(command.encode() for command in IDENTITY)
NAMES = frozenset(name.encode() for name in names_of(" ".join(IDENTITY)))
"""Names in front of some answers to them."""
_CLAIMS = tuple(family.claim for family in FAMILIES.values())
_NAME_OF_IDENTITY = re.compile(rb"([A-Za-z][A-Za-z /]*|[A-Z_]+)[ ]?[:=](?![0-9]{2}:)")
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
"""A line of few words, at most one with a digit in front; no address of a network."""
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
    message (not `is_sure`) has to look like a model's name, or to contain a maker's.
    """
    if len(line) > _LONGEST_OF_IDENTITY:
        return None
    labels = list(_NAME_OF_IDENTITY.finditer(line))
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


# The name in front of a row shows its form (+CENG:), or the command that the row answers (AT+COPS=5
# prints MCC:262, MNC:01); both are declared by the drivers. A row has short numbers, words where a
# value begins, and names of networks in some. What breaks the form is masked, with all that follows
# it in the row.

_REPORTS = "+CREG +CGREG +CEREG +C5GREG +COPS +CSQ +CESQ"
"""What every family reads (`standard_replies`)."""


def _names(*texts: str) -> frozenset[bytes]:
    return frozenset(name.encode() for text in texts for name in text.split())


_COMMANDS = frozenset(
    name.encode() for family in FAMILIES.values() for name in names_of(" ".join(family.sends()))
)
_ROWS = _COMMANDS | _names(_REPORTS, *(family.other_rows for family in FAMILIES.values()))
_WITH_NETWORKS = _names("+COPS", *(family.rows_with_networks for family in FAMILIES.values()))
_IN_COLUMNS = _names(*(family.rows_in_columns for family in FAMILIES.values()))
_USUAL_DIGITS = 9
_FEWER_DIGITS = {
    **dict.fromkeys((b"+CREG", b"+CGREG", b"+CEREG"), 8),
    **dict.fromkeys((b"+COPS", b"+QOPS"), 7),
}
_LONGER = {
    name.encode(): re.compile(pattern.encode())
    for family in FAMILIES.values()
    for name, pattern in family.long_numbers.items()
}
# a row of +C5GREG with the cell in its place: 36 bits, with zeros before
_PADDED_NR_CELL = re.compile(
    rb'[ ]*[0-9](?:,[ ]*[0-9])?,[ ]*"?[0-9A-F]{1,8}"?,[ ]*"?(0{1,7}[0-9A-F]{9})"?'
    rb"[ ]*(?:\Z|,[ ]*[0-9]{1,2}(?![0-9A-Z]))",
    re.IGNORECASE,
)
_EXACT = {
    b"+CSQ": rb"[ ]*[0-9]{1,3}(?:,[ ]*[0-9]{1,3})?",
    b"+CESQ": rb"[ ]*[0-9]{1,3}(?:,[ ]*[0-9]{1,3}){0,8}",
    b"+CPIN": (
        rb"[ ]*(?:(?:NOT )?(?:READY|INSERTED)|(?:PH-)?F?(?:SIM|NET|NETSUB|SP|CORP) P[IU][NK]2?)"
    ),
    b"+CFUN": rb"[ ]*[0-9]",
    b"*ATREADY": rb"[ ]*[0-9]",
    b"^MODE": rb"[ ]*[0-9]{1,2}(?:,[0-9]{1,2})?",
    b"^RSSI": rb"[ ]*[0-9]{1,2}",
    b"+QIND": rb'[ ]*(?:"csq",[0-9]{1,2},[0-9]{1,2}|(?:SMS|PB) DONE)',
    b"+CIEV": rb'[ ]*(?:[0-9]{1,2}|"[A-Za-z]{3,9}"),[ ]*[0-9]{1,3}',
    b"+CME ERROR": rb"[ ]*(?:[0-9]{1,4}|[A-Za-z][A-Za-z ,'()/-]{0,60})",
    b"+CMS ERROR": rb"[ ]*(?:[0-9]{1,4}|[A-Za-z][A-Za-z ,'()/-]{0,60})",
}
"""Reports and results that are looked for, whoever asked."""
_EXACT_FORMS = {
    name: re.compile(form + rb"(?![0-9A-Za-z\x00-\x08\x7f-\xff])") for name, form in _EXACT.items()
}

_NAME = rb"[+^*#!$%][A-Za-z][A-Za-z0-9]+"
SEGMENT = re.compile(
    rb"(?P<row>" + _NAME + rb"(?: ERROR)?)[ ]?:"
    rb"|(?:(?<![0-9A-Za-z])AT[ ]?|;)(?P<command>[+^*#!$%][A-Za-z][A-Za-z0-9]*)",
    re.IGNORECASE,
)
"""The beginning of a row or command, also in the middle of a line."""

_TOKEN = re.compile(rb"[0-9A-Za-z_]+(?:[" + NOISE + rb"]+[0-9A-Za-z_]+)*")
"""A number or a word, with the noise in it: a byte 0 hides no number."""
_IS_NOISE = re.compile(rb"[" + NOISE + rb"]")
_CONTROL = re.compile(rb"[\x00-\x08\x0b-\x1f\x7f]")
_NETWORK_NAME = re.compile(rb"\"[^\"]*(?:\"|\Z)")
_NETWORK_CODE = re.compile(rb"\"[0-9]{5,7}\"|\"[0-9]{3} [0-9]{2,3}\"")
_MOST_OF_NETWORK = 5
"""Digits in the name of a network: 242 01 Telenor."""
_GROUPS = re.compile(rb"[0-9]+(?:[ " + NOISE + rb"]{1,2}[0-9]+)+")
_DIGITS = [b"%d" % digit for digit in range(10)]
_HEX = re.compile(rb"(?:0[xX])?([0-9A-Fa-f]+)")
_VALUE = re.compile(rb"[0-9]{1,4}(?:dBm|MHz|[A-Z])|[A-Z][0-9]{1,3}", re.IGNORECASE)
"""A number with its unit or hemisphere, a technology (4G) or a band (B7)."""
_WORD = re.compile(rb"(?=(?:[A-Za-z_]*[0-9]){0,4}[A-Za-z_]*\Z)[A-Za-z][0-9A-Za-z_]{0,23}")
_MANY_LETTERS = re.compile(rb"[A-Za-z]{3}")
_VALUE_BEGINS = re.compile(rb"[,:(\[;=][ \t]*(?:\[[ \t]*|\\?\"[ \t]*)?\Z")
_VALUE_GOES_ON = re.compile(rb"[ \t.&'/()@+-]{1,3}\Z")
_SIMPLE = re.compile(rb"[ ]*+(?:[,\"-][ ]*+|[0-9A-Fa-f]{1,9}+(?:\.[0-9]{1,9}+)?+(?=[,\"-]|\Z))*+")
"""A row of numbers alone."""


def is_row(name: bytes) -> bool:
    """Whether rows with this name, in capitals, have a form."""
    return name in _ROWS or name in _EXACT_FORMS


def row(name: bytes, body: bytes) -> bytes:
    """What follows the name of a row, masked where it breaks the form."""
    exact = _EXACT_FORMS.get(name)
    if exact is not None:
        match = exact.match(body)
        end = match.end() if match else 0
        return body[:end] + mask_text(body[end:])
    masked = mask_numbers(_values(name, body))
    cell = _PADDED_NR_CELL.match(body) if name == b"+C5GREG" else None
    return masked if cell is None else masked[: cell.start(1)] + cell[1] + masked[cell.end(1) :]


def command(name: bytes, body: bytes) -> bytes:
    """The same for a command and its arguments."""
    if name in _COMMANDS:
        return mask_numbers(_values(name, body))
    return mask_text(body)


def _values(name: bytes, body: bytes) -> bytes:
    most_digits = _FEWER_DIGITS.get(name, _USUAL_DIGITS)
    if most_digits == _USUAL_DIGITS and _SIMPLE.fullmatch(body):
        return body
    in_columns, has_networks = name in _IN_COLUMNS, name in _WITH_NETWORKS
    noise = _CONTROL if has_networks else _IS_NOISE
    if has_networks:
        body = _NETWORK_NAME.sub(_without_telephone_number, body)
    if not in_columns:
        body = _GROUPS.sub(_without_long_groups, body)
    out: list[bytes] = []
    end, goes_on = 0, False
    for token in _TOKEN.finditer(body):
        text, between = token[0], body[end : token.start()]
        begins = _VALUE_BEGINS.search(between if end else b":" + between) is not None
        # the name of a network may have letters of any alphabet between its quotation marks
        before = between.partition(b'"')[0] if has_networks else between
        if _IS_NOISE.search(before) or noise.search(text) or (b"=" in between and end):
            break
        is_word = _WORD.fullmatch(_IS_NOISE.sub(b"a", text)) is not None
        goes_on = is_word and (
            begins
            or (goes_on and _VALUE_GOES_ON.fullmatch(between) is not None)
            or (
                between[-1:] in b" \t"
                and (
                    (in_columns and (has_networks or text.isupper()))
                    or (has_networks and body.count(b'"', 0, token.start()) % 2 == 1)
                )
            )
            or between.endswith(b"\\")
        )
        after = body[token.end() :].lstrip(b" ")
        is_alone = between.rstrip(b" ")[-1:] in b',"' and after[:1] in b',".'
        if goes_on or _is_number(text, most_digits, _LONGER.get(name) if is_alone else None):
            out += [between, text]
        elif _MANY_LETTERS.search(text) and not (begins and has_networks):
            break
        else:
            out += [between, mask_text(text)]
        end = token.end()
    return b"".join(out) + mask_text(body[end:])


def _without_telephone_number(found: re.Match[bytes]) -> bytes:
    is_name = sum(map(found[0].count, _DIGITS)) <= _MOST_OF_NETWORK
    return found[0] if is_name or _NETWORK_CODE.fullmatch(found[0]) else mask_digits(found[0])


def _without_long_groups(found: re.Match[bytes]) -> bytes:
    return found[0] if sum(map(found[0].count, _DIGITS)) < 8 else mask_digits(found[0])


def _is_number(
    text: bytes, most_digits: int = _USUAL_DIGITS, longer: re.Pattern[bytes] | None = None
) -> bool:
    found = _HEX.fullmatch(text)
    if found:
        is_short = len(found[1]) <= most_digits
        return is_short or (longer is not None and longer.fullmatch(text) is not None)
    return _VALUE.fullmatch(text) is not None


_WORDS = {
    name.encode(): frozenset(words.lower().encode().split())
    for family in FAMILIES.values()
    for name, words in family.unnamed_rows.items()
}
_PADDED = {
    name.encode(): re.compile(rb"[ ]*" + pattern.encode(), re.IGNORECASE)
    for family in FAMILIES.values()
    for name, pattern in family.padded_cells.items()
}
_ANYWHERE = frozenset((b"ok", b"error", b"dbm"))
_COLON = re.compile(rb"[ ]?(?:\(dBm?\))?[ ]?:", re.IGNORECASE)
_COLUMNS = re.compile(rb"[0-9A-Za-z)-](?:[ ]{2}|\t| -[0-9])|\A[ \t]+[0-9]")
_CARRIER = re.compile(rb"\s*[0-9]{1,6} ?, ?-[0-9]{2,3}\s*")
_HEADING = re.compile(rb"[ \t]*([A-Za-z]+(?: [A-Za-z]+)*) [0-9]{1,2} ?:[ \t]*")
_NETWORK = re.compile(rb"[ \t]*,?\(|.*\"[0-9]{5,7}\"")
"""The rest of a list of networks that a line end divides."""
_OPERATOR = re.compile(rb"Operator:(\"[^\"\x00-\x1f]{0,40}\")(?=,)", re.IGNORECASE)


def commands_with_rows(names: Iterable[bytes]) -> frozenset[bytes]:
    """Those of the commands that are answered by rows without a name."""
    return frozenset(name for name in names if name in _WORDS)


def row_without_name(line: bytes, commands: Iterable[bytes]) -> bytes | None:
    """A row that answers one of the commands, masked where it breaks the form; None if it is none.

    It has numbers in columns or between commas, or behind words of the form with a colon.
    """
    for name in commands:
        if name in _PADDED and (padded := _PADDED[name].match(line)):
            zero, end = padded.span(1)
            short = row_without_name(line[:zero] + line[end:], commands)
            return None if short is None else short[:zero] + b"0" + short[zero:]
    words = _ANYWHERE.union(*(_WORDS[name] for name in commands))
    heading = _HEADING.fullmatch(line)
    if heading and words.issuperset(heading[1].lower().split()):
        return line
    if b"+COPS" in commands and _NETWORK.match(line):
        return mask_numbers(_values(b"+COPS", line))
    operator = _OPERATOR.search(line)
    if operator:
        name = _NETWORK_NAME.sub(_without_telephone_number, operator[1])
        rest = row_without_name(line[operator.end() :], commands)
        head = mask_text(line[: operator.start()]) + line[operator.start() : operator.start(1)]
        return None if rest is None else head + name + rest
    tokens = list(_TOKEN.finditer(line))
    known = [token[0].lower() in words for token in tokens]
    numbers = [not is_word and _is_number(t[0]) for t, is_word in zip(tokens, known, strict=True)]
    labels = [_COLON.match(line, token.end()) is not None for token in tokens]
    kept = all(map(or_, known, numbers)) and _is_listed(line, sum(numbers))
    if not (kept or all(known) or any(map(and_, known, labels))):
        return None
    out: list[bytes] = []
    end = 0
    for token, is_known, is_number, is_label in zip(tokens, known, numbers, labels, strict=True):
        kept = is_known if is_label else kept and (is_known or is_number)
        out += [line[end : token.start()], token[0] if is_known or kept else mask_text(token[0])]
        end = token.end()
    return mask_numbers(mask_noise(b"".join(out) + line[end:]))


def _is_listed(line: bytes, n_numbers: int) -> bool:
    """Whether numbers stand between commas or in columns, as in no telephone number."""
    return (
        (n_numbers >= 3 and line.count(b",") >= 2)
        or (n_numbers >= 5 and _COLUMNS.search(line) is not None)
        or _CARRIER.fullmatch(line) is not None
    )


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
    """A sentence with its numbers; where text is masked, the checksum fits what is left."""
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


_LONGEST = 4096
"""Bytes of a line held back for its end; noise may have no line end at all."""
_LONGEST_REPORT = 16_384
"""The same for gpsd."""
_LATE_COMMANDS = 8
"""A row without a name may be the late answer to one of so many commands."""
_DOUBTFUL_COMMANDS = 2
"""After an unknown report, plain words may be its text until so many commands were sent."""

_END = re.compile(rb"[\r\n]")
_AROUND = bytes(sorted({*range(256)} - {*range(0x21, 0x7F)}))
_PLAIN = re.compile(
    "|".join(REFUSALS).encode()
    + rb"|OK|ERROR|NO|NO CARRIER|BUSY|NO ANSWER|NO DIALTONE|CONNECT|[0-9]{1,2}|>"
    rb"|Q?RDY|QCRDY|START|RING|(?:Call|SMS) Ready|(?:SMS|PB) DONE|DST: [0-9]|NORMAL POWER DOWN"
    rb"|(?:UNDER|OVER)-VOLTAGE(?: WARN+ING| WARNNING)?(?: POWER DOWN)?|\^SYSSTART[A-Z ]{0,24}"
    rb"|AT(?:I[0-9]?|[EV][01]|&F)?",
    re.IGNORECASE,
)
"""Results, reports of a start, and commands: fixed words, and numbers of two digits."""
_DIAL = re.compile(rb"[ \t]*ATD", re.IGNORECASE)
_CAPITALS = re.compile(rb"[ \t]*[A-Z][A-Z_]{1,15}(?: SV)?(?=[ ]?[:=])")
"""The name of an unknown line (NMBR = 5551234)."""
_OF_MESSAGE = re.compile(rb"C(?:MT|MG|DS|BM)(?![ISW])|HCM|SMG|MSG|SMS", re.IGNORECASE)
"""In the names of results behind which a line of text comes."""


class Redactor:
    """Bytes of a device in, the same number out.

    An x stands for each letter and digit that may be personal. A line is held back until its end
    has come.
    """

    def __init__(self) -> None:
        self._line = b""
        self._torn = b""  # a line whose rest comes after a receiver's sentence and its line end
        self._torn_ends = 0
        self._is_masked = False  # the line's beginning was too long, and its rest is masked
        self._asks_identity = False
        self._sent: deque[bytes] = deque(maxlen=_LATE_COMMANDS)
        self._answered: frozenset[bytes] = frozenset()  # the commands whose rows have no name
        self._n_doubtful = 0  # commands to be sent until plain words are no text of a report
        self._text = ""  # "next": the next line is the text of a message, "rest": the others are

    @property
    def is_within_line(self) -> bool:
        """Whether a line has begun whose end has not come."""
        return self._line != b"" or self._is_masked

    def send(self, data: bytes) -> None:
        """Note a command: what comes may answer it."""
        command = data.strip().upper()
        if command == b"AT":
            return  # asked meanwhile, for a sign of life
        self._sent.append(command)
        names = (match["command"] for sent in self._sent for match in SEGMENT.finditer(sent))
        self._answered = commands_with_rows(names)
        self._asks_identity = command in COMMANDS
        self._n_doubtful = max(self._n_doubtful - 1, 0)

    def feed(self, data: bytes) -> bytes:
        """Redacted bytes of the lines that are over."""
        out: list[bytes] = []
        start = 0
        for end in _END.finditer(data):
            line = self._line + data[start : end.start()]
            out += [mask_text(line) if self._is_masked else self._redact(line), end[0]]
            self._line, self._is_masked = b"", False
            start = end.end()
        self._line += data[start:]
        longest = _LONGEST_REPORT if REPORT.match(self._line) else _LONGEST
        if len(self._line) > longest or self._is_masked:
            out.append(mask_text(self._line))
            self._line, self._is_masked = b"", True
        return b"".join(out)

    def flush(self) -> bytes:
        """The line held back, at the end of a connection."""
        rest = mask_text(self._line) if self._is_masked else self._redact(self._line)
        self._line, self._is_masked, self._text = b"", False, ""
        return rest

    def _redact(self, line: bytes) -> bytes:
        # joined again around a receiver's sentence and its line end
        if not line:
            self._torn_ends -= 1
            self._torn = self._torn if self._torn_ends > 0 else b""
            return line
        spans = sentences(line)
        rest = without(line, spans)
        torn = self._torn if goes_on(rest) else b""
        is_torn = bool(spans) and spans[-1][1] == len(line) and len(torn + rest) <= _LONGEST
        self._torn, self._torn_ends = torn + rest if is_torn else b"", 2
        kept = self._redact_text(torn + rest)[len(torn) :]
        for begin, end in spans:
            kept = kept[:begin] + sentence(line[begin:end]) + kept[begin:]
        return kept

    def _redact_text(self, line: bytes) -> bytes:
        if b"$" in line and SENTENCE.search(line):
            out, end = [], 0
            for found in SENTENCE.finditer(line):
                out += [self._redact_text(line[end : found.start()]), sentence(found[0])]
                end = found.end()
            return b"".join(out) + self._redact_text(line[end:])
        if REPORT.match(line):
            return report(line)
        if line.strip(_AROUND).upper() in self._sent:
            return line
        segments = list(SEGMENT.finditer(line))
        if not segments:
            return self._line_without_name(line)
        head = line[: segments[0].start()]
        out = [self._line_without_name(head) if head.strip(_AROUND) else head]
        ends = [*(segment.start() for segment in segments[1:]), len(line)]
        for segment, end in zip(segments, ends, strict=True):
            out += [segment[0], self._row_or_command(segment, line[segment.end() : end])]
        return b"".join(out)

    def _row_or_command(self, segment: re.Match[bytes], body: bytes) -> bytes:
        if segment["command"]:
            return command(segment["command"].upper(), body)
        name = segment["row"].upper()
        if is_row(name):
            self._text = ""
            return row(name, body)
        if self._asks_identity and name in NAMES:
            return words_of_model(body, is_sure=True) or mask_text(body)
        self._n_doubtful = _DOUBTFUL_COMMANDS
        if _OF_MESSAGE.search(name) or body.count(b'"') % 2:
            self._text = "next"
        return mask_text(body)

    def _line_without_name(self, line: bytes) -> bytes:
        plain = line.strip(_AROUND)
        if not plain:
            return mask_text(line)
        is_text, self._text = self._text == "next", "rest" if self._text else ""
        if _PLAIN.fullmatch(plain):
            return mask_noise(line)
        dial = _DIAL.match(line)
        if dial:
            return dial[0] + mask_text(line[dial.end() :])
        kept = None if is_text else self._answer(line)
        if kept is not None:
            return kept
        label = None if self._text or self._n_doubtful else _CAPITALS.match(line)
        self._n_doubtful = self._n_doubtful if label else _DOUBTFUL_COMMANDS
        end = label.end() if label else 0
        return line[:end] + mask_text(line[end:])

    def _answer(self, line: bytes) -> bytes | None:
        kept = row_without_name(line, self._answered) if self._answered else None
        if kept is None and self._asks_identity:
            is_sure = not (self._n_doubtful or self._text)
            kept = words_of_model(line, is_sure=is_sure)
        return kept


def redact(data: bytes, *commands: str) -> bytes:
    """What a device has sent after some commands, at once."""
    redactor = Redactor()
    for command in commands:
        redactor.send(command.encode())
    return redactor.feed(data) + redactor.flush()
