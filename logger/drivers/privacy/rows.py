"""Rows of cells and levels, and reports, which have no place for a person or a device.

The name in front of a row shows its form (`+CENG:`), or the command that the row answers (AT+COPS=5
prints `MCC:262, MNC:01`); both are declared by the drivers. A row has short numbers, words where a
value begins, and names of networks in some. What breaks the form is masked, with all that follows
it in the row.
"""

import re
from collections.abc import Iterable
from operator import and_, or_

from logger.drivers.privacy.patterns import NOISE, mask_digits, mask_noise, mask_numbers, mask_text
from logger.drivers.reading.interruption import names_of
from logger.drivers.registry import FAMILIES

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
    for numbers in (
        {"+C5GREG": "0[0-9A-F]{9,15}"},  # a cell of NR has 36 bits, printed with zeros before
        *(family.long_numbers for family in FAMILIES.values()),
    )
    for name, pattern in numbers.items()
}
_EXACT = {
    b"+CSQ": rb"[ ]*[0-9]{1,3}(?:,[ ]*[0-9]{1,3})?",
    b"+CESQ": rb"[ ]*[0-9]{1,3}(?:,[ ]*[0-9]{1,3}){0,5}",
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
"""The beginning of a row or of a command, also in the middle of a line that has lost its end."""

_TOKEN = re.compile(rb"[0-9A-Za-z_]+(?:[" + NOISE + rb"]+[0-9A-Za-z_]+)*")
"""A number or a word, with the noise in it: a byte 0 hides no number."""
_IS_NOISE = re.compile(rb"[" + NOISE + rb"]")
_CONTROL = re.compile(rb"[\x00-\x08\x0b-\x1f\x7f]")
_NETWORK_NAME = re.compile(rb"\"[^\"]*(?:\"|\Z)")
_NETWORK_CODE = re.compile(rb"\"[0-9]{5,7}\"|\"[0-9]{3} [0-9]{2,3}\"")
_MOST_OF_NETWORK = 5
"""Digits in the name of a network: 242 01 Telenor."""
_GROUPS = re.compile(rb"[0-9]+(?:[ " + NOISE + rb"]{1,2}[0-9]+)+")
_DIGIT = re.compile(rb"[0-9]")
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
    return mask_numbers(_values(name, body))


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
        is_alone = between[-1:] in b',"' and body[token.end() : token.end() + 1] in b',".'
        if goes_on or _is_number(text, most_digits, _LONGER.get(name) if is_alone else None):
            out += [between, text]
        elif _MANY_LETTERS.search(text) and not (begins and has_networks):
            break
        else:
            out += [between, mask_text(text)]
        end = token.end()
    return b"".join(out) + mask_text(body[end:])


def _without_telephone_number(found: re.Match[bytes]) -> bytes:
    """The name or code of a network as it came, where it is one."""
    is_name = sum(map(found[0].count, _DIGITS)) <= _MOST_OF_NETWORK
    return found[0] if is_name or _NETWORK_CODE.fullmatch(found[0]) else mask_digits(found[0])


def _without_long_groups(found: re.Match[bytes]) -> bytes:
    """Groups of digits as they came where they are no telephone number."""
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
_ANYWHERE = frozenset((b"ok", b"error", b"dbm"))
_COLON = re.compile(rb"[ ]?(?:\(dBm?\))?[ ]?:", re.IGNORECASE)
_COLUMNS = re.compile(rb"[0-9A-Za-z)-](?:[ ]{2}|\t| -[0-9])|\A[ \t]+[0-9]")
_CARRIER = re.compile(rb"\s*[0-9]{1,6},-[0-9]{2,3}\s*")
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
    words = _ANYWHERE.union(*(_WORDS[name] for name in commands))
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
