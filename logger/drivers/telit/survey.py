"""Telit's network surveys, AT#CSURV (labels) and AT#CSURVC (numbers only), one line for each
carrier.

    Network survey started ... arfcn: 61 bsic: 37 rxLev: -57 ber: 0.00 mcc: 262 mnc: 1 lac: 12345
    cellId: 6789 cellStatus: CELL_SUITABLE ... 1005,26,-76,0,262,02,23456,34567,CELL_SUITABLE,0
    Network survey ended

AT#CSURVF decides whether area and cell are decimal (0, as shipped) or padded hexadecimal with an
octal BSIC; the reply does not say it. It shows in widths, letters and ranges; where nothing tells,
it is taken for decimal and is unsure. Formats: GM862 AT reference p379, LE910 V2 p287-289; the line
of LTE from a measured LM960.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from logger.core.types import CellReading, Rat
from logger.drivers.reading.fields import (
    area,
    cell_identity,
    decimal,
    labelled,
    level,
    listed,
    rscp_dbm,
    rsrp_dbm,
    rsrq_db,
    rssi_dbm,
)

_BANDS = (
    (0, 124),
    (128, 251),
    (512, 885),
    (975, 1023),
)  # GSM 900, 850, 1800 and 1900, 900 extended (3GPP TS 45.005 2)
_SLICE = 63  # channels; SeaGlass scanned all in 12 parts and allowed 120 s for each
SLICES = tuple(
    (low, min(low + _SLICE - 1, last))
    for first, last in _BANDS
    for low in range(first, last + 1, _SLICE)
)

_STATUS = (
    "CELL_SUITABLE",
    "CELL_LOW_PRIORITY",
    "CELL_FORBIDDEN",
    "CELL_BARRED",
    "CELL_LOW_LEVEL",
    "CELL_OTHER",
)
_NUMBER, _CODE, _POWER, _SMALL, _RATIO = (
    r"\d{1,6}",
    r"[0-9A-F]{1,3}",
    r"-\d{1,3}",
    r"\d{1,3}",
    r"-?\d{1,3}(?:\.\d+)?",
)
_AREA, _CELL, _STATE = r"[0-9A-F]{1,5}", r"[0-9A-F]{1,9}", r"[0-5]|" + "|".join(_STATUS)
_FORMS: dict[Rat, tuple[tuple[str, str], ...]] = {
    "GSM": (
        ("arfcn", _NUMBER),
        ("bsic", r"\w{1,3}"),
        ("rxLev", _POWER),
        ("ber", r"\d*(?:\.\d+)?"),
        ("mcc", _CODE),
        ("mnc", _CODE),
        ("lac", _AREA),
        ("cellId", _AREA),
        ("cellStatus", _STATE),
    ),
    "WCDMA": (
        ("uarfcn", _NUMBER),
        ("rxLev", _POWER),
        ("mcc", _CODE),
        ("mnc", _CODE),
        ("scr code", _SMALL),
        ("cellId", _CELL),
        ("lac", _AREA),
        ("cellStatus", _STATE),
        ("rscp", _RATIO),
        ("ecio", _RATIO),
    ),
    "LTE": (
        ("earfcn", _NUMBER),
        ("rxLev", _POWER),
        ("mcc", _CODE),
        ("mnc", _CODE),
        ("cellId", _CELL),
        ("tac", _AREA),
        ("cellIdentity", _SMALL),
        ("cellStatus", _STATE),
        ("rsrp", _RATIO),
        ("rsrq", _RATIO),
    ),
}
_ROWS = [
    (rat, pattern)
    for rat, form in _FORMS.items()
    for pattern in (listed(form), labelled(form, between=r"[\s,]+"))
]
# A row of LTE may end before the levels of the cell; in the place of its cell one of WCDMA has a
# scrambling code.
_WITHOUT_LEVELS = listed(
    [(name, r"[0-9A-F]{4,9}" if name == "cellId" else form) for name, form in _FORMS["LTE"][:-2]]
)
_ROWS.append(("LTE", _WITHOUT_LEVELS))
_LEVEL_ONLY = re.compile(
    r"(?<!\w)(?:arfcn\s?:\s*(?P<arfcn>\d{1,4})|uarfcn\s?:\s*(?P<uarfcn>\d{1,5})|earfcn\s?:\s*(?P<earfcn>\d{1,6}))"
    r"\s+(?:bsic\s?:\s*\S+\s+)?rxLev\s?:\s*(?P<rxlev>-\d{2,3})(?!\d)",
    re.IGNORECASE,
)
_CARRIER = re.compile(
    r"(?<![\w.,-])(?:(?P<arfcn>\d{1,4})|(?P<earfcn>\d{5,6})),(?P<rxlev>-\d{2,3})\s*\Z"
)
_STARTED = re.compile(r"network survey (started|ended)", re.IGNORECASE)
_BASE_SET = re.compile(r"#CSURVF(?:=|:\s*)([0-2])", re.IGNORECASE)
_SHIPPED = 10
_HIGHEST = {"GSM": 1023, "WCDMA": 16383, "LTE": 262143}
_CHANNEL: dict[Rat, str] = {"GSM": "arfcn", "WCDMA": "uarfcn", "LTE": "earfcn"}


@dataclass(frozen=True, slots=True)
class _Carrier:
    """Texts of one carrier, by label; without an identity only channel and level."""

    rat: Rat
    texts: dict[str, str]

    @property
    def bases(self) -> set[int]:
        """Bases that the widths and digits of area, cell and BSIC can only have."""
        told = {_base_of(self.texts.get("lac", self.texts.get("tac", "")), 4)}
        told.add(_base_of(self.texts.get("cellid", ""), 4 if self.rat == "GSM" else 8))
        told.add(_base_of_bsic(self.texts.get("bsic", "")))
        return {base for base in told if base is not None}


def survey_rows(lines: Sequence[str]) -> tuple[CellReading, ...]:
    """Readings of role "scan" of all surveys in the lines, which are taken as of one format."""
    carriers = list(_carriers(lines))
    base = _format_of(lines, carriers)
    plain = _codes_are_digits(carriers)
    read = (_reading(carrier, base, plain) for carrier in carriers)
    return tuple(reading for reading in read if reading is not None)


def octal_bsic(text: str) -> int | None:
    """BSIC of two octal digits, the network's and the base station's colour."""
    return int(text, 8) if re.fullmatch(r"[0-7]{2}", text) else None


def _carriers(lines: Sequence[str]) -> Iterator[_Carrier]:
    surveying = False
    for line in lines:
        for word in _STARTED.findall(line):
            surveying = word.lower() == "started"
        whole: dict[int, _Carrier] = {}
        for rat, pattern in _ROWS:
            for row in pattern.finditer(line):
                whole.setdefault(row.start(), _Carrier(rat, _texts(row)))
        for row in _LEVEL_ONLY.finditer(line):
            whole.setdefault(row.start(), _level_only(row))
        if surveying and not whole:
            whole = {row.start(): _level_only(row) for row in _CARRIER.finditer(line)}
        yield from (whole[start] for start in sorted(whole))


def _level_only(row: re.Match[str]) -> _Carrier:
    texts = _texts(row)
    return _Carrier(next((rat for rat, name in _CHANNEL.items() if texts.get(name)), "GSM"), texts)


def _texts(row: re.Match[str]) -> dict[str, str]:
    return {name: text or "" for name, text in row.groupdict().items()}


def _base_of(text: str, width: int) -> int | None:
    """Base of a number that is padded to `width` digits if hexadecimal and not padded if decimal,
    if that tells.
    """
    if not text or text == "0":
        return None
    if re.search(r"[A-Fa-f]", text) or text.startswith("0"):
        return 16
    if len(text) == width - 1 and width == 8:
        return None  # seven digits hold all 28 bits, so a firmware may print no more
    # the cell identity has 28 bits, so its eighth hexadecimal digit is 0
    return None if len(text) == width == 4 else 10


def _base_of_bsic(text: str) -> int | None:
    number = decimal(text, 0, 99)
    if number is None:
        return None
    if len(text) == 1 or re.search(r"[89]", text):
        return 10
    return 16 if number > 63 or text.startswith("0") else None


def _format_of(lines: Sequence[str], carriers: Sequence[_Carrier]) -> int | None:
    """Base of the surveys: as set in the transcript, or as most lines can only have it."""
    for line in reversed(lines):
        told = _BASE_SET.search(line)
        if told:
            return 10 if told[1] == "0" else 16
    votes = Counter(
        base for carrier in carriers if len(carrier.bases) == 1 for base in carrier.bases
    ).most_common()
    tied = len(votes) > 1 and votes[0][1] == votes[1][1]
    return votes[0][0] if votes and not tied else None


def _codes_are_digits(carriers: Sequence[_Carrier]) -> bool:
    """False where no country code is one as it stands: those models print the number in
    hexadecimal.

    Two codes must say so, countries or a network with a letter: a single one may be damaged.
    """
    countries, networks = (
        [carrier.texts.get(name, "").upper() for carrier in carriers] for name in ("mcc", "mnc")
    )
    told = [text for text in countries if text.strip("F")] + [
        text for text in networks if re.search(r"[A-E]", text)
    ]
    return any(map(_is_country, countries)) or len(told) < 2


def _is_country(text: str) -> bool:
    """Country codes of ITU-T E.212: by world zone, 901 shared, 001 for tests."""
    return re.fullmatch(r"[2-7]\d\d|901|999|001", text) is not None


def _network(texts: dict[str, str], plain: bool) -> tuple[str | None, str | None]:
    """Country and network; a network code has at least two digits (manual), so zeros in front of it
    are restored.
    """
    mcc, mnc = texts.get("mcc", ""), texts.get("mnc", "")
    if not plain and mcc and mnc:
        mcc, mnc = (
            f"{int(mcc, 16):03d}",
            "F" if re.fullmatch(r"F+", mnc, re.IGNORECASE) else str(int(mnc, 16)),
        )
    if not _is_country(mcc) or not re.fullmatch(r"\d{1,3}", mnc):
        return None, None
    return mcc, mnc.zfill(2)


def _reading(carrier: _Carrier, base: int | None, plain: bool) -> CellReading | None:
    texts, rat = carrier.texts, carrier.rat
    channel = decimal(texts.get(_CHANNEL[rat], ""), 0, _HIGHEST[rat])
    power = rssi_dbm(texts["rxlev"])
    if channel is None or power is None:
        return None
    untold = base is None and not carrier.bases
    one_base = (
        _SHIPPED if untold else base if base is not None and carrier.bases <= {base} else None
    )
    mcc, mnc, place, cid = _identity(carrier, one_base, plain)
    status = texts.get("cellstatus", "").upper()
    status = _STATUS[int(status)] if status.isdecimal() else status
    return CellReading(
        role="scan",
        rat=rat,
        mcc=mcc,
        mnc=mnc,
        lac=None if rat == "LTE" else place,
        tac=place if rat == "LTE" else None,
        cid=cid,
        arfcn=channel,
        bsic=_bsic(texts.get("bsic", ""), None if untold else one_base),
        psc=decimal(texts.get("scr_code", ""), 0, 511),
        pci=decimal(texts.get("cellidentity", ""), 0, 503),
        rssi_dbm=power,
        rscp_dbm=rscp_dbm(texts.get("rscp", "")),
        ecio_db=level(texts.get("ecio", ""), -40.0, 0.0),
        rsrp_dbm=rsrp_dbm(texts.get("rsrp", "")),
        rsrq_db=rsrq_db(texts.get("rsrq", "")),
        identity_unsure=untold and mcc is not None,
        more={"status": status} if status else {},
    )


def _identity(
    carrier: _Carrier, base: int | None, plain: bool
) -> tuple[str | None, str | None, int | None, int | None]:
    """Who the cell is, or nobody: not decoded, or in a base that is not known."""
    mcc, mnc = _network(carrier.texts, plain)
    if mcc is None or base is None:
        return None, None, None, None
    place = area(carrier.texts.get("lac", carrier.texts.get("tac", "")), base)
    return (
        mcc,
        mnc,
        place,
        cell_identity(carrier.texts["cellid"], 16 if carrier.rat == "GSM" else 28, base),
    )


def _bsic(text: str, base: int | None) -> int | None:
    if base is None:
        return None
    return decimal(text, 0, 63) if base == 10 else octal_bsic(text)
