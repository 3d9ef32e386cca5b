"""What the rows of all u-blox commands have in common: one reading from texts by name, in whatever
order they come.

Area and cell identity are hexadecimal. Levels are the indices of 3GPP TS 36.133 and 45.008, 255
unknown.
"""

import re
from collections.abc import Mapping

from logger.core.types import CellReading, Rat, Role
from logger.drivers.reading.fields import area, cell_identity, decimal, level, rsrp_dbm, rsrq_db
from logger.drivers.reading.number_text import NumberForm, NumberText
from logger.drivers.reading.rows import NoCell

Texts = Mapping[str, str]

PCS_FLAG = 0x8000
"""Added to the channel in the 1900 MHz band (AT+CGED)."""
_HIGHEST = {"GSM": 1023, "WCDMA": 16383, "LTE": 262143}
_NO_CHANNEL = 65535
_INDICES = {  # name of the raw value, and what its index can be
    "rscp": ("rscp_raw", 0, 96),
    "ecn0": ("ecn0_raw", 0, 49),
    "rsrp": ("rsrp_raw", -17, 97),
    "rsrq": ("rsrq_raw", -30, 46),
    "sinr_index": ("sinr_raw", 0, 254),
}
_THREE = NumberForm(10, frozenset({3}))
_AS_PRINTED = ("bsic_text", "rxlev_text")
"""Values of a base that is not documented."""


def reading(role: Role, rat: Rat, texts: Texts) -> CellReading | NoCell | None:
    """One cell; for a serving cell of which all is unknown NoCell, for a neighbour None."""
    mcc, mnc, number = _network(texts)
    identified = mcc is not None or "mcc" not in texts
    place = area(texts.get("lac", texts.get("tac", ""))) if identified else None
    cid = cell_identity(texts.get("ci", ""), 16 if rat == "GSM" else 28) if identified else None
    channel, printed = _channel(texts.get("arfcn", ""), rat)
    raw = {
        name: decimal(texts[text], low, high)
        for text, (name, low, high) in _INDICES.items()
        if text in texts
    }
    rxlev = _rxlev(texts)
    if mcc is None and cid is None and channel is None:
        return NoCell(rat) if role == "serving" else None
    return CellReading(
        role=role,
        rat=rat,
        mcc=mcc,
        mnc=mnc,
        lac=None if rat == "LTE" else place,
        tac=place if rat == "LTE" else None,
        cid=cid,
        arfcn=channel,
        arfcn_raw=printed,
        band=decimal(texts.get("band", ""), 1, 254),
        psc=decimal(texts.get("psc", ""), 0, 511),
        pci=decimal(texts.get("pci", ""), 0, 503),
        rxlev_raw=rxlev,
        rssi_dbm=_carrier_dbm(texts.get("rssi_index", "")),
        rsrp_dbm=rsrp_dbm(texts.get("rsrp_dbm", ""))
        if raw.get("rsrp_raw") is None
        else _rsrp_dbm(raw["rsrp_raw"]),
        rsrq_db=rsrq_db(texts.get("rsrq_db", ""))
        if raw.get("rsrq_raw") is None
        else _rsrq_db(raw["rsrq_raw"]),
        sinr_db=level(texts.get("sinr", ""), -30.0, 50.0),
        ta=decimal(texts.get("ta", ""), 0, 63),
        c1=decimal(texts.get("c1", ""), -127, 127),
        c2=decimal(texts.get("c2", ""), -127, 127),
        more={**raw, **number, **{name: texts[name] for name in _AS_PRINTED if texts.get(name)}},
    )


def _rxlev(texts: Texts) -> int | None:
    padded = texts.get("rxlev_of_three", "")
    index = decimal(padded or texts.get("rxlev", ""), 0, 63)
    return NumberText(index, padded, _THREE) if index is not None and padded else index


def _network(texts: Texts) -> tuple[str | None, str | None, dict[str, int]]:
    """Country and network; a network code that has lost its zeros, a single digit, stays a number
    (`mnc_raw`).
    """
    mcc, mnc = texts.get("mcc", ""), texts.get("mnc", "")
    if not re.fullmatch(r"(?!000)[0-9]{3}", mcc) or not re.fullmatch(r"[0-9]{1,3}", mnc):
        return None, None, {}
    return (mcc, None, {"mnc_raw": int(mnc)}) if len(mnc) == 1 else (mcc, mnc, {})


def _channel(text: str, rat: Rat) -> tuple[int | None, int | None]:
    """Channel, and the number as printed where it carries the flag of the 1900 MHz band."""
    number = decimal(text, 0, 2**18)
    if number is None or number == _NO_CHANNEL:
        return None, None
    if rat == "GSM" and number >= PCS_FLAG:
        return (number - PCS_FLAG if 512 <= number - PCS_FLAG <= 810 else None), number
    return (number if number <= _HIGHEST[rat] else None), None


def _rsrp_dbm(index: int | None) -> float | None:
    return None if index is None or index < 0 else index - 141.0


def _rsrq_db(index: int | None) -> float | None:
    return None if index is None or not 0 <= index <= 34 else index / 2.0 - 20.0


def _carrier_dbm(text: str) -> float | None:
    """Level of a WCDMA carrier, all its cells together (3GPP TS 25.133 9.1.3; ubxlib,
    rssiUtranToDbm).
    """
    index = decimal(text, 0, 76)
    return None if index is None else index - 100.0
