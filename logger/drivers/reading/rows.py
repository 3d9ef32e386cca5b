"""The rows of a modem's reply; cells and fixes are those of `core.types`."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from typing import Any

from logger.core.types import CellReading, Fix, Rat

MPS_PER_KNOT = 1852 / 3600


@dataclass(frozen=True, slots=True)
class Registration:
    """Answer or report of +CREG and its like (3GPP TS 27.007 7.2, 10.1.20); answers have `n`.

    Where the modem prints why the network refused it: `reject_cause` of 3GPP (type 0, in
    TS 24.008 or 24.301) or of the maker (type 1).
    """

    domain: str
    stat: int
    rat: Rat | None = None
    n: int | None = None
    lac: int | None = None
    tac: int | None = None
    cid: int | None = None
    act: int | None = None
    reject_cause_type: int | None = None
    reject_cause: int | None = None
    identity_unsure: bool = False


@dataclass(frozen=True, slots=True)
class Signal:
    """Level without a cell; `raw` are printed values whose meaning depends on the technology."""

    rat: Rat | None = None
    csq_raw: int | None = None
    ber: int | None = None
    rssi_dbm: float | None = None
    rscp_dbm: float | None = None
    ecio_db: float | None = None
    rsrp_dbm: float | None = None
    rsrq_db: float | None = None
    sinr_db: float | None = None
    more: Mapping[str, Any] = field(default_factory=dict, hash=False)


@dataclass(frozen=True, slots=True)
class Operator:
    """A network: offered by a scan (`stat`, `long`, `short`) or chosen (`name`, `plmn`)."""

    rat: Rat | None = None
    stat: int | None = None
    long: str | None = None
    short: str | None = None
    name: str | None = None
    plmn: str | None = None
    act: int | None = None


@dataclass(frozen=True, slots=True)
class Refusal:
    """A final error: its number, or its words."""

    code: int | None = None
    text: str | None = None


@dataclass(frozen=True, slots=True)
class NoCell:
    """The modem reports that it has no cell: `status` or `state` as printed."""

    rat: Rat | None = None
    status: str | None = None
    state: str | None = None


Row = CellReading | Registration | Signal | Operator | Refusal | NoCell | Fix

_ROLES = {
    Registration: "registration",
    Signal: "signal",
    Operator: "operator",
    Refusal: "error",
    NoCell: "none",
}


def as_json(row: Row) -> dict[str, Any]:
    """One flat JSON object for a row, null where a value is unknown.

    What a cell broadcasts is there only where the modem prints some of it.
    """
    if isinstance(row, Fix):
        return _fix_json(row)
    named = asdict(row)
    more = {**(named.pop("broadcast", None) or {}), **named.pop("more", {})}
    if not named.get("identity_unsure"):
        named.pop("identity_unsure", None)  # the key is there only where it is true
    return {"role": _ROLES.get(type(row), named.pop("role", None)), "rat": None, **named, **more}


def _fix_json(fix: Fix) -> dict[str, Any]:
    knots = None if fix.speed_mps is None else fix.speed_mps / MPS_PER_KNOT
    return {
        "role": "gnss",
        "fix": fix.valid,
        "utc": None if fix.utc_ns is None else _iso(fix.utc_ns),
        "lat": fix.lat_deg,
        "lon": fix.lon_deg,
        "alt_m": fix.alt_m,
        "hdop": fix.hdop,
        "sats_used": fix.sats_used,
        "speed_kn": None if knots is None else round(knots, 3),
        "speed_kmh": None if fix.speed_mps is None else round(fix.speed_mps * 3.6, 3),
        "course_deg": fix.course_deg,
    }


def _iso(utc_ns: int) -> str:
    seconds, rest_ns = divmod(utc_ns, 10**9)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{rest_ns // 10**6:03d}Z"
