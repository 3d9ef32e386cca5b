"""Replies of 3GPP TS 27.007, which all modems print, and the serving cell that they describe."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from typing import Any, TypeGuard

from logger.core.cell_names import Identity
from logger.core.types import CARRIER_ABOVE_DB, CellReading, Rat, reportable
from logger.drivers.protocols.at import INTERRUPTION
from logger.drivers.reading.row_language import (
    CSQ_OF_INDEX,
    ECN0_OF_INDEX,
    RAT_OF_ACT,
    RSCP_OF_INDEX,
    RSRP_OF_INDEX,
    RSRQ_OF_INDEX,
    RXLEV_OF_INDEX,
    SS_RSRP_OF_INDEX,
    SS_RSRQ_OF_INDEX,
    NumberForm,
    Operator,
    Refusal,
    Registration,
    Row,
    Signal,
    area,
    at,
    cell_identity,
    confirm,
    decimal,
    network_of,
    values,
    with_identity,
)

_VALUE = r'(?:"[^"+]*"?|(?:0[xX])?[0-9A-Fa-f]*(?: [0-9A-Fa-f]+(?=\s*,))*)'
_REGISTRATION = re.compile(
    rf"\+(CREG|CGREG|CEREG|C5GREG):\s*({_VALUE}(?:[ \t]*,[ \t]*{_VALUE})*)", re.ASCII
)
"""The values end where something else begins: another answer, or text of a log."""
# what may follow the last value; anything else is noise, which took the end of the value
_AFTER_VALUE = re.compile(r"[\s+\\)\]},;\'<|]|\Z")
# an answer begins with two small numbers, a report with one: +CREG: 1,"CE00","00005449"
_LEADING_TWO = re.compile(r"\s*\d{1,3}\s*,\s*\d{1,3}\s*(?:,|\Z)")
_CSQ = re.compile(r"\+CSQ:\s*(\d{1,2}),\s*(\d{0,2})(?!\d)")  # a report may have cut the errors
_CESQ = re.compile(r"\+CESQ:\s*(\d{1,3}(?:,\s*\d{1,3}){5}(?:(?:,\s*\d{1,3}){3})?)(?!\d)")
_ERROR = re.compile(r"\+CM[ES] ERROR:\s*(?:(\d+)|([^\s\\][^\\]*?))\s*(?:\\.*)?\Z")
_CHOSEN = re.compile(
    r'\+COPS:\s*[0-4],\s*(?:([0-2]),\s*"([^"]*)"|(2),\s*(\d{5,6})(?!\d))(?:,\s*(\d{1,2})(?!\d))?',
    re.ASCII,
)
# a Wavecom prints the number of a network without quotation marks
_NAME = r'\s*(?:"([^"]*)"|([^",()]*))\s*,'
_OFFERED = re.compile(
    r"\(\s*([0-3])\s*," + _NAME + _NAME + r'\s*"?(\d{5,7})"?\s*(?:\)?\s*,\s*(\d{1,2})(?=\s*\)))?',
    re.ASCII,
)
"""A network of AT+COPS=?; lists close the bracket early, lack quotes and names, and break lines."""

_MOST_STAT, _WIDEST_STAT = 11, 3
# +CEREG reports LTE and its kin alone; elsewhere 8 may be CDMA or GSM
_RAT_OF_EPS: dict[int, Rat] = {8: "LTE-M", 9: "NB-IoT"}
_CAUSE_TYPES = frozenset({0, 1})
# a Novatel prints the routing area before the cell: +CEREG: 2,1, 1F00, 20 ,79D903 ,7
_ROUTING_AREA, _WIDE_CELL = re.compile("[0-9A-Fa-f]{1,2}"), re.compile("[0-9A-Fa-f]{4,8}")
_CELL, _NR_CELL = NumberForm(16, frozenset({4, 7, 8})), NumberForm(16, frozenset({9, 16}))
"""A registration prints the cells of all technologies in one field, GSM with four digits."""
_WIDE = NumberForm(16, frozenset({7, 8}))  # of other technologies


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
        if _ROUTING_AREA.fullmatch(at(fields, 2)) and _WIDE_CELL.fullmatch(at(fields, 3)):
            del fields[2]
        act = decimal(at(fields, 3).rstrip("])"), 0, 15)
        rats = RAT_OF_ACT | _RAT_OF_EPS if domain == "CEREG" else RAT_OF_ACT
        rat = None if act is None else rats.get(act)
        bits, form = (28, _CELL if rat in {None, "GSM"} else _WIDE)
        if domain == "C5GREG":
            bits, form = 36, _NR_CELL
        cid = cell_identity(at(fields, 2), bits, form=form)
        cause_type, cause = _reject_cause(domain, fields)
        where: dict[str, Any] = {
            "lac" if domain in {"CREG", "CGREG"} else "tac": area(at(fields, 1), bits=24)
        }
        yield Registration(
            domain,
            stat,
            rat=rat,
            n=decimal(n),
            cid=cid,
            act=act,
            reject_cause_type=cause_type,
            reject_cause=cause,
            **where,
        )


def _reject_cause(domain: str, fields: list[str]) -> tuple[int | None, int | None]:
    """Type and cause, printed where <n> is 3 (27.007 7.2, 10.1.20, 10.1.22)."""
    at_type = {"CREG": 4, "CEREG": 4, "CGREG": 5}.get(domain)
    if at_type is None or len(fields) < at_type + 2:
        return None, None
    kind, cause = (decimal(field, 0, 255) for field in fields[at_type : at_type + 2])
    return (kind, cause) if kind in _CAUSE_TYPES and cause is not None else (None, None)


def _quality(line: str) -> Iterator[Row]:
    for level, errors in _CSQ.findall(line):
        raw = decimal(level, 0, 31)
        yield Signal(csq_raw=raw, ber=decimal(errors, 0, 7), rssi_dbm=CSQ_OF_INDEX.value_at(raw))


def _extended_quality(line: str) -> Iterator[Row]:
    """+CESQ (27.007 8.69): an index for each technology, 99 or 255 if not in use."""
    for text in _CESQ.findall(line):
        rxlev, ber, rscp, ecn0, rsrq, rsrp, *nr = (int(value) for value in values(text))
        ss_rsrq, ss_rsrp, _ss_sinr = nr or (None, None, None)
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
            Signal(
                "NR",
                rsrp_dbm=SS_RSRP_OF_INDEX.value_at(ss_rsrp),
                rsrq_db=SS_RSRQ_OF_INDEX.value_at(ss_rsrq),
                more={"rsrp_raw": ss_rsrp, "rsrq_raw": ss_rsrq},
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
    for form, text, plain_form, plain, act in _CHOSEN.findall(line):
        number = decimal(act, 0, 15)
        rat = None if number is None else RAT_OF_ACT.get(number)
        named = {"plmn" if "2" in {form, plain_form} else "name": text or plain}
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


#    +QENG: "neighbourcell","GSM",262,01,1918,C851,59,118,-10      of -103
#    +CIEV: "service",1
#
# Nothing in such a row shows whether its last value is complete. So the value is dropped and its
# comma stays.

_REPLY_NAME = re.compile(r"[+*^$!#%][A-Z][A-Z0-9]*")
_PREFIX = re.compile(rf"\s*({_REPLY_NAME.pattern})\s?:", re.IGNORECASE)
_GLUED = re.compile(rf"(?<=[\w,.\"-])({_REPLY_NAME.pattern})\s?:", re.IGNORECASE)
_UNASKED = re.compile(r"\s*(?:RING|RDY|QCRDY|Call Ready|SMS Ready|SMS DONE|PB DONE|DST: .*)\s*\Z")
_RESULT = re.compile(
    r"\s*(?:OK|ERROR|\+CM[ES] ERROR\b.*|AT\b.*|AT[+^*$!#%&].*)?\s*\Z", re.IGNORECASE
)
_JOINED_OK = re.compile(r"(?<=[^\s:])\s+OK\s*\Z")
_ONLY_A_NUMBER = re.compile(r"\s*[0-9x]+\s*\Z")  # x: redacted
_LAST_VALUE = re.compile(r"[^\s,:]*\s*\Z")  # its label stays
_CLOSED = re.compile(r'(?:"[^"]*"|:)\s*\Z')
COMMON_NAMES = frozenset({"+CREG", "+CGREG", "+CEREG", "+C5GREG", "+COPS", "+CSQ", "+CESQ"})
"""Names of the replies that every family reads (`standard_replies`)."""


def names_of(commands: str) -> frozenset[str]:
    """Names whose lines answer the commands."""
    return frozenset(_REPLY_NAME.findall(commands.upper()))


def drop_cut_values(lines: Sequence[str], names: frozenset[str]) -> list[str]:
    """The lines without last values that may be cut, and without `INTERRUPTION`.

    `names` are the result names of the family (`names_of`).
    """
    # the rest of a cut number is left out: it would look whole
    parts = [part for line in lines if line.strip() for part in _parts(line, names)]
    kept: list[str] = []
    is_rest = False
    for before, line, following in zip(["", *parts], parts, [*parts[1:], ""], strict=False):
        is_cut = _interrupts(following, line, names)
        if line == INTERRUPTION:
            continue
        if not is_rest or _PREFIX.match(line):
            kept.append(_without_end(line) if is_cut else line)
        if not _interrupts(line, before, names):
            is_rest = is_cut and _ONLY_A_NUMBER.match(line) is not None
    return kept


def _parts(line: str, names: frozenset[str]) -> Iterator[str]:
    """The line, in two where a URC stands in the middle of it."""
    # a log may have joined the result to it
    line = _JOINED_OK.sub("", line)
    for glued in _GLUED.finditer(line):
        if glued[1].upper() not in names | COMMON_NAMES:
            yield from (line[: glued.start()], INTERRUPTION, line[glued.start() :])
            return
    yield line


def _interrupts(line: str, before: str, names: frozenset[str]) -> bool:
    if line == INTERRUPTION:
        return True
    prefix, own = _PREFIX.match(line), _PREFIX.match(before)
    if prefix is None:
        return _UNASKED.match(line) is not None
    name = prefix[1].upper()
    return (
        not _RESULT.match(line)
        and name not in names | COMMON_NAMES
        and not (own and own[1].upper() == name)
    )


def _without_end(line: str) -> str:
    return line if _RESULT.match(line) or _CLOSED.search(line) else _LAST_VALUE.sub("", line)


_LEVELS = frozenset(
    {"rxlev_raw", "rxq", "rssi_dbm", "rscp_dbm", "ecio_db", "rsrp_dbm", "rsrq_db", "sinr_db"}
)
_AREA_AND_CELL = ("lac", "tac", "cid")
_SIGNAL_LEVELS = ("rssi_dbm", "rscp_dbm", "ecio_db", "rsrp_dbm", "rsrq_db")
_OF_EUTRA: frozenset[Rat | None] = frozenset({"LTE", "LTE-M", "NB-IoT"})
_MOST_BETWEEN = 8  # of an index in two answers; one that has lost a digit is 9 lower at least


def is_serving(row: Row) -> TypeGuard[CellReading]:
    """True for a reading of the serving cell."""
    return isinstance(row, CellReading) and row.role == "serving"


def chosen_networks(rows: Iterable[Row]) -> Iterator[Operator]:
    """The networks that AT+COPS? names by their code, without those that a scan offers."""
    for row in rows:
        if isinstance(row, Operator) and row.stat is None and row.plmn:
            yield row


def with_serving_cell(rows: Sequence[Row]) -> tuple[Row, ...]:
    """The rows behind the serving cell of +CREG, +COPS and a level, if there is one."""
    registered = [row for row in rows if isinstance(row, Registration) and row.has_serving_cell]
    # an answer is newer than a report; the technology shows what the level is of
    best = max(registered, key=lambda row: (row.n is not None, row.rat is not None), default=None)
    return tuple(rows) if best is None else (_registered_cell(best, rows), *rows)


def _registered_cell(registration: Registration, rows: Sequence[Row]) -> CellReading:
    chosen = [row for row in rows if isinstance(row, Operator) and row.stat is None]
    plmn = next((one.plmn for one in chosen if one.plmn), None) or ""
    mcc, mnc = network_of(plmn)
    rat = registration.rat or next((row.rat for row in chosen if row.rat), None)
    signals = [row for row in rows if isinstance(row, Signal)]
    signal = next((row for row in signals if row.rat and _is_kin(row.rat, rat)), Signal())
    carriers = (row.rssi_dbm for row in signals if None in {row.rat, rat} or row.rat == rat)
    reading = CellReading(
        role="serving",
        rat=rat,
        rssi_dbm=next((level for level in carriers if level is not None), None),
        rscp_dbm=signal.rscp_dbm,
        ecio_db=signal.ecio_db,
        rsrp_dbm=signal.rsrp_dbm,
        rsrq_db=signal.rsrq_db,
    )
    carrier_dbm, level_dbm = reading.rssi_dbm, reading.level_dbm
    if carrier_dbm and level_dbm and carrier_dbm - level_dbm > max(CARRIER_ABOVE_DB):
        # one of the two has lost a digit
        reading = replace(reading, rssi_dbm=None, rscp_dbm=None, rsrp_dbm=None)
    code = _area_of(registration, rat, rows)
    reading = with_identity(reading, Identity(mcc, mnc, code, registration.cid))
    if rat is None and code not in {one.tac for one in rows if isinstance(one, Registration)}:
        reading = replace(reading, lac=code, tac=None)
    return reportable(reading)


def _area_of(registration: Registration, rat: Rat | None, rows: Sequence[Row]) -> int | None:
    # on LTE +CREG may print the area of circuit-switched service, or FFFE where there is none
    same = [row for row in rows if isinstance(row, Registration) and row.cid == registration.cid]
    tacs = [row.tac for row in same if row.tac is not None]
    lacs = [row.lac for row in (registration, *same) if row.lac is not None]
    if rat is None:
        rat = "LTE" if tacs else "GSM"
    codes = [*lacs, *tacs] if rat in {"GSM", "WCDMA"} else [*tacs, *lacs]
    return next(iter(codes), None)


def _is_kin(one: Rat | None, other: Rat | None) -> bool:
    # what one command calls LTE, another may call LTE-M
    return one == other or {one, other} <= _OF_EUTRA


def with_level(rows: Sequence[Row]) -> tuple[Row, ...]:
    """The rows, each serving cell without a level with that of +CESQ."""
    signals = {row.rat: row for row in rows if isinstance(row, Signal) and row.rat is not None}
    rats = Counter(row.rat for row in rows if is_serving(row))
    return tuple(
        reportable(
            replace(row, **{name: getattr(signals[row.rat], name) for name in _SIGNAL_LEVELS})
        )
        if is_serving(row)
        and row.level_dbm is None
        and row.rat in signals
        and rats[row.rat] == 1
        and not _differ(row, signals[row.rat])
        else row
        for row in rows
    )


def _differ(row: CellReading, signal: Signal) -> bool:
    printed = row.more.get("rsrp_raw"), signal.more.get("rsrp_raw")
    indices = [index for index in printed if isinstance(index, int)]
    return len(indices) > 1 and max(indices) - min(indices) > _MOST_BETWEEN


def with_name(rows: Sequence[Row], common: Sequence[Row]) -> tuple[Row, ...]:
    """The rows, a nameless serving cell with its name in `common`."""
    nameless = [row for row in rows if is_serving(row) and row.cell is None]
    named = next((row for row in common if is_serving(row) and row.cid is not None), None)
    if named is None or len(nameless) != 1 or nameless[0].cid not in {None, named.cid}:
        return tuple(rows)
    if named.rat is not None and not _is_kin(named.rat, nameless[0].rat):
        return tuple(rows)
    return tuple(_merge(row, named) if row is nameless[0] else row for row in rows)


def merge_serving_cells(rows: Iterable[Row]) -> tuple[Row, ...]:
    """Rows of one poll with each serving cell once, first.

    The others fill what the first row of a cell leaves open, but for a second level: it may be of a
    different scale.
    """
    serving: list[CellReading] = []
    others: list[Row] = []
    for row in rows:
        if not is_serving(row) or row.cid is None:
            others.append(row)
            continue
        same = [i for i, one in enumerate(serving) if one.cid == row.cid and _agree(one, row)]
        if same:
            serving[same[0]] = _merge(serving[same[0]], row)
        else:
            serving.append(row)
    return (*serving, *others)


def _agree(one: CellReading, other: CellReading) -> bool:
    # a cut row may lack its technology
    return one.rat == other.rat or None in {one.rat, other.rat}


def _merge(first: CellReading, second: CellReading) -> CellReading:
    names = {field.name for field in fields(CellReading)} - {"more"}
    missing = {name for name in names if getattr(first, name) is None}
    filled = missing - _LEVELS if first.level_dbm is not None else missing
    values: dict[str, Any] = {name: getattr(second, name) for name in filled}
    for name in _AREA_AND_CELL:
        number = getattr(first, name)
        if number is not None and number == getattr(second, name):
            values[name] = confirm(number)
    # one area is printed in hexadecimal, the other in decimal
    values["identity_unsure"] = any(
        getattr(second, name) not in {None, getattr(first, name)}
        for name in ("mcc", "mnc", "lac", "tac")
        if name not in missing
    )
    return replace(first, more={**second.more, **first.more}, **values)
