"""The reading of a cell from its texts by name, for the rows of all u-blox commands.

Area and cell identity are hexadecimal. Levels are the indices of 3GPP TS 36.133 and 45.008, 255
unknown.
"""

import re
from collections.abc import Iterator, Mapping

from logger.core.types import CellReading, Rat, Role
from logger.drivers.reading.cell_values import VALUES, Readers, area_values, between, read_values
from logger.drivers.reading.fields import area, cell_identity, decimal
from logger.drivers.reading.index_scales import CARRIER_OF_INDEX, RSRP_OF_INDEX, RSRQ_OF_INDEX
from logger.drivers.reading.number_text import NumberForm, NumberText
from logger.drivers.reading.rows import NoCell

Texts = Mapping[str, str]

PCS_FLAG = 0x8000
"""Added to the channel in the 1900 MHz band (AT+CGED)."""
_PCS_CHANNELS, _PCS_BAND = range(512, 811), 1900
"""The same channels are used in the 1800 MHz band (3GPP TS 45.005 2)."""
_CHANNELS: Mapping[Rat, str] = {"GSM": "arfcn", "WCDMA": "uarfcn", "LTE": "earfcn"}
_NO_CHANNEL = 65535
_INDICES = {  # name of the raw value, and the range of its index
    "rscp": ("rscp_raw", between(0, 96)),
    "ecn0": ("ecn0_raw", between(0, 49)),
    "rsrp": ("rsrp_raw", between(-17, 97)),
    "rsrq": ("rsrq_raw", between(-30, 46)),
    "sinr_index": ("sinr_raw", between(0, 254)),
}
_READERS: Readers = {
    "band": ("band", between(1, 254)),
    "psc": VALUES["psc"],
    "pci": VALUES["pci"],
    "rssi_index": ("rssi_dbm", CARRIER_OF_INDEX.value_of),
    "rsrp_dbm": VALUES["rsrp"],
    "rsrq_db": VALUES["rsrq"],
    "sinr": VALUES["snr"],
    "ta": VALUES["ta"],
    "c1": ("c1", between(-127, 127)),
    "c2": ("c2", between(-127, 127)),
}
_THREE = NumberForm(10, frozenset({3}))
_AS_PRINTED = ("bsic_text", "rxlev_text")
"""Values of a base that is not documented."""


def readings(role: Role, rat: Rat, texts: Texts) -> Iterator[CellReading | NoCell]:
    """One cell; of a serving cell with unknown values only `NoCell`, of a neighbour nothing."""
    mcc, mnc, number = _network(texts)
    identified = mcc is not None or "mcc" not in texts
    area_code = area(texts.get("lac", texts.get("tac", ""))) if identified else None
    cid = cell_identity(texts.get("ci", ""), 16 if rat == "GSM" else 28) if identified else None
    channel, flagged = _channel(texts.get("arfcn", ""), rat)
    if mcc is None and cid is None and channel is None:
        yield from [NoCell(rat)] if role == "serving" else []
        return
    values = read_values(texts, _READERS)
    if rat == "GSM" and channel in _PCS_CHANNELS:
        is_pcs = flagged is not None or texts.get("is_1900") == "1"
        values["band"] = _PCS_BAND if is_pcs else None
    raw = read_values(texts, _INDICES)
    for name, attribute, scale in (
        ("rsrp_raw", "rsrp_dbm", RSRP_OF_INDEX),
        ("rsrq_raw", "rsrq_db", RSRQ_OF_INDEX),
    ):
        if raw.get(name) is not None:
            values[attribute] = scale.value_at(raw[name])
    printed = {name: texts[name] for name in _AS_PRINTED if texts.get(name)}
    yield CellReading(
        role=role,
        rat=rat,
        mcc=mcc,
        mnc=mnc,
        **area_values(rat, area_code),
        cid=cid,
        arfcn=channel,
        arfcn_raw=flagged,
        rxlev_raw=_rxlev(texts),
        more={**raw, **number, **printed},
        **values,
    )


def _rxlev(texts: Texts) -> int | None:
    padded = texts.get("rxlev_of_three", "")
    index = decimal(padded or texts.get("rxlev", ""), 0, 63)
    return NumberText(index, padded, _THREE) if index is not None and padded else index


def _network(texts: Texts) -> tuple[str | None, str | None, dict[str, int]]:
    """Country and network; a network code of one digit has lost its zeros and stays a number."""
    mcc, mnc = texts.get("mcc", ""), texts.get("mnc", "")
    if not re.fullmatch(r"(?!000)[0-9]{3}", mcc) or not re.fullmatch(r"[0-9]{1,3}", mnc):
        return None, None, {}
    return (mcc, None, {"mnc_raw": int(mnc)}) if len(mnc) == 1 else (mcc, mnc, {})


def _channel(text: str, rat: Rat) -> tuple[int | None, int | None]:
    """Channel, and the number as printed where it has the flag of the 1900 MHz band."""
    number = decimal(text, 0, 2**18)
    if number is None or number == _NO_CHANNEL:
        return None, None
    if rat == "GSM" and number >= PCS_FLAG:
        channel = number - PCS_FLAG
        return (channel if channel in _PCS_CHANNELS else None), number
    return VALUES[_CHANNELS[rat]][1](text), None
