"""The values that travel from the ports to the run file: one frozen dataclass for each kind of
record.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Role = Literal["serving", "neighbour", "scan"]
Rat = Literal["GSM", "WCDMA", "LTE", "LTE-M", "NB-IoT", "NR"]
Level = Literal["info", "warning", "error"]


@dataclass(frozen=True, slots=True)
class RawBytes:
    """Bytes as they crossed a port; `sent` is True for what the logger wrote."""

    data: bytes
    sent: bool = False


DEAD_RECKONING, BY_HAND, SIMULATED = 6, 7, 8
"""Qualities of a fix that was not measured."""


@dataclass(frozen=True, slots=True)
class Fix:
    """One epoch of a GNSS receiver, also when it has no position (`valid` False, position None).

    `quality` is that of NMEA's GGA: 1 to 5 measured, 6 by dead reckoning, without satellites; 7
    typed in by hand and 8 simulated are no positions.
    """

    valid: bool
    utc_ns: int | None = None
    lat_deg: float | None = None
    lon_deg: float | None = None
    alt_m: float | None = None
    acc_m: float | None = None
    hdop: float | None = None
    sats_used: int | None = None
    quality: int | None = None
    speed_mps: float | None = None
    course_deg: float | None = None


@dataclass(frozen=True, slots=True)
class CellReading:
    """One cell as one reply of a modem reports it; identities are integers whatever base the modem
    prints.

    `lac` is that of GSM and WCDMA, `tac` that of LTE and later; `arfcn` is the channel of any
    technology. `ta` is the GSM timing advance in steps of 553.5 m (3GPP TS 45.010). `label` names
    the cell where a file was imported that has no identity; a modem never fills it. `more` is what
    else the modem prints and the run file keeps as raw bytes only. `identity_unsure`: the form of
    the row does not rule out that a byte of the identity was lost or doubled.
    """

    role: Role
    rat: Rat | None = None
    mcc: str | None = None
    mnc: str | None = None
    lac: int | None = None
    cid: int | None = None
    tac: int | None = None
    arfcn: int | None = None
    arfcn_raw: int | None = None
    band: int | str | None = None
    bsic: int | None = None
    psc: int | None = None
    pci: int | None = None
    rxlev_raw: int | None = None
    rxq: int | None = None
    rssi_dbm: float | None = None
    rscp_dbm: float | None = None
    ecio_db: float | None = None
    rsrp_dbm: float | None = None
    rsrq_db: float | None = None
    sinr_db: float | None = None
    ta: int | None = None
    c1: int | None = None
    c2: int | None = None
    label: str | None = None
    identity_unsure: bool = False
    more: Mapping[str, int | str | None] = field(default_factory=dict, hash=False)

    @property
    def cell(self) -> str | None:
        """Name of the cell, `mcc-mnc-area-cid`, or None while the modem has not decoded who it
        is.
        """
        if self.label is not None:
            return self.label
        area = self.tac if self.lac is None else self.lac
        if self.mcc is None or self.mnc is None or area is None or self.cid is None:
            return None
        return f"{self.mcc}-{self.mnc}-{area}-{self.cid}"

    @property
    def level_dbm(self) -> float | None:
        """Level used for estimation: that of the cell's own signal, where the technology tells it
        apart.

        Where a modem documents no dBm scale the nominal one of 3GPP TS 45.008 8.1.4 stands in (-110
        dBm + RXLEV); its unknown offset is the same for all readings of the modem and ends up in
        P0.
        """
        for level_dbm in (self.rsrp_dbm, self.rscp_dbm, self.rssi_dbm):
            if level_dbm is not None:
                return level_dbm
        return None if self.rxlev_raw is None else self.rxlev_raw - 110.0


@dataclass(frozen=True, slots=True)
class Scan:
    """All cells of one reply of a modem, begun at `t_start_ns`; empty where it says that there is
    no cell.

    `fix_start_seq` and `fix_seq` are the record numbers of the fixes that were current when it
    began and when it was recorded, None without one.
    """

    t_start_ns: int
    readings: tuple[CellReading, ...]
    fix_start_seq: int | None = None
    fix_seq: int | None = None


@dataclass(frozen=True, slots=True)
class Note:
    """Something that happened: a port lost, bytes dropped, a new target, the reason of the stop."""

    level: Level
    code: str
    text: str


@dataclass(frozen=True, slots=True)
class LiveEstimate:
    """State, covariance and innovation of the on-device estimate after the reading of `cell` in
    scan `scan_seq`.

    `utm_zone` is negative south of the equator; p_.. is the upper triangle of P in state order x,
    y, P0 (0), eta (e). `probability` is that of the place the state belongs to: below 1 there are
    others.
    """

    scan_seq: int
    stage: str
    cell: str
    n: int
    utm_zone: int
    x_m: float
    y_m: float
    p0_dbm: float
    eta: float
    p_xx: float
    p_xy: float
    p_x0: float
    p_xe: float
    p_yy: float
    p_y0: float
    p_ye: float
    p_00: float
    p_0e: float
    p_ee: float
    innovation_db: float
    innovation_var_db2: float
    probability: float


Value = RawBytes | Fix | Scan | Note | LiveEstimate


@dataclass(frozen=True, slots=True)
class Record:
    """A value, when it was complete (time since boot) and where it came from ("modem", "gnss",
    "logger", ...).
    """

    t_ns: int
    source: str
    value: Value
