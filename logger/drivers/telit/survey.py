"""Telit's network surveys, AT#CSURV (labels) and AT#CSURVC (values only), one line per carrier.

    Network survey started ...
    arfcn: 61 bsic: 37 rxLev: -57 ber: 0.00 mcc: 262 mnc: 1 lac: 12345 cellId: 6789 cellStatus: ...
    1005,26,-76,0,262,02,23456,34567,CELL_SUITABLE,0
    Network survey ended

Where nothing shows the base of the numbers (`survey_format`), it is taken for decimal and the
identity is unsure. Formats: GM862 AT reference p379, LE910 V2 p287-289; the line of LTE from a
measured LM960.
"""

import re
from collections.abc import Iterator, Mapping, Sequence

from logger.core.types import Broadcast, CellReading, Rat
from logger.drivers.reading.cell_values import VALUES, area_values, read_values
from logger.drivers.reading.fields import area, cell_identity, decimal
from logger.drivers.reading.row_patterns import form, labelled_row, listed_row
from logger.drivers.telit.survey_broadcast import labelled_broadcast, listed_broadcast
from logger.drivers.telit.survey_format import (
    DECIMAL,
    Carrier,
    base_of_survey,
    codes_are_decimal,
    network_of,
)

# GSM 900, 850, 1800 and 1900, 900 extended (3GPP TS 45.005 2)
_BANDS = ((0, 124), (128, 251), (512, 885), (975, 1023))
_SLICE = 63  # channels; SeaGlass scanned all in 12 parts and allowed 120 s for each
SLICES = tuple(
    (low, min(low + _SLICE - 1, last))
    for first, last in _BANDS
    for low in range(first, last + 1, _SLICE)
)
"""Ranges of channels that one survey command covers."""

_STATUS = (
    "CELL_SUITABLE",
    "CELL_LOW_PRIORITY",
    "CELL_FORBIDDEN",
    "CELL_BARRED",
    "CELL_LOW_LEVEL",
    "CELL_OTHER",
)
WORDS = (
    "Network survey started ended Carrier BCCh arfcn uarfcn earfcn bsic rxLev ber mcc mnc lac tac"
    " cellId scr_code cellIdentity cellStatus rscp ecio rsrp rsrq " + " ".join(_STATUS)
)
"""Words of a survey."""
_TYPES = {
    "number": r"\d{1,6}",
    "text": r"\w{1,3}",
    "code": r"[0-9A-F]{1,3}",
    "power": r"-\d{1,3}",
    "small": r"\d{1,3}",
    "errors": r"\d*(?:\.\d+)?",
    "ratio": r"-?\d{1,3}(?:\.\d+)?",
    "area": r"[0-9A-F]{1,5}",
    "cell": r"[0-9A-F]{1,9}",
    "state": r"[0-5]|" + "|".join(_STATUS),
}


_FORMS: Mapping[Rat, list[tuple[str, str]]] = {
    "GSM": form(
        "arfcn/number bsic/text rxLev/power ber/errors mcc/code mnc/code lac/area cellId/area"
        " cellStatus/state",
        _TYPES,
    ),
    "WCDMA": form(
        "uarfcn/number rxLev/power mcc/code mnc/code scr_code/small cellId/cell lac/area"
        " cellStatus/state rscp/ratio ecio/ratio",
        _TYPES,
    ),
    "LTE": form(
        "earfcn/number rxLev/power mcc/code mnc/code cellId/cell tac/area cellIdentity/small"
        " cellStatus/state rsrp/ratio rsrq/ratio",
        _TYPES,
    ),
}
_ROWS = [
    (rat, pattern)
    for rat, labels in _FORMS.items()
    for pattern in (listed_row(labels), labelled_row(labels, between=r"[\s,]+"))
]
# A row of LTE may end before the levels of the cell; instead of its cell one of WCDMA has a
# scrambling code.
_WITHOUT_LEVELS = listed_row(
    [(name, r"[0-9A-F]{4,9}" if name == "cellId" else value) for name, value in _FORMS["LTE"][:-2]]
)
_ROWS.append(("LTE", _WITHOUT_LEVELS))
_LEVEL_ONLY = re.compile(
    r"(?<!\w)(?:arfcn\s?:\s*(?P<arfcn>\d{1,4})|uarfcn\s?:\s*(?P<uarfcn>\d{1,5})"
    r"|earfcn\s?:\s*(?P<earfcn>\d{1,6}))"
    r"\s+(?:bsic\s?:\s*\S+\s+)?rxLev\s?:\s*(?P<rxlev>-\d{2,3})(?!\d)",
    re.IGNORECASE,
)
_CARRIER = re.compile(
    r"(?<![\w.,-])(?:(?P<arfcn>\d{1,4})|(?P<earfcn>\d{5,6})),(?P<rxlev>-\d{2,3})\s*\Z"
)
_BEGIN_OR_END = re.compile(r"network survey (started|ended)", re.IGNORECASE)
_CHANNEL: Mapping[Rat, str] = {"GSM": "arfcn", "WCDMA": "uarfcn", "LTE": "earfcn"}
_NAMES = {"scr_code": "psc", "cellidentity": "pci", "rxlev": "rssi"}  # names of `cell_values`
_LEVELS = frozenset({"psc", "pci", "rssi", "rscp", "ecio", "rsrp", "rsrq"})


def survey_rows(lines: Sequence[str]) -> tuple[CellReading, ...]:
    """Readings of role "scan" of all surveys in the lines, which have one format."""
    carriers = list(_carriers(lines))
    base = base_of_survey(lines, carriers)
    is_decimal = codes_are_decimal(carriers)
    readings = (_reading(carrier, base, is_decimal=is_decimal) for carrier in carriers)
    return tuple(reading for reading in readings if reading is not None)


def octal_bsic(text: str) -> int | None:
    """BSIC of two octal digits, the network's and the base station's colour."""
    return int(text, 8) if re.fullmatch(r"[0-7]{2}", text) else None


def _carriers(lines: Sequence[str]) -> Iterator[Carrier]:
    surveying = False
    for line in lines:
        for word in _BEGIN_OR_END.findall(line):
            surveying = word.lower() == "started"
        found: dict[int, tuple[Rat, re.Match[str]]] = {}
        for rat, pattern in _ROWS:
            for row in pattern.finditer(line):
                found.setdefault(row.start(), (rat, row))
        for row in _LEVEL_ONLY.finditer(line):
            found.setdefault(row.start(), (_rat_of_channel(row), row))
        if surveying and not found:
            found = {row.start(): (_rat_of_channel(row), row) for row in _CARRIER.finditer(line)}
        starts = sorted(found)
        for i, start in enumerate(starts):
            rat, row = found[start]
            after = starts[i + 1] if i + 1 < len(starts) else len(line)
            yield Carrier(rat, row.groupdict(""), _broadcast(rat, row, line[row.end() : after]))


def _rat_of_channel(row: re.Match[str]) -> Rat:
    """Technology of a carrier without an identity, by the label of its channel."""
    texts = row.groupdict("")
    return next((rat for rat, name in _CHANNEL.items() if texts.get(name)), "GSM")


def _broadcast(rat: Rat, row: re.Match[str], tail: str) -> Broadcast | None:
    """What stands behind the status of a cell of GSM."""
    if rat != "GSM" or not row.groupdict().get("cellstatus"):
        return None
    return labelled_broadcast(tail) if ":" in row[0] else listed_broadcast(tail)


def _reading(carrier: Carrier, base: int | None, *, is_decimal: bool) -> CellReading | None:
    texts, rat = carrier.texts, carrier.rat
    channel = VALUES[_CHANNEL[rat]][1](texts.get(_CHANNEL[rat], ""))
    named = {_NAMES.get(name, name): text for name, text in texts.items()}
    values = read_values({name: text for name, text in named.items() if name in _LEVELS})
    if channel is None or values["rssi_dbm"] is None:
        return None
    is_unknown = base is None and not carrier.bases
    agreed = base if base is not None and carrier.bases <= {base} else None
    sure_base = DECIMAL if is_unknown else agreed
    mcc, mnc, area_code, cid = _identity(carrier, sure_base, is_decimal=is_decimal)
    status = texts.get("cellstatus", "").upper()
    status = _STATUS[int(status)] if status.isdecimal() else status
    return CellReading(
        role="scan",
        rat=rat,
        mcc=mcc,
        mnc=mnc,
        **area_values(rat, area_code),
        cid=cid,
        arfcn=channel,
        bsic=None if is_unknown else _bsic(texts.get("bsic", ""), sure_base),
        broadcast=carrier.broadcast,
        identity_unsure=is_unknown and mcc is not None,
        more={"status": status} if status else {},
        **values,
    )


def _identity(
    carrier: Carrier, base: int | None, *, is_decimal: bool
) -> tuple[str | None, str | None, int | None, int | None]:
    """Network, area and cell; None where not decoded, or in a base that is not known."""
    mcc, mnc = network_of(carrier.texts, is_decimal=is_decimal)
    if mcc is None or base is None:
        return None, None, None, None
    bits = 16 if carrier.rat == "GSM" else 28
    return mcc, mnc, area(carrier.area, base), cell_identity(carrier.texts["cellid"], bits, base)


def _bsic(text: str, base: int | None) -> int | None:
    if base is None:
        return None
    return decimal(text, 0, 63) if base == DECIMAL else octal_bsic(text)
