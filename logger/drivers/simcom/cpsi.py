"""+CPSI, the serving cell as all newer SIMCom modems print it (firmware_notes/simcom.md).

    +CPSI: GSM,Online,502-12,0x1054,62168,512 DCS 1800,-71,0,32-32
    +CPSI: LTE,Online,310-260,0x2D18,50896642,236,EUTRAN-BAND4,2300,5,5,-125,-987,-663,10

The area is hexadecimal, the cell decimal. A row is read where band and channel are the
values that they should be: then the identity, further left, is complete even if the end is cut.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from logger.core.types import CellReading, Rat
from logger.drivers.reading.fields import (
    area,
    at,
    cell_identity,
    decimal,
    level,
    network,
    rsrp_dbm,
    rsrq_db,
    rssi_dbm,
)
from logger.drivers.reading.rows import NoCell, Row

_ROW = re.compile(r"(?<![A-Z])CPSI:([-\w ,.]*)", re.ASCII | re.IGNORECASE)
_FINAL = re.compile(r"\s*OK\s*\Z")
_NO_SERVICE = "NO SERVICE"

_WHO = ("plmn", "area", "cid")
_GSM = (*_WHO, "channel", "rxlev", "track_lo", "c1_c2")
_WCDMA = (*_WHO, "wcdma_band", "psc", "arfcn", "ssc", "ecio", "rscp", "squal", "srxlev", "txpwr")
_LTE = (*_WHO, "pci", "lte_band", "arfcn", "dlbw", "ulbw", "rsrq", "rsrp", "rssi", "rssnr")
_NR = (*_WHO, "pci", "nr_band", "arfcn", "rsrp", "rsrq", "snr")
_NSA = ("pci", "nr_band", "arfcn", "rsrp", "rsrq", "snr")
_MORE_OF_NR = 2  # spacing of its carriers and bandwidth, in newer firmware
_NSA_WITHOUT_BAND = ("pci", "arfcn", "rsrp", "rsrq", "snr")

_MODES: Mapping[str, tuple[Rat, tuple[str, ...]]] = {
    "GSM": ("GSM", _GSM),
    "WCDMA": ("WCDMA", _WCDMA),
    "LTE": ("LTE", _LTE),
    "LTE CAT-M1": ("LTE-M", _LTE),
    "LTE NB-IOT": ("NB-IoT", _LTE),
    "NB": ("NB-IoT", _LTE),  # SIM7022
    "NR5G_SA": ("NR", _NR),
}
_PLACES = {  # the values that show that none is lost or added
    "channel": re.compile(
        r"(\d{1,4})(?:\s+([A-Z][\w ]*))?", re.IGNORECASE
    ),  # the A76xx prints no band
    "wcdma_band": re.compile(r"[A-Z][-\w ]*", re.IGNORECASE),
    "lte_band": re.compile(r"(?:EUTRAN|LTE)[-_ ]?BAND[-_ ]?(\d{1,3})", re.IGNORECASE),
    "nr_band": re.compile(r"NR5G[-_ ]?BAND[-_ ]?(\d{1,3})", re.IGNORECASE),
    "arfcn": re.compile(r"\d{1,10}"),
    "psc": re.compile(r"\d{1,3}"),
    "pci": re.compile(r"\d{1,4}"),
    "rxlev": re.compile(r"-?\d{1,3}"),
    "dlbw": re.compile(r"\d{1,2}"),
    "ulbw": re.compile(r"\d{1,2}"),
}
_ECIO = re.compile(r"-?\d{1,2}(?:\.\d)?")
_MOST_ARFCN: Mapping[Rat, int] = {"GSM": 1023, "WCDMA": 16383, "NR": 3_279_165}
_MOST_EARFCN = 262_143
_BITS: Mapping[Rat, tuple[int, int]] = {"GSM": (16, 16), "NR": (24, 36)}  # of area and cell
_BITS_OF_OTHERS = (16, 28)
_C1_C2 = re.compile(r"(-?\d{1,3})-(-?\d{1,3})")

_Levels = tuple[dict[str, Any], dict[str, Any]]
"""Fields of a reading, and what goes into `more` as printed."""


def serving_cells(lines: Sequence[str]) -> tuple[Row, ...]:
    """Serving cells, two where LTE and NR are used together, and `NoCell` for NO SERVICE."""
    found = (_row(match[1]) for line in lines for match in _ROW.finditer(line))
    return tuple(row for row in found if row is not None)


def _row(text: str) -> Row | None:
    values = [value.strip() for value in _FINAL.sub("", text).split(",")]
    mode = values[0].upper()
    if mode == _NO_SERVICE:
        return NoCell(status=mode, state=at(values, 1) or None)
    if mode in {"NR5G", "NR5G_NSA"}:
        has_band = _PLACES["nr_band"].fullmatch(at(values, 2)) is not None
        return _cell("NR", _NSA if has_band else _NSA_WITHOUT_BAND, values[1:], {})
    if mode not in _MODES:
        return None
    rat, names = _MODES[mode]
    return _cell(rat, names, values[2:], {"state": at(values, 1)})


def _cell(
    rat: Rat, names: tuple[str, ...], values: list[str], more: Mapping[str, str]
) -> CellReading | None:
    """Reading of a row that lacks at most its last value; None for others and empty ones."""
    if not len(names) - 1 <= len(values) <= len(names) + (_MORE_OF_NR if rat == "NR" else 0):
        return None
    if len(values) < len(names):
        values = values[:-1]  # the last one may be cut
    named = dict(zip(names, values, strict=False))
    if not all(form.fullmatch(named[name]) for name, form in _PLACES.items() if name in named):
        return None
    where = _where(rat, named)
    ids = (
        _identity(rat, named) if where["arfcn"] is not None else {}
    )  # 4294967295 while it changes its cell
    levels, raw = _LEVELS_OF.get(rat, _lte)(named)
    reading = CellReading(role="serving", rat=rat, **where, **ids, **levels, more={**more, **raw})
    return reading if ids or reading.level_dbm is not None else None


def _where(rat: Rat, named: Mapping[str, str]) -> dict[str, Any]:
    """Channel, band and the cell's code on the channel."""
    channel, band = named.get("arfcn", ""), None
    for name in ("lte_band", "nr_band"):
        found = _PLACES[name].fullmatch(named.get(name, ""))
        band = int(found[1]) if found else band
    on_gsm = _PLACES["channel"].fullmatch(named.get("channel", ""))
    return {
        "arfcn": decimal(on_gsm[1] if on_gsm else channel, 0, _MOST_ARFCN.get(rat, _MOST_EARFCN)),
        "band": on_gsm[2] if on_gsm else band or named.get("wcdma_band"),
        "psc": decimal(named.get("psc", ""), 0, 511),
        "pci": decimal(named.get("pci", ""), 0, 1007 if rat == "NR" else 503),
    }


def _identity(rat: Rat, named: Mapping[str, str]) -> dict[str, Any]:
    """The identity, empty where a part is damaged; a part marked as unknown is None."""
    if "plmn" not in named:
        return {}
    area_bits, cid_bits = _BITS.get(rat, _BITS_OF_OTHERS)
    mcc, mnc = network(*named["plmn"].split("-", 1)) if "-" in named["plmn"] else (None, None)
    in_form = re.fullmatch(rf"0[xX][0-9A-Fa-f]{{1,{area_bits // 4}}}", named["area"])
    if mcc is None or not in_form or not re.fullmatch(r"-?\d{1,11}", named["cid"]):
        return {}
    return {
        "mcc": mcc,
        "mnc": mnc,
        "lac" if rat in {"GSM", "WCDMA"} else "tac": area(named["area"], 16, area_bits),
        "cid": cell_identity(
            named["cid"], cid_bits, base=10
        ),  # 4000000000 is printed as -294967296
    }


def _gsm(named: Mapping[str, str]) -> _Levels:
    criteria = _C1_C2.fullmatch(named.get("c1_c2", ""))
    c1, c2 = criteria.groups() if criteria else ("", "")
    return {
        "rssi_dbm": rssi_dbm(named["rxlev"]),
        "c1": decimal(c1, -255, 255),
        "c2": decimal(c2, -255, 255),
    }, {}


def _wcdma(named: Mapping[str, str]) -> _Levels:
    """EC/IO and RSCP are printed without sign; an impossible one shows a lost or added value."""
    ecio, rscp = (named[name].removeprefix("-") for name in ("ecio", "rscp"))
    ecio_db = level(ecio, -32.0, -0.1, -1.0) if _ECIO.fullmatch(ecio) else None
    return {
        "rscp_dbm": rssi_dbm(rscp, -1.0) if ecio_db is not None else None,
        "ecio_db": ecio_db,
    }, {}


def _lte(named: Mapping[str, str]) -> _Levels:
    """Levels in one unit or none of them; the ratio of signal to noise is always in dB."""
    sinr = {"sinr_db": level(named.get("rssnr", ""), -23.0, 40.0)}
    printed = [named.get(name, "") for name in ("rsrq", "rsrp", "rssi")]
    indices = [decimal(text, 0, 255) for text in printed]
    if None not in indices:
        names = ("rsrq_raw", "rsrp_raw", "rssi_raw")
        return sinr, {
            name: None if index == 255 else index
            for name, index in zip(names, indices, strict=True)
        }
    scale = _scale(named["rsrp"])
    if scale is None:
        return {}, {}
    rsrq, rsrp, rssi = printed
    levels = {
        "rsrq_db": rsrq_db(rsrq, scale),
        "rsrp_dbm": rsrp_dbm(rsrp, scale),
        "rssi_dbm": rssi_dbm(rssi, scale),
    }
    if levels["rsrq_db"] is None or (rssi and levels["rssi_dbm"] is None):
        return {}, {}
    return {**sinr, **tenths(levels)}, {}


def _nr(named: Mapping[str, str]) -> _Levels:
    """RSRP and RSRQ come in either order, RSRP is the lower; SNR is in dB or tenths."""
    low, high = sorted(
        (named["rsrp"], named.get("rsrq", "")),
        key=lambda text: level(text, -99999.0, 99999.0) or 0.0,
    )
    scale = _scale(low)
    snr = named.get("snr", "")
    integer = decimal(snr, -999, 999)
    raw = {"sinr_raw": snr if integer is None else integer} if snr else {}
    if scale is None:
        return {}, raw
    ratio = rsrq_db(high, scale)
    if high and ratio is None:
        return {}, raw  # another unit than that of the level: one of them is damaged
    return tenths({"rsrp_dbm": rsrp_dbm(low, scale), "rsrq_db": ratio}), raw


def _scale(rsrp: str) -> float | None:
    """Unit of the row: SIM7000 prints dB, SIM7600 tenths; None for the index of an A76xx."""
    if rsrp_dbm(rsrp) is not None:
        return 1.0
    return None if rsrp_dbm(rsrp, 0.1) is None else 0.1


def tenths(levels: Mapping[str, float | None]) -> dict[str, Any]:
    """Levels rounded to what is printed."""
    return {name: None if value is None else round(value, 1) for name, value in levels.items()}


_LEVELS_OF = {"GSM": _gsm, "WCDMA": _wcdma, "NR": _nr}
