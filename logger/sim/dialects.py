"""Simulated modems by name: identity, settings, and replies made of what is received.

Formats are written from manuals and captures, independently of the drivers that read them: rows of
AT+CENG from SIM800 AT Command Manual V1.09 p161-163 and captures 001 to 018, those of a SIM7600
from captures 029, 049 and 170 to 180 (see firmware_notes). What all modems answer is 3GPP TS
27.007.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from logger.sim.world import NEIGHBOURS, Air, ModemFix, ReceivedCell

Settings = Mapping[str, str]
"""Values of the settings by name, {"+CENG": "1,1"}; "=" is the argument of the command."""
Answer = Sequence[str] | int
"""Blocks of text before OK, or the number of a +CME ERROR (3GPP TS 27.007 9.2)."""
Listing = Callable[[Air, Settings], Answer]

IMEI = "004999010640000"
"""IMEI of a test device; modems may print theirs unsolicited."""
NETWORK_NAME = "Test PLMN 1-1"
NO_SIM = 10
NO_SERVICE = 30


@dataclass(frozen=True, slots=True)
class Setting:
    """The value after power-up, and the form of accepted ones; parts left out stay as they are.

    What is `stored` survives a power cut.
    """

    default: str
    form: re.Pattern[str]
    stored: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Dialect:
    """One model.

    `replies` are by command without its AT, in capitals; one that ends with "=" takes any argument.
    `takes_s` is how long slow ones take, `unsolicited` what the modem prints by itself every few
    seconds; `registered` ones have a SIM card; on `abortable` ones a character ends a slow command,
    the others read it afterwards.
    """

    name: str
    identity: Mapping[str, Sequence[str]]
    replies: Mapping[str, Listing]
    settings: Mapping[str, Setting] = field(default_factory=dict)
    takes_s: Mapping[str, float] = field(default_factory=dict)
    unsolicited: Listing | None = None
    boot: Sequence[str] = ("RDY", "+CFUN: 1", "Call Ready")
    registered: bool = False
    abortable: bool = False


def setting(default: str, form: str, *, stored: bool = False) -> Setting:
    return Setting(default, re.compile(form), stored)


def identity_replies(
    ati: Sequence[str], maker: str, model: str, revision: str
) -> dict[str, Sequence[str]]:
    """Answers to the four commands that ask for the identity."""
    return {"I": ["\r\n".join(ati)], "+CGMI": [maker], "+CGMM": [model], "+CGMR": [revision]}


def block(lines: Sequence[str]) -> list[str]:
    """Lines without blank ones in between; nothing for none."""
    return ["\r\n".join(lines)] if lines else []


GSM_ACT = 0
SETTINGS = {
    "+CMEE": setting("0", "[0-2]"),
    "+CREG": setting("0", "[0-2]"),
    "+CGREG": setting("0", "[0-2]"),
    "+COPS": setting("0,0", "3,[0-2]"),
}
COPS_SCAN_S = 30.0


def csq(air: Air, _: Settings) -> Answer:
    level = 99 if air.serving is None else min(max((air.serving.dbm + 113) // 2, 0), 31)
    return [f"+CSQ: {level},{0 if air.serving else 99}"]


def cesq(air: Air, _: Settings) -> Answer:
    return [f"+CESQ: {air.serving.rxlev if air.serving else 99},99,255,255,255,255"]


def registration(name: str) -> Listing:
    """Answer of a modem in the network: `n,stat` and, where it was set, area and cell."""

    def listing(air: Air, settings: Settings) -> Answer:
        n = settings[name]
        if air.serving is None:
            return [f"{name}: {n},2"]
        cell = air.serving.cell
        return [f"{name}: {n},1" + (f',"{cell.lac:04X}","{cell.cid:04X}"' if n == "2" else "")]

    return listing


def no_registration(name: str) -> Listing:
    return lambda _, settings: [f"{name}: {settings[name]},0"]


def network(air: Air, settings: Settings) -> Answer:
    if air.serving is None:
        return ["+COPS: 0"]
    form = settings["+COPS"][-1]
    cell = air.serving.cell
    name = f"{cell.mcc}{cell.mnc}" if form == "2" else NETWORK_NAME
    return [f'+COPS: 0,{form},"{name}",{GSM_ACT}']


def networks(air: Air, _: Settings) -> Answer:
    plmns = dict.fromkeys(f"{one.cell.mcc}{one.cell.mnc}" for one in air.decoded_cells)
    offered = ",".join(
        f'(1,"{NETWORK_NAME}","{NETWORK_NAME}","{plmn}",{GSM_ACT})' for plmn in plmns
    )
    return [f"+COPS: {offered},,(0,1,3,4),(0,1,2)"]


EPS: Mapping[str, Listing] = {"+CEREG?": no_registration("+CEREG"), "+CESQ": cesq}
"""What modems of LTE know besides, while they camp on GSM."""
EPS_SETTINGS = {"+CEREG": setting("0", "[0-2]")}

ANYWHERE: Mapping[str, Listing] = {"+CSQ": csq, "+COPS=?": networks}
REGISTERED: Mapping[str, Listing] = {
    "+CPIN?": lambda *_: ["+CPIN: READY"],
    "+CREG?": registration("+CREG"),
    "+CGREG?": no_registration("+CGREG"),
    "+COPS?": network,
}
NO_CARD: Mapping[str, Listing] = {
    "+CPIN?": lambda *_: NO_SIM,
    "+CREG?": no_registration("+CREG"),
    "+CGREG?": no_registration("+CGREG"),
    "+COPS?": lambda *_: ["+COPS: 0"],
}


_DBM_OF_RXL_0 = -113
_RXL_MAX = 64
"""The manual counts to 63, one modem printed 64."""
_RLA, _TXP = 5, 5  # as captured; access is allowed from -110 dBm + _RLA (3GPP TS 45.008 6.4)
_IDLE = ",x,x,x,x,x,x,x"  # tch to ch_mod, which only a call fills


def _rxl(one: ReceivedCell) -> int:
    return min(max(one.dbm - _DBM_OF_RXL_0, 0), _RXL_MAX)


def ceng_rows(mode: int, ncell: int, air: Air) -> list[str]:
    """Rows of AT+CENG from the serving cell on; none without it and in mode 0."""
    if air.serving is None or mode == 0:
        return []
    texts = [_ceng_serving(mode, air.serving)]
    texts += [
        text
        for one in (air.neighbours if air.serving else air.others)
        if (text := _ceng_neighbour(mode, ncell, one))
    ]
    if mode == 3:
        texts += [",,0000,0000,00,00"] * NEIGHBOURS
    return [f'+CENG: {number},"{text}"' for number, text in enumerate(texts[: 1 + NEIGHBOURS])]


def _ceng_serving(mode: int, one: ReceivedCell) -> str:
    cell = one.cell
    if mode == 3:
        return _ceng_location(one)
    text = (
        f"{cell.arfcn:04d},{_rxl(one):02d},00,{cell.mcc},{cell.mnc},{cell.bsic:02d},{cell.cid:04x}"
        f",{_RLA:02d},{_TXP:02d},{cell.lac:04x},255"  # 255: no timing advance without a call
    )
    return text if mode != 4 else f"{text},{_rxl(one) + _DBM_OF_RXL_0},{one.c1},{one.c2}{_IDLE}"


def _ceng_neighbour(mode: int, ncell: int, one: ReceivedCell) -> str | None:
    """None where no form is known of a cell that is not decoded."""
    if mode in {3, 4} and not one.is_decoded:
        return None
    cell = one.cell
    if mode == 3:
        return _ceng_location(one)
    head = f"{cell.arfcn:04d},{_rxl(one):02d},{cell.bsic if one.is_decoded else 0:02d}"
    if not one.is_decoded:
        return f"{head},ffff,,,0000" if ncell else f"{head},,,0000"
    cid = f",{cell.cid:04x}" if ncell else ""
    criteria = f",{one.c1},{one.c2}" if mode == 4 else ""
    return f"{head}{cid},{cell.mcc},{cell.mnc},{cell.lac:04x}{criteria}"


def _ceng_location(one: ReceivedCell) -> str:
    cell = one.cell
    return f"{cell.mcc},{cell.mnc},{cell.lac:04x},{cell.cid:04x},{cell.bsic:02d},{_rxl(one):02d}"


_NETSCAN_S = 40.0  # up to 45 by the manual, p197


def _engineering(air: Air, settings: Settings) -> Answer:
    return [f"+CENG: {settings['+CENG']}", *block(_rows(air, settings))]


def _unsolicited(air: Air, settings: Settings) -> Answer:
    return block(_rows(air, settings)) if settings["+CENG"].startswith("2") else []


def _rows(air: Air, settings: Settings) -> list[str]:
    mode, ncell = settings["+CENG"].split(",")
    return ceng_rows(int(mode), int(ncell), air)


def _netscan(air: Air, settings: Settings) -> Answer:
    """A line for each cell, without prefix; here the colour codes are hexadecimal."""
    long = settings["+CNETSCAN"] == "1"
    lines = [
        f'Operator:"{NETWORK_NAME}",MCC:{one.cell.mcc},MNC:{one.cell.mnc},Rxlev:{one.rxlev}'
        f",Cellid:{one.cell.cid:04X},Arfcn:{one.cell.arfcn}"
        + (f",Lac:{one.cell.lac:04X},Bsic:{one.cell.bsic:02X}" if long else "")
        for one in air.decoded_cells
    ]
    return block(lines) or NO_SERVICE


def _csq_of_sim800(air: Air, _: Settings) -> Answer:
    """By the table of this manual, where 2 is -110 dBm."""
    return [f"+CSQ: {min(max((air.serving.dbm if air.serving else -115) + 114, 0) // 2, 31)},0"]


SIM800 = Dialect(
    "sim800",
    identity_replies(
        ["SIM800 R14.18"], "SIMCOM_Ltd", "SIMCOM_SIM800L", "Revision:1418B05SIM800L24"
    ),
    replies={"+CENG?": _engineering, "+CNETSCAN": _netscan, "+CSQ": _csq_of_sim800},
    settings=SETTINGS
    | {"+CENG": setting("0,0", "[0-4](?:,[01])?"), "+CNETSCAN": setting("0", "[01]")},
    takes_s={"+CNETSCAN": _NETSCAN_S},
    unsolicited=_unsolicited,
    boot=("RDY", "+CFUN: 1", "+CPIN: NOT INSERTED", "Call Ready", "SMS Ready"),
)


KNOTS_PER_MPS = 3600 / 1852
_CGPS_SETTINGS = {"+CGPS": setting("0", "[01](?:,[1-3])?")}
CNMP: Mapping[str, Listing] = {"+CNMP?": lambda _, settings: [f"+CNMP: {settings['+CNMP']}"]}
"""The choice of technologies; it outlasts the power."""
CNMP_SETTINGS = {"+CNMP": setting("2", "2|13|38|51", stored=True)}


def _cgpsinfo(air: Air, settings: Settings) -> Answer:
    """Degrees and minutes, and knots; all values are empty without a fix."""
    fix = air.fix()
    if fix is None or settings["+CGPS"].startswith("0"):
        return ["+CGPSINFO: ,,,,,,,,"]
    lat, lon = angle_text(fix.lat_deg, 2, "NS", 6), angle_text(fix.lon_deg, 3, "EW", 6)
    motion = f"{fix.speed_mps * KNOTS_PER_MPS:.1f},{fix.course_deg:.1f}"
    return [f"+CGPSINFO: {lat},{lon},{fix.utc:%d%m%y},{tenths(fix)},{fix.alt_m:.1f},{motion}"]


def tenths(fix: ModemFix) -> str:
    return f"{fix.utc:%H%M%S}.{fix.utc.microsecond // 100_000}"


def angle_text(angle_deg: float, degree_digits: int, letters: str, decimals: int = 5) -> str:
    """As `ddmm.mmmmm`; the second of `letters` is the negative hemisphere."""
    # Rounded once, in steps of the last decimal, so that no 60.00000 minutes come out.
    minute = 10**decimals
    degrees, steps = divmod(round(abs(angle_deg) * (60 * minute)), 60 * minute)
    minutes, fraction = divmod(steps, minute)
    side = letters[angle_deg < 0.0]
    return f"{degrees:0{degree_digits}d}{minutes:02d}.{fraction:0{decimals}d},{side}"


LTE_ONLY = "38"
"""Value of +CNMP with which the transmitters are reported as LTE cells without neighbours."""
RSSI_OVER_RSRP_DB = 28  # of 10 MHz


def system_information(air: Air, settings: Settings) -> Answer:
    """The serving cell; the area is hexadecimal and the cell decimal."""
    one = air.serving
    if one is None:
        return ["+CPSI: NO SERVICE,Online"]
    cell = one.cell
    if settings["+CNMP"] == LTE_ONLY:
        where = f"{cell.mcc}-{cell.mnc},0x{cell.lac:04X},{cell.cid},{cell.bsic},EUTRAN-BAND3"
        levels = f"-80,{one.dbm * 10},{(one.dbm + RSSI_OVER_RSRP_DB) * 10},12"
        return [f"+CPSI: LTE,Online,{where},{1200 + cell.arfcn},5,5,{levels}"]
    band = "EGSM 900" if cell.arfcn < 512 or cell.arfcn > 885 else "DCS 1800"
    where = f"{cell.mcc}-{cell.mnc},0x{cell.lac:04X},{cell.cid},{cell.arfcn} {band}"
    return [f"+CPSI: GSM,Online,{where},{one.dbm},0,{one.c1}-{one.c2}"]


def _cell_information(air: Air, settings: Settings) -> Answer:
    """All of it decimal."""
    if air.serving is None or settings["+CNMP"] == LTE_ONLY:
        return []
    serving = f"+CCINFO:[SCELL],{_labels(air.serving)},TA:0,TXPWR:0"
    found = enumerate(air.decoded_neighbours, 1)
    return block([serving, *(f"+CCINFO:[NCell{number}],{_labels(one)}" for number, one in found)])


def _labels(one: ReceivedCell) -> str:
    cell = one.cell
    return (
        f"ARFCN:{cell.arfcn},MCC:{cell.mcc},MNC:{cell.mnc},LAC:{cell.lac},ID:{cell.cid}"
        f",BSIC:{cell.bsic},RXLev:{one.dbm}dbm,C1:{one.c1},C2:{one.c2}"
    )


SIM7600 = Dialect(
    "sim7600",
    identity_replies(
        [
            "Manufacturer: SIMCOM INCORPORATED",
            "Model: SIMCOM_SIM7600E-H",
            "Revision: SIM7600M22_V2.0",
            f"IMEI: {IMEI}",
            "+GCAP: +CGSM",
        ],
        "SIMCOM INCORPORATED",
        "SIMCOM_SIM7600E-H",
        "+CGMR: LE20B03SIM7600M22",
    ),
    replies={
        "+CPSI?": system_information,
        "+CCINFO": _cell_information,
        "+CGPSINFO": _cgpsinfo,
        **EPS,
        **CNMP,
    },
    settings=SETTINGS | EPS_SETTINGS | _CGPS_SETTINGS | CNMP_SETTINGS,
    takes_s={"+COPS=?": COPS_SCAN_S},
    boot=("RDY", "+CPIN: NOT INSERTED", "SMS DONE", "PB DONE"),
)

DIALECTS: Mapping[str, Dialect] = {dialect.name: dialect for dialect in (SIM800, SIM7600)}
