"""The values that travel from the ports to the run file, and the ranges they can have.

One frozen dataclass for each record: the annotations hold type, mark of an unknown value and unit
of each column of the run file, of which `schema` makes the tables. Fields without them are not
stored.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from typing import Annotated, Any, Literal

EARLIEST_UTC_NS = 1_577_836_800 * 10**9
"""2020-01-01, before any run of this program.

A receiver that is wrong by a rollover of GPS's week counter is outside of the 1024 weeks from here,
as is a clock that was never set.
"""
LATEST_UTC_NS = EARLIEST_UTC_NS + 1024 * 7 * 86_400 * 10**9
IMPOSSIBLE_DATE = "impossible-date"
"""Code of the note that a receiver's date is before them."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def utc_text(utc_ns: int, *, compact: bool = False) -> str:
    """ISO 8601 to the second, `20200207T021417Z` when compact."""
    when = _EPOCH + timedelta(microseconds=utc_ns // 1000)
    return when.strftime("%Y%m%dT%H%M%SZ" if compact else "%Y-%m-%dT%H:%M:%SZ")


def known_utc_text(utc_ns: int | None) -> str | None:
    """As `utc_text`."""
    return None if utc_ns is None else utc_text(utc_ns)


UNKNOWN_ID = -1
"""Mark of an unknown integer that cannot be negative."""
UNKNOWN_TIME = -(2**63)
UNKNOWN_SIGNED = -(2**31)

Flag = Annotated[bool, "|u1"]
Int = Annotated[int, "<i4"]
Seq = Annotated[int, "<i8"]
Float = Annotated[float, "<f8"]
Real = Annotated[float | None, "<f8"]
Count = Annotated[int | None, "<i4", UNKNOWN_ID]
LongId = Annotated[int | None, "<i8", UNKNOWN_ID]
Signed = Annotated[int | None, "<i4", UNKNOWN_SIGNED]
Time = Annotated[int | None, "<i8", UNKNOWN_TIME]
Digits = Annotated[str | None, "S4"]
Covariance = Annotated[Float, "covariance"]


@dataclass(frozen=True, slots=True)
class Column:
    """One column: numpy dtype, unit or meaning, and the mark of an unknown integer."""

    name: str
    dtype: str
    unit: str
    unknown: int | None = None


def columns_of(record: type) -> tuple[Column, ...]:
    """Columns of the annotated fields of a record, in their order."""
    columns = []
    for name, hint in record.__annotations__.items():
        if stored := getattr(hint, "__metadata__", None):
            dtype, *unknown, unit = stored
            columns.append(Column(name, dtype, unit, *unknown))
    return tuple(columns)


# --- records ---

Role = Literal["serving", "neighbour", "scan"]
Rat = Literal["GSM", "WCDMA", "LTE", "LTE-M", "NB-IoT", "NR"]
Level = Literal["info", "warning", "error"]
Verdict = Literal["located", "ambiguous", "cannot tell"]

MOST_NEIGHBOURS = 64
"""Channels of a stored neighbour list: Telit prints 32 at most (LE910 manual p287)."""
HIGHEST_ARFCN = 1023
"""Of GSM (3GPP TS 45.005 2)."""
RXLEV_0_DBM = -110.0
"""Nominal level of RXLEV 0 (3GPP TS 45.008, 8.1.4)."""
DEAD_RECKONING, BY_HAND, SIMULATED = 6, 7, 8
"""GGA qualities of a fix that was not measured."""


@dataclass(frozen=True, slots=True)
class RawBytes:
    """Bytes as they crossed a port; `sent` is True for those that the logger wrote."""

    data: bytes
    sent: bool = False


@dataclass(frozen=True, slots=True)
class Fix:
    """One epoch of a GNSS receiver, also without a position (`valid` False, position None).

    `quality` is that of NMEA's GGA: 1 to 5 are measured, 6 is dead reckoning without satellites;
    7 (typed in by hand) and 8 (simulated) are no positions.
    """

    valid: Annotated[Flag, "1 when the receiver had a position"]
    utc_ns: Annotated[Time, "ns since 1970 UTC, by GPS"] = None
    lat_deg: Annotated[Real, "deg north, WGS 84"] = None
    lon_deg: Annotated[Real, "deg east, WGS 84"] = None
    alt_m: Annotated[Real, "m above sea level"] = None
    acc_m: Annotated[Real, "m, radius that holds 68 % of the positions"] = None
    hdop: Annotated[Real, "1"] = None
    sats_used: Annotated[Count, "satellites"] = None
    quality: Annotated[Count, "NMEA 0183 GGA quality"] = None
    speed_mps: Annotated[Real, "m/s"] = None
    course_deg: Annotated[Real, "deg clockwise from true north"] = None


@dataclass(frozen=True, slots=True)
class Broadcast:
    """What a GSM cell broadcasts of its neighbours and of reselection, as a modem prints it.

    None is "not printed"; an empty tuple is a list printed without a channel. No form of a row
    shows that a digit of these values was lost or changed; `broadcast_unsure` is True until the
    modem has printed the same of the cell once more.
    """

    neighbour_arfcns: Annotated[
        tuple[int, ...] | None,
        "S320",
        'channels of the neighbour list (BA), in the order printed; "none" for an empty list',
    ] = None
    cro_db: Annotated[Count, "dB, cell reselection offset (CRO)"] = None
    penalty_time: Annotated[Count, "code 0 to 31; with 31 the offset is subtracted"] = None
    t3212_raw: Annotated[Count, "periodic update timer as printed; 3GPP counts 6 minutes"] = None
    broadcast_unsure: Annotated[
        Flag, 0, "1 until the modem has printed the same of the cell twice"
    ] = False


@dataclass(frozen=True, slots=True)
class CellReading:
    """One cell as one reply of a modem reports it.

    Identities are integers, whatever base the modem prints. `label` names the cell if an imported
    file has no identity; a modem never fills it. `more` is what else the modem prints, which the
    run file keeps as raw bytes only. `identity_unsure`: a byte of the identity may be damaged; the
    text of its column is older, since runs are sealed with it. `broadcast` is None where the modem
    prints nothing of it.
    """

    role: Annotated[Role, "S12", "serving, neighbour or scan"]
    rat: Annotated[Rat | None, "S8", "radio access technology"] = None
    mcc: Annotated[Digits, "mobile country code, as printed"] = None
    mnc: Annotated[Digits, "mobile network code, as printed"] = None
    lac: Annotated[Count, "location area code, GSM and WCDMA"] = None
    tac: Annotated[Count, "tracking area code, LTE and later"] = field(default=None, kw_only=True)
    cid: Annotated[LongId, "cell identity"] = None
    arfcn: Annotated[Count, "channel number"] = None
    arfcn_raw: Annotated[Count, "channel number as printed"] = None
    band: Annotated[int | str | None, "S12", "band as printed"] = None
    bsic: Annotated[Count, "GSM: 8 NCC + BCC"] = None
    psc: Annotated[Count, "WCDMA: primary scrambling code"] = None
    pci: Annotated[Count, "LTE and later: physical cell identity"] = None
    rxlev_raw: Annotated[Count, "level index as printed"] = None
    rxq: Annotated[Count, "quality index as printed"] = None
    rssi_dbm: Annotated[Real, "dBm"] = None
    rscp_dbm: Annotated[Real, "dBm, WCDMA"] = None
    ecio_db: Annotated[Real, "dB, WCDMA"] = None
    rsrp_dbm: Annotated[Real, "dBm, LTE and later"] = None
    rsrq_db: Annotated[Real, "dB, LTE and later"] = None
    sinr_db: Annotated[Real, "dB, LTE and later"] = None
    ta: Annotated[Count, "timing advance, steps of 553.5 m"] = None
    c1: Annotated[Signed, "path loss criterion C1"] = None
    c2: Annotated[Signed, "reselection criterion C2"] = None
    label: str | None = None
    identity_unsure: Annotated[Flag, 0, "1 where a byte of the identity may be lost or doubled"] = (
        False
    )
    ta_16ts: Annotated[Count, "timing advance of LTE, steps of 78.07 m"] = field(
        default=None, kw_only=True
    )
    level_sd_db: Annotated[Real, "dB, scatter of the levels whose median this is"] = field(
        default=None, kw_only=True
    )
    n_levels: Annotated[Count, "levels whose median this is"] = field(default=None, kw_only=True)
    broadcast: Broadcast | None = None
    more: Mapping[str, int | str | None] = field(default_factory=dict, hash=False)

    @property
    def cell(self) -> str | None:
        """Name of the cell, `mcc-mnc-area-cid`; None while the modem has not decoded it."""
        if self.label is not None:
            return self.label
        area = self.tac if self.lac is None else self.lac
        if None in (self.mcc, self.mnc, area, self.cid):
            return None
        return f"{self.mcc}-{self.mnc}-{area}-{self.cid}"

    @property
    def level_dbm(self) -> float | None:
        """Level used for estimation: that of the cell's own signal, if the technology has one.

        Modems without a documented dBm scale get the nominal one of 3GPP TS 45.008, 8.1.4. Its
        unknown offset is the same for all readings of a modem and becomes part of P0.
        """
        for level_dbm in (self.rsrp_dbm, self.rscp_dbm, self.rssi_dbm):
            if level_dbm is not None:
                return level_dbm
        return None if self.rxlev_raw is None else self.rxlev_raw + RXLEV_0_DBM


@dataclass(frozen=True, slots=True)
class Scan:
    """All cells of one reply of a modem, begun at `t_start_ns`; empty if it reports no cell.

    `fix_start_seq` and `fix_seq` are the record numbers of the fixes that were current at its begin
    and when it was recorded, None without one.
    """

    t_start_ns: Annotated[Seq, "ns since boot, when the command was sent"]
    readings: tuple[CellReading, ...]
    fix_start_seq: Annotated[LongId, "seq of the fix current when the command was sent"] = None
    fix_seq: Annotated[LongId, "seq of the fix current at the end of the scan"] = None


@dataclass(frozen=True, slots=True)
class Note:
    """An event: a port lost, bytes dropped, a new target, the reason of the stop."""

    level: Annotated[Level, "S8", "info, warning or error"]
    code: Annotated[str, "S24", "kind of event"]
    text: Annotated[str, "S400", "what happened"]


@dataclass(frozen=True, slots=True)
class LiveEstimate:
    """The on-device estimate after the reading of `cell` in scan `scan_seq`.

    p_.. is the upper triangle of the covariance of [x, y, P0, eta], written x, y, 0, e.
    `probability` is that of the position the state belongs to: below 1 there are others.
    """

    scan_seq: Annotated[Seq, "seq of the scan that was used"]
    stage: Annotated[str, "S16", "which estimator"]
    cell: Annotated[str, "S64", "target"]
    n: Annotated[Int, "readings used so far"]
    utm_zone: Annotated[Int, "UTM zone, negative south of the equator"]
    x_m: Annotated[Float, "m east"]
    y_m: Annotated[Float, "m north"]
    p0_dbm: Annotated[Float, "dBm at 1 m"]
    eta: Annotated[Float, "1"]
    p_xx: Covariance
    p_xy: Covariance
    p_x0: Covariance
    p_xe: Covariance
    p_yy: Covariance
    p_y0: Covariance
    p_ye: Covariance
    p_00: Covariance
    p_0e: Covariance
    p_ee: Covariance
    innovation_db: Annotated[Float, "dB"]
    innovation_var_db2: Annotated[Float, "dB^2"]
    probability: Annotated[Float, "1, of this position; below 1 there are other possible positions"]


Value = RawBytes | Fix | Scan | Note | LiveEstimate


@dataclass(frozen=True, slots=True)
class Record:
    """A value, when it was complete (ns since boot) and its source ("modem", "gnss", "logger")."""

    t_ns: int
    source: str
    value: Value


# --- ranges of levels and codes ---

# Modems and other programs print fillers where they know no level or no cell. All of them are
# outside of these ranges or among these codes.

_GSM_DBM = (-113.0, -47.0)
"""Lowest index (SIM800 manual V1.09 p163) to RXLEV 63 (3GPP TS 45.008 8.1.4)."""
_RSRP_DBM = (-140.0, -43.0)
"""3GPP TS 36.133 9.1.4, and one step more at the strong end, where modems round."""
_COVERAGE_DBM = (-156.0, -43.0)
"""The same with enhanced coverage: NB-IoT (36.133 9.1.22.9) and LTE-M (9.1.4, extended)."""
_CARRIER_DBM = (-120.0, -25.0)
"""Total power on a channel, up to the highest that a receiver must bear (3GPP TS 36.101 7.4)."""
_RANGES_DBM: Mapping[str, Mapping[Rat | None, tuple[float, float]]] = {
    "rssi_dbm": {"GSM": _GSM_DBM, None: _CARRIER_DBM},
    "rscp_dbm": {None: (-120.0, -25.0)},  # 3GPP TS 25.133 9.1.1.3
    "rsrp_dbm": {
        "NB-IoT": _COVERAGE_DBM,
        "LTE-M": _COVERAGE_DBM,
        "NR": (-156.0, -31.0),  # 3GPP TS 38.133 10.1.6
        None: _RSRP_DBM,
    },
}
"""Range of a level by technology, None for others; outside is a filler or damage."""
_OWN = {
    "WCDMA": "rscp_dbm",
    "LTE": "rsrp_dbm",
    "LTE-M": "rsrp_dbm",
    "NB-IoT": "rsrp_dbm",
    "NR": "rsrp_dbm",
}
"""The level of the cell alone, not replaced by the carrier's where damaged."""
CARRIER_ABOVE_DB = (-3.0, 60.0)
"""Carrier above cell: up to 20 dB (resource blocks) and 34 dB (RSRQ), averaged separately."""
_IDENTITY_BITS: Mapping[Rat | None, int] = {"GSM": 16, "NR": 36}
"""Others have 28 (3GPP TS 23.003 4.3, TS 36.413 9.2.1.38, TS 38.413 9.3.1.7)."""


def widest_dbm(name: str) -> tuple[float, float]:
    """Lowest and highest value of a level of any technology, for example of `rsrp_dbm`."""
    lowest, highest = zip(*_RANGES_DBM[name].values(), strict=True)
    return min(lowest), max(highest)


def range_dbm(rat: Rat) -> tuple[float, float]:
    """Lowest and highest level of a cell of a technology."""
    ranges = _RANGES_DBM[_OWN.get(rat, "rssi_dbm")]
    return ranges.get(rat, ranges[None])


def reportable(reading: CellReading) -> CellReading:
    """The reading without levels that its technology cannot report."""
    outside = {name for name in _RANGES_DBM if not _is_reportable(reading, name)}
    own = _OWN.get(reading.rat or "", "")
    is_lost = not outside.isdisjoint(_OWN.values())
    if is_lost or (own and not _holds(reading.rssi_dbm, getattr(reading, own))):
        outside.add("rssi_dbm")
    if not outside:
        return reading
    nothing: dict[str, Any] = dict.fromkeys(outside)
    return replace(reading, **nothing)


def area_marks(bits: int = 16) -> set[int]:
    """Location or tracking area codes that mean no area (3GPP TS 24.008 10.5.1.3)."""
    return {0, 0xFFFE, 0xFFFF, 2**bits - 2, 2**bits - 1}


def identity_marks(bits: int) -> set[int]:
    """Cell identities that modems and programs print for no cell: 0 and all ones."""
    return {0, 0xFFFF, *(2**width - 1 for width in (28, 31, 32, bits))}


def identity_bits(rat: Rat | None) -> int:
    """Length of a cell identity."""
    return _IDENTITY_BITS.get(rat, 28)


def _holds(carrier_dbm: float | None, cell_dbm: float | None) -> bool:
    low, high = CARRIER_ABOVE_DB
    return carrier_dbm is None or cell_dbm is None or low <= carrier_dbm - cell_dbm <= high


def _is_reportable(reading: CellReading, name: str) -> bool:
    value: float | None = getattr(reading, name)
    ranges = _RANGES_DBM[name]
    low, high = ranges.get(reading.rat, ranges[None])
    return value is None or low <= value <= high
