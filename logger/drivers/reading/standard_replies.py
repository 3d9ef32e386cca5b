"""Replies of 3GPP TS 27.007, which all modems print: registration, networks, levels, errors."""

import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from logger.drivers.reading.row_language import (
    CSQ_OF_INDEX,
    ECN0_OF_INDEX,
    RAT_OF_ACT,
    RSCP_OF_INDEX,
    RSRP_OF_INDEX,
    RSRQ_OF_INDEX,
    RXLEV_OF_INDEX,
    NumberForm,
    Operator,
    Refusal,
    Registration,
    Row,
    Signal,
    area,
    at,
    cell_identity,
    decimal,
    values,
)

_VALUE = r'(?:"[^"+]*"?|[0-9A-Fa-f]*(?: [0-9A-Fa-f]+(?=\s*,))*)'
_REGISTRATION = re.compile(
    rf"\+(CREG|CGREG|CEREG|C5GREG):\s*({_VALUE}(?:[ \t]*,[ \t]*{_VALUE})*)", re.ASCII
)
"""The values end where something else begins: another answer in the same line, or text of a log."""
_AFTER_VALUE = re.compile(r"[\s+\\)\]},;\'<|]|\Z")
"""What may follow the last value; anything else is noise, which took the end of the value."""
_LEADING_TWO = re.compile(r"\s*\d{1,3}\s*,\s*\d{1,3}\s*(?:,|\Z)")
"""An answer begins with two small numbers, a report with one: `+CREG: 1,"CE00","00005449"` is a
report.
"""
_CSQ = re.compile(r"\+CSQ:\s*(\d{1,2}),\s*(\d{1,2})(?!\d)")
_CESQ = re.compile(r"\+CESQ:\s*(\d{1,3}(?:,\s*\d{1,3}){5})(?!\d)")
_ERROR = re.compile(r"\+CM[ES] ERROR:\s*(?:(\d+)|([^\s\\][^\\]*?))\s*(?:\\.*)?\Z")
_CHOSEN = re.compile(r'\+COPS:\s*[0-4],\s*([0-2]),\s*"([^"]*)"(?:,\s*(\d{1,2})(?!\d))?')
_NAME = r'\s*(?:"([^"]*)"|([^",()]*))\s*,'
_OFFERED = re.compile(
    r"\(\s*([0-3])\s*," + _NAME + _NAME + r'\s*"?(\d{5,7})"?\s*(?:\)?\s*,\s*(\d{1,2})(?=\s*\)))?',
    re.ASCII,
)
"""A network of AT+COPS=?; lists close the bracket early, lack quotes and names, and break lines."""

_MOST_STAT, _WIDEST_STAT = 11, 3
_CAUSE_TYPES = frozenset({0, 1})
_CELL, _NR_CELL = NumberForm(16, frozenset({4, 7, 8})), NumberForm(16, frozenset({9, 16}))
"""A registration prints the cells of all technologies in one field, GSM with four digits."""


def standard_rows(lines: Sequence[str]) -> tuple[Row, ...]:
    """Rows in lines of the standard forms, those of one kind after the other within each line."""
    rows = (row for line in lines for reader in _READERS for row in reader(line))
    return (*rows, *_offered_networks("\n".join(lines)))


def _registrations(line: str) -> Iterator[Row]:
    for found in _REGISTRATION.finditer(line):
        domain, text = found.groups()
        answers = _LEADING_TWO.match(text) is not None
        fields = values(text)
        if text.count('"') % 2 or not _AFTER_VALUE.match(line, found.end()):
            fields[-1] = ""  # cut
        n, *fields = fields if answers else ["", *fields]
        stat = decimal(fields[0], 0, _MOST_STAT) if len(fields[0]) <= _WIDEST_STAT else None
        if stat is None:
            continue
        if not at(fields, 1) and at(fields, 2):
            fields[2:3] = [""]  # a cell never comes without its area: a comma stands twice
        act = decimal(at(fields, 3).rstrip("])"), 0, 15)
        bits, form = (36, _NR_CELL) if domain == "C5GREG" else (28, _CELL)
        cid = cell_identity(at(fields, 2), bits, form=form)
        where: dict[str, Any] = {
            "lac" if domain in {"CREG", "CGREG"} else "tac": area(at(fields, 1), bits=24)
        }
        yield Registration(
            domain,
            stat,
            rat=None if act is None else RAT_OF_ACT.get(act),
            n=decimal(n),
            cid=cid,
            act=act,
            **where,
            **_reject_cause(domain, fields),
        )


def _reject_cause(domain: str, fields: list[str]) -> dict[str, Any]:
    """Why the network refused the modem, printed where <n> is 3 (27.007 7.2, 10.1.20, 10.1.22)."""
    at_type = {"CREG": 4, "CEREG": 4, "CGREG": 5}.get(domain)
    if at_type is None or len(fields) < at_type + 2:
        return {}
    kind, cause = (decimal(field, 0, 255) for field in fields[at_type : at_type + 2])
    if kind not in _CAUSE_TYPES or cause is None:
        return {}
    return {"reject_cause_type": kind, "reject_cause": cause}


def _quality(line: str) -> Iterator[Row]:
    for level, errors in _CSQ.findall(line):
        raw = decimal(level, 0, 31)
        yield Signal(csq_raw=raw, ber=decimal(errors, 0, 7), rssi_dbm=CSQ_OF_INDEX.value_at(raw))


def _extended_quality(line: str) -> Iterator[Row]:
    """+CESQ (27.007 8.69): an index for each technology, those not in use 99 or 255."""
    for text in _CESQ.findall(line):
        rxlev, ber, rscp, ecn0, rsrq, rsrp = (int(value) for value in values(text))
        signals = (
            Signal(
                "GSM",
                ber=ber if ber <= 7 else None,
                rssi_dbm=RXLEV_OF_INDEX.value_at(rxlev),
                more={"rxlev_raw": rxlev},
            ),
            Signal(
                "WCDMA",
                rscp_dbm=RSCP_OF_INDEX.value_at(rscp),
                ecio_db=ECN0_OF_INDEX.value_at(ecn0),
                more={"rscp_raw": rscp, "ecn0_raw": ecn0},
            ),
            Signal(
                "LTE",
                rsrp_dbm=RSRP_OF_INDEX.value_at(rsrp),
                rsrq_db=RSRQ_OF_INDEX.value_at(rsrq),
                more={"rsrp_raw": rsrp, "rsrq_raw": rsrq},
            ),
        )
        for signal in signals:
            if (signal.rssi_dbm, signal.rscp_dbm, signal.rsrp_dbm) != (None, None, None):
                yield signal


def _refusals(line: str) -> Iterator[Row]:
    match = _ERROR.search(line)
    if match:
        yield Refusal(code=int(match[1]) if match[1] and len(match[1]) < 6 else None, text=match[2])


def _chosen_network(line: str) -> Iterator[Row]:
    for form, text, act in _CHOSEN.findall(line):
        number = decimal(act, 0, 15)
        rat = None if number is None else RAT_OF_ACT.get(number)
        named = {"plmn" if form == "2" else "name": text}
        yield Operator(rat, act=number, **named)


def _offered_networks(text: str) -> Iterator[Row]:
    for stat, long, plain_long, short, plain_short, plmn, act in _OFFERED.findall(text):
        number = decimal(act, 0, 15)
        rat = None if number is None else RAT_OF_ACT.get(number)
        names = (
            quoted or plain.strip() for quoted, plain in ((long, plain_long), (short, plain_short))
        )
        yield Operator(rat, int(stat), next(names), next(names), plmn=plmn, act=number)


_READERS: tuple[Callable[[str], Iterator[Row]], ...] = (
    _registrations,
    _quality,
    _extended_quality,
    _refusals,
    _chosen_network,
)
