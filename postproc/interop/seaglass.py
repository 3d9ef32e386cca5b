"""SeaGlass: the sensor's collection of scans, as `mongoexport` writes it.

Source: scan.py and parse.py of seaglass-project/seaglass. A document is one scan of a Telit modem
with the position of the receiver before and after it; a channel whose broadcasts were decoded has
`bcch` with the identity. `rx_lev` is in dBm. The name of the sensor and the raw texts are not read.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from logger.core.geo import Utm
from logger.core.track import SIGMA_OF_RADIUS68
from logger.core.types import MOST_NEIGHBOURS, Broadcast, Fix
from postproc.interop import json_lines
from postproc.interop.contents import Contents
from postproc.interop.fields import (
    LEVEL_RANGE_DBM,
    Fields,
    cell_identity,
    fix_of,
    integer,
    maybe,
    number,
    reading_of,
    text,
)
from postproc.interop.log_times import Moment, moment_of
from postproc.interop.sighting import BadRow, NoCell, Remark, Row, Sighting

_DB_OF_STEP = 2
"""Of CELL_RESELECT_OFFSET (3GPP TS 44.018 10.5.2.34)."""


def is_it(seen: Contents) -> bool:
    return seen.kind == "json" and seen.has("gsm", "scan_blob")


def read(source: Path) -> Iterator[Row]:
    """Channels of all scans, those of one scan at its end; raises `RunFileError` for no JSON."""
    yield from json_lines.parse_objects(source, _channels)


def _channels(line: int, document: dict[str, Any]) -> list[Row]:
    plain = _plain(document)
    before, after, gsm = (plain.get(name) for name in ("gps_before", "gps_after", "gsm"))
    if not all(isinstance(part, dict) for part in (before, after, gsm)):
        raise ValueError("gsm, gps_before or gps_after is missing")
    measurements = gsm.get("measurements")
    if not isinstance(measurements, list) or not measurements:
        return [NoCell(line, "a scan without a channel")]
    moment = moment_of(text(after, "time"), "gps_after.time")
    fix = _between(before, after, moment)
    rows: list[Row] = [_channel(line, moment, fix, one) for one in measurements]
    if gsm.get("jammed") and moment.utc_ns is not None:
        rows.append(Remark(line, moment.utc_ns, "the modem reported jamming (SeaGlass)"))
    return rows


def _plain(value: Any) -> Any:
    """A value without the wrappers of MongoDB's extended JSON ({"$numberInt": "7"})."""
    if isinstance(value, dict):
        if len(value) == 1 and next(iter(value)).startswith("$"):
            return _plain(next(iter(value.values())))
        return {name: _plain(one) for name, one in value.items()}
    return [_plain(one) for one in value] if isinstance(value, list) else value


def _between(before: Fields, after: Fields, moment: Moment) -> Fix:
    """The middle of the way of a scan; half of its length is added to the receiver's error."""
    ends = [fix_of(end, "lat", "lon", moment.utc_ns) for end in (before, after)]
    places = [(number(end, "lat"), number(end, "lon")) for end in (before, after)]
    utm = Utm.at(*places[0])
    ends_m = [utm.to_xy(*place) for place in places]
    half_m = math.dist(*ends_m) / 2
    # in metres: the mean of two longitudes beside the date line is on the other side of the Earth
    lat_deg, lon_deg = utm.to_latlon(*(math.fsum(pair) / 2 for pair in zip(*ends_m, strict=True)))
    # gpsd's epx and epy are 95 % of one axis (gpsd_json(5))
    error_m = max(maybe(after, "epx") or 0.0, maybe(after, "epy") or 0.0)
    sigma_m = math.hypot(error_m / 1.96, half_m / math.sqrt(3))
    return replace(
        ends[1],
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        alt_m=maybe(after, "alt"),
        acc_m=sigma_m / SIGMA_OF_RADIUS68 or None,
    )


def _channel(line: int, moment: Moment, fix: Fix, channel: object) -> Row:
    if not isinstance(channel, Mapping):
        return BadRow(line, "a measurement is no object")
    bcch = channel.get("bcch")
    known: Mapping[str, Any] = bcch if isinstance(bcch, Mapping) else {}
    try:
        has_network = text(known, "mcc").isdecimal() and text(known, "mnc").isdecimal()
        reading = reading_of(
            "GSM",
            "scan",
            number(channel, "rx_lev", LEVEL_RANGE_DBM),
            integer(known, "lac") if has_network else None,
            mcc=f"{int(text(known, 'mcc')):03d}" if has_network else None,
            mnc=text(known, "mnc").zfill(2) if has_network else None,
            cid=cell_identity(known, "cell_id") if has_network else None,
            arfcn=integer(channel, "arfcn"),
            bsic=integer(known, "bsic", largest=63),
            broadcast=_broadcast(known) if has_network else None,
        )
    except ValueError as error:
        return BadRow(line, str(error))
    return Sighting(line, moment.t_ns, fix, reading)


def _broadcast(bcch: Mapping[str, Any]) -> Broadcast | None:
    """Neighbour list, reselection offset, penalty time and T3212, where the modem printed them."""
    listed = bcch.get("channels")
    channels = None
    if isinstance(listed, list) and len(listed) <= MOST_NEIGHBOURS:
        channels = tuple(int(one) for one in listed if str(one).isdecimal())
    steps = integer(bcch, "croffset", largest=63)
    penalty, timer = integer(bcch, "penaltyt", largest=31), integer(bcch, "t3212", largest=255)
    found = Broadcast(channels, None if steps is None else _DB_OF_STEP * steps, penalty, timer)
    return None if found == Broadcast() else found
