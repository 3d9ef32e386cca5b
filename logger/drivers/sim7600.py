"""SIMCom SIM5xxx, SIM7100 to SIM79xx, SIM82xx/83xx, A76xx, SIM7670: AT+CPSI, +CCINFO, +CMGRMI.

    AT+CPSI?
    +CPSI: GSM,Online,502-12,0x1054,62168,512 DCS 1800,-71,0,32-32
    OK
    +CPSI: LTE,Online,310-260,0x2D18,50896642,236,EUTRAN-BAND4,2300,5,5,-125,-987,-663,10

    AT+CCINFO
    +CCINFO:[SCELL],ARFCN:34,MCC:240,MNC:24,LAC:10001,ID:31,BSIC:18,RXLev:-78dbm,C1:33,...
    +CCINFO:[NCell1],UARFCN:4436,PSC:230,SSC:0,RSCP:97,ECIO:15.5,RXLev:-97dbm

    AT+CMGRMI=4
    +CMGRMI: Serving_Cell,1300,262,02,5432,2,7654321,3,5,5,12,211,-95,-912,-604,0
    +CMGRMI: LTE_InterFreq1_Cell1,417,-125,-1011,-772,0

Needs: nothing; a modem refuses the commands that it lacks.
Known by: the series.
Doubts: the area of +CPSI is hexadecimal, all else decimal; levels are dB or tenths of a dB, which
the row itself shows. A row of +CPSI is read where band and channel are the values that they should
be: then the identity, further left, is complete even if the end is cut. The base of BSIC in +CCINFO
is not documented.
Sources: measured replies in public code (+CPSI) and at pastebin.com/VfE7YiwG (+CCINFO); for
+CMGRMI values of our own in the layout of a measured SIM7906 (firmware_notes/simcom.md).
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar

from logger.core.cell_names import Identity
from logger.core.types import CellReading, Rat, Role
from logger.drivers import network_mode
from logger.drivers.family import Claim, Family, cells_with
from logger.drivers.protocols.at import Command, Dialogue
from logger.drivers.reading import modem_gnss
from logger.drivers.reading.row_language import (
    TENTHS,
    VALUES,
    Form,
    Kinds,
    NoCell,
    Row,
    Value,
    area,
    at,
    cell,
    cell_identity,
    decimal,
    form,
    level,
    network,
    read_values,
    rsrp_dbm,
    rsrq_db,
    rssi_dbm,
    with_identity,
)
from logger.drivers.reading.standard_replies import merge_serving_cells, with_level

_CPSI = re.compile(r"(?<![A-Z])CPSI:([-\w ,.]*)", re.ASCII | re.IGNORECASE)
_FINAL = re.compile(r"\s*OK\s*\Z")
_NO_SERVICE = "NO SERVICE"

_TEXT = Value("", str, ".*")
_CHANNEL = r"\d{1,10}"  # 4294967295 while the modem changes its cell
_GSM_CHANNEL = re.compile(r"(\d{1,4})(?:\s+([A-Z][\w ]*))?", re.IGNORECASE)  # A76xx: no band


def _last_number(text: str) -> int | None:
    return int(re.sub(r".*\D", "", text)) or None


_CPSI_KINDS: Kinds = {
    "channel": Value("", str, _GSM_CHANNEL.pattern),
    "uarfcn": VALUES["uarfcn"]._replace(pattern=_CHANNEL),
    "earfcn": VALUES["earfcn"]._replace(pattern=_CHANNEL),
    "nrarfcn": VALUES["nrarfcn"]._replace(pattern=_CHANNEL),
    "wcdma_band": Value("band", str, r"[A-Z][-\w ]*"),
    "lte_band": Value("band", _last_number, r"(?:EUTRAN|LTE)[-_ ]?BAND[-_ ]?\d{1,3}"),
    "nr_band": Value("band", _last_number, r"NR5G[-_ ]?BAND[-_ ]?\d{1,3}"),
    "psc": VALUES["psc"],
    "pci": VALUES["pci"]._replace(pattern=r"\d{1,4}|65535"),
    "pci_nr": VALUES["pci_nr"],
    "rxlev": Value("rssi_dbm", rssi_dbm, r"-?\d{1,3}"),
    "dlbw": Value("", str, r"\d{1,2}"),
    "ulbw": Value("", str, r"\d{1,2}"),
    **dict.fromkeys(
        ("plmn", "area", "cid", "c1_c2", "ecio", "rscp", "rsrq", "rsrp", "rssi", "snr"), _TEXT
    ),
}


def _cpsi_form(rat: Rat, names: str) -> Form:
    return form(rat, names, _CPSI_KINDS, unknown="(?!)")


_LTE = "plmn area cid pci lte_band earfcn dlbw ulbw rsrq rsrp [rssi snr]"
_CPSI_FORMS: Mapping[str, Form] = {  # a row lacks its last value at most
    "GSM": _cpsi_form("GSM", "plmn area cid channel rxlev [_ c1_c2]"),
    "WCDMA": _cpsi_form("WCDMA", "plmn area cid wcdma_band psc uarfcn _ ecio rscp _ [_ _]"),
    "LTE": _cpsi_form("LTE", _LTE),
    "CAT-M": _cpsi_form("LTE-M", _LTE),
    "NB": _cpsi_form("NB-IoT", _LTE),
    "NR5G": _cpsi_form("NR", "plmn area cid pci_nr nr_band nrarfcn rsrp [rsrq snr ...]"),
}
# LTE CAT-M1; LTE NB-IOT, of a SIM7022 NB
_SYSTEM = re.compile(r"(?:LTE )?(?:CAT-)?(NB|CAT-M)(?:-?IOT)?[12]?|(NR5G)(?:_N?SA)?")
_NSA = _cpsi_form("NR", "pci_nr nr_band nrarfcn rsrp [rsrq snr ...]")
_NSA_WITHOUT_BAND = _cpsi_form("NR", "pci_nr nrarfcn rsrp [rsrq snr ...]")
_MOST_MORE, _MORE = 2, re.compile(r"-?\d{1,5}")
# at the end of a row of newer firmware, of NR the spacing of its carriers and bandwidth
_ECIO = re.compile(r"-?\d{1,2}(?:\.\d)?")
_BITS: Mapping[Rat, tuple[int, int]] = {"GSM": (16, 16), "NR": (24, 36)}  # of area and cell
_BITS_OF_OTHERS = (16, 28)
_C1_C2 = re.compile(r"(-?\d{1,3})-(-?\d{1,3})")

_Levels = tuple[dict[str, Any], dict[str, Any]]
"""Fields of a reading, and what goes into `more` as printed."""

_CCINFO = re.compile(
    r"(?<![A-Z])CCINFO:\s*\[\s*(SCELL|NCELL\s*\d{0,2})\s*\]([^\\]*?)(?=\+?CCINFO:|\\|\Z)",
    re.ASCII | re.IGNORECASE,
)
_PAIR = re.compile(r",\s*([A-Z]\w*)\s*:\s*([-\w.]+)\s*(?=(,)|\Z)", re.ASCII | re.IGNORECASE)
_LAST = frozenset({"rxlev", "c2"})
"""Labels that may end a row; another value at the end is cut."""
_WHO = re.compile(
    r",\s*(U)?ARFCN\s*:\s*\d{1,5}\s*,\s*MCC\s*:\s*(\d{3})\s*,\s*MNC\s*:\s*(\d{1,3})\s*,"
    r"\s*LAC\s*:\s*(\d{1,5})\s*,\s*ID\s*:\s*(\d{1,10})\s*,\s*(?(1)PSC|BSIC)\s*:",
    re.IGNORECASE | re.ASCII,
)
_DBM = re.compile(r"(-\d{1,3})\s*dBm", re.IGNORECASE)


def _rxlev_dbm(text: str) -> float | None:
    found = _DBM.match(text)  # the unit shows that the level is complete
    return rssi_dbm(found[1]) if found else None


def _negative(read: Callable[..., float | None]) -> Callable[[str], float | None]:
    return lambda text: read(text.removeprefix("-"), scale=-1.0)


_CCINFO_KINDS: Kinds = {
    **{name: VALUES[name] for name in ("arfcn", "uarfcn", "psc", "ta", "c1", "c2")},
    "rxlev": Value("rssi_dbm", _rxlev_dbm),
    "rscp": Value("rscp_dbm", _negative(rssi_dbm)),
    "ecio": Value("ecio_db", _negative(partial(level, low=-32.0, high=-0.1))),
    "bsic": Value("more.bsic_raw", str),  # its base is undocumented
}
_CCINFO_LEVELS = frozenset({"rxlev", "rscp", "ecio"})

_CMGRMI = re.compile(r"(?<![A-Z])CMGRMI:\s*(\w+)\s*,([-\w, ]*)", re.IGNORECASE | re.ASCII)


_CMGRMI_KINDS: Kinds = {
    **VALUES,
    **TENTHS,
    "sinr": VALUES["sinr"],
    "digits": Value("", str, "[23]"),
}
_SERVING = form(
    "LTE",
    "earfcn mcc mnc tac_10 digits cid28_10 band _ _ sinr pci rsrq rsrp rssi _",
    _CMGRMI_KINDS,
)
_NEIGHBOUR = form("LTE", "pci rsrq rsrp* rssi _srxlev", _CMGRMI_KINDS, unknown="")
_INTRA_CELL = re.compile(r"LTE_INTRA_CELL\d{1,2}")
_INTER_CELL = re.compile(r"LTE_INTERFREQ(\d{1,2})_CELL\d{1,2}")
_FREQUENCY = re.compile(r"Freq(\d{1,2})\s*,\s*(\d{1,6})\s*,", re.IGNORECASE | re.ASCII)


class Sim7600(Family):
    """The serving cell by AT+CPSI, neighbours by AT+CCINFO (GSM, WCDMA) and AT+CMGRMI (LTE)."""

    name = "sim7600"
    gives = MappingProxyType(
        {
            "GSM": cells_with(
                "neighbours", "timing advance", "C1 and C2", without=("colour code",)
            ),
            "WCDMA": cells_with("neighbours"),
            "LTE": cells_with("neighbours"),
            "NR": cells_with(),
        }
    )
    claim = Claim(series=r"SIM(?:5\d|7[1-9]|8[23])\d\d(?!\d)|(?<![0-9A-Z])A7[69]\d\d(?!\d)")
    poll_commands = (
        Command("AT+CPSI?"),
        Command("AT+CCINFO"),
        Command("AT+CMGRMI=4"),
        Command("AT+CESQ"),  # the level of LTE in dBm where CPSI prints an index
    )
    survey_commands = (Command("AT+COPS=?", timeout_s=180.0),)
    gnss_start_commands = modem_gnss.CGPSINFO_ON
    gnss_poll_commands = modem_gnss.CGPSINFO
    mode_commands = network_mode.CNMP
    rows_in_columns = "+CPSI"
    long_numbers: ClassVar[Mapping[str, str]] = {"+CPSI": "[0-9]{10,11}"}  # a cell of NR

    def poll(self) -> Dialogue[tuple[Row, ...] | None]:
        """Cells received now, the serving one once and with a level."""
        rows = yield from self.ask(self.poll_commands)
        return None if rows is None else with_level(merge_serving_cells(rows))

    def rows_in(self, lines: Sequence[str]) -> tuple[Row, ...]:
        """Readings in lines of CPSI, CCINFO and CMGRMI; fixes of the modem's receiver."""
        return (
            *cpsi_cells(lines),
            *_system(lines),
            *_environment(lines),
            *modem_gnss.read_cgpsinfo(lines),
        )


def cpsi_cells(lines: Sequence[str]) -> tuple[Row, ...]:
    """Serving cells of +CPSI, two where LTE and NR are used together; `NoCell` for NO SERVICE."""
    found = (_cpsi(match[1]) for line in lines for match in _CPSI.finditer(line))
    return tuple(row for row in found if row is not None)


def _cpsi(text: str) -> Row | None:
    values = [value.strip() for value in _FINAL.sub("", text).split(",")]
    mode = values[0].upper()
    if mode == _NO_SERVICE:
        return NoCell(status=mode, state=at(values, 1) or None)
    system = _SYSTEM.fullmatch(mode)
    mode = (system[1] or system[2]) if system else mode
    if mode == "NR5G" and at(values, 1).isdecimal():  # beside LTE: neither state nor network
        has_band = at(values, 2).upper().startswith("NR5G")
        return _cpsi_cell(_NSA if has_band else _NSA_WITHOUT_BAND, values[1:], {})
    if mode not in _CPSI_FORMS:
        return None
    return _cpsi_cell(_CPSI_FORMS[mode], values[2:], {"state": at(values, 1)})


def _cpsi_cell(shape: Form, texts: list[str], more: Mapping[str, str]) -> CellReading | None:
    rat, n_all = shape.rat or "LTE", len(shape.names)
    more_texts = texts[n_all:]
    if len(more_texts) > _MOST_MORE or not all(map(_MORE.fullmatch, more_texts)):
        return None
    texts = texts[:n_all]
    if len(texts) < n_all:
        texts = texts[:-1]  # the last one may be cut
    named = shape.texts_by_name(texts)
    if named is None:
        return None
    on_gsm = _GSM_CHANNEL.fullmatch(named.get("channel", ""))
    place = {"arfcn": decimal(on_gsm[1], 0, 1023), "band": on_gsm[2]} if on_gsm else {}
    levels, raw = _LEVELS_OF.get(rat, _lte)(named)
    reading = cell("serving", rat, named, _CPSI_KINDS, {**more, **raw}, **place, **levels)
    has_level = reading and (reading.level_dbm is not None or reading.more.get("rsrp_raw"))
    if reading is None or (more_texts and rat != "NR" and not has_level):
        return None  # a comma too much moves the levels
    who = _identity(rat, named) if reading.arfcn is not None else None
    if who is None:
        return None if reading.level_dbm is None else reading
    return with_identity(reading, who)


def _identity(rat: Rat, named: Mapping[str, str]) -> Identity | None:
    """None where a part is damaged; a part marked as unknown is None in it."""
    if "plmn" not in named:
        return None
    area_bits, cid_bits = _BITS.get(rat, _BITS_OF_OTHERS)
    mcc, mnc = network(*named["plmn"].split("-", 1)) if "-" in named["plmn"] else (None, None)
    in_form = re.fullmatch(rf"0[xX][0-9A-Fa-f]{{1,{area_bits // 4}}}", named["area"])
    if mcc is None or not in_form or not re.fullmatch(r"-?\d{1,11}", named["cid"]):
        return None
    cid = cell_identity(named["cid"], cid_bits, base=10)  # 4000000000 is printed as -294967296
    return Identity(mcc, mnc, area(named["area"], 16, area_bits), cid)


def _gsm(named: Mapping[str, str]) -> _Levels:
    criteria = _C1_C2.fullmatch(named.get("c1_c2", ""))
    c1, c2 = criteria.groups() if criteria else ("", "")
    return {"c1": decimal(c1, -255, 255), "c2": decimal(c2, -255, 255)}, {}


def _wcdma(named: Mapping[str, str]) -> _Levels:
    """EC/IO and RSCP are printed without sign; an impossible one shows a lost or added value."""
    ecio, rscp = (named[name].removeprefix("-") for name in ("ecio", "rscp"))
    ecio_db = level(ecio, -32.0, -0.1, -1.0) if _ECIO.fullmatch(ecio) else None
    return {
        "rscp_dbm": rssi_dbm(rscp, -1.0) if ecio_db is not None else None,
        "ecio_db": ecio_db,
    }, {}


def _lte(named: Mapping[str, str]) -> _Levels:
    """Levels in one unit or none of them; the SNR is always in dB."""
    sinr = {"sinr_db": level(named.get("snr", ""), -23.0, 40.0)}
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
        "rsrq_db": _tenths(rsrq_db(rsrq, scale)),
        "rsrp_dbm": _tenths(rsrp_dbm(rsrp, scale)),
        "rssi_dbm": _tenths(rssi_dbm(rssi, scale)),
    }
    if levels["rsrq_db"] is None or (rssi and levels["rssi_dbm"] is None):
        return {}, {}
    return {**sinr, **levels}, {}


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
    if scale is None or "" in (named["rsrp"], named.get("rsrq")):
        return {}, raw  # which of the two is printed does not show
    ratio = rsrq_db(high, scale)
    if high and ratio is None:
        return {}, raw  # another unit than that of the level: one of them is damaged
    return {"rsrp_dbm": _tenths(rsrp_dbm(low, scale)), "rsrq_db": _tenths(ratio)}, raw


def _scale(rsrp: str) -> float | None:
    """Unit of the row: SIM7000 prints dB, SIM7600 tenths; None for the index of an A76xx."""
    if rsrp_dbm(rsrp) is not None:
        return 1.0
    return None if rsrp_dbm(rsrp, 0.1) is None else 0.1


def _tenths(level_db: float | None) -> float | None:
    """Rounded to what is printed."""
    return None if level_db is None else round(level_db, 1)


_LEVELS_OF = {"GSM": _gsm, "WCDMA": _wcdma, "NR": _nr}


def _system(lines: Sequence[str]) -> Iterator[Row]:
    for line in lines:
        for kind, text in _CCINFO.findall(line):
            reading = _system_cell("serving" if kind.upper() == "SCELL" else "neighbour", text)
            if reading is not None:
                yield reading


def _system_cell(role: Role, text: str) -> CellReading | None:
    pairs = ((label.lower(), value, comma) for label, value, comma in _PAIR.findall(text))
    named = {label: value for label, value, comma in pairs if comma or label in _LAST}
    if ("arfcn" in named) == ("uarfcn" in named):
        return None
    on_gsm = "arfcn" in named
    kept = _CCINFO_KINDS.keys() - ({"rscp", "ecio"} if on_gsm else set())
    named = {name: value for name, value in named.items() if name in kept}
    row = _WHO.match(text)
    who = _system_identity(row, cid_bits=16 if on_gsm else 28) if row else None
    levels = {name: named[name] for name in named.keys() & _CCINFO_LEVELS}
    rat: Rat = "GSM" if on_gsm else "WCDMA"
    reading = cell(role, rat, named, _CCINFO_KINDS)
    if who is not None:
        return with_identity(reading or CellReading(role, rat), who)
    known = (value for value in read_values(levels, _CCINFO_KINDS).values() if value is not None)
    return None if next(known, None) is None else reading


def _system_identity(found: re.Match[str], cid_bits: int) -> Identity | None:
    mcc, mnc, lac, cell = found.groups()[1:]
    if network(mcc, "00")[0] is None:
        return None
    padded = len(mnc) == 1 or (len(mnc) == 3 and mnc.startswith("0"))  # 001 is printed for 01
    cid = cell_identity(cell, cid_bits, 10)
    return Identity(mcc, None if padded else mnc, area(lac, 10), cid)


def _environment(lines: Sequence[str]) -> Iterator[Row]:
    """LTE cells of CMGRMI; a neighbour's channel stands in the row of its group, further up."""
    channels: dict[str, str] = {}
    serving: tuple[int | None, int | None] | None = None
    for line in lines:
        for name, text in _CMGRMI.findall(line):
            kind, values = name.upper(), [value.strip() for value in text.split(",")]
            reading = None
            if kind == "SERVING_CELL" and len(values) == len(_SERVING.names):
                channels = {}
                named = dict(zip(_SERVING.names, values, strict=True))
                if str(len(named["mnc"])) != named["digits"]:
                    named["mcc"] = ""
                reading = cell("serving", "LTE", named, _CMGRMI_KINDS)
                serving = (reading.arfcn, reading.pci) if reading else None
            elif kind == "LTE_INTRA" and len(values) > 2:
                channels["intra"] = values[1]
                serving = serving or (decimal(values[1]), decimal(values[2]))
            elif kind == "LTE_INTER":
                channels |= dict(_FREQUENCY.findall(text))
            elif (group := _group(kind)) and (row := _NEIGHBOUR.texts_by_name(values)):
                named = {**row, "earfcn": channels.get(group, "")}
                reading = cell("neighbour", "LTE", named, _CMGRMI_KINDS)
                places = {serving, (None, serving[1])} if serving else set()
                if reading and (reading.arfcn, reading.pci) in places:
                    reading = None  # the serving cell, also where the channel is lost
            if reading is not None:
                yield reading


def _group(kind: str) -> str | None:
    inter = _INTER_CELL.fullmatch(kind)
    return inter[1] if inter else "intra" if _INTRA_CELL.fullmatch(kind) else None
