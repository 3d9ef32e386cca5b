"""Rayhunter: its analysis of a recording and its positions, NDJSON.

Source: analyzer.rs and gps.rs of EFForg/rayhunter, report versions 1 and 2. A line of the analysis
has no cell and no level: its warnings become notes of a run. The recording itself is read by
`diag`; the zip of a recording holds all of it.
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from logger.core.errors import GeoError
from logger.core.types import Fix
from postproc.foreign_file import MOST_READINGS, with_limit
from postproc.interop import json_lines
from postproc.interop.contents import Contents, Format
from postproc.interop.sighting import BadRow, NoCell, Remark, Row, fix_of, moment_of, number, text

CLOCK_SET_NS = 631_152_000 * 10**9
"""1990: a clock before it was never set. A modem's begins in 1980, that of a hotspot in 1970."""
_MOST_CHARACTERS = 300
"""A note of the run file holds 400 bytes."""
_NUMBER = re.compile(r"\d{8,}")
"""As long as a TMSI in decimals; an IMSI and a telephone number are longer."""
_SECONDS = (0.0, 4e9)


def is_it(seen: Contents) -> bool:
    return seen.kind == "json" and (seen.has("analyzers") or seen.has("events", "packet_timestamp"))


def read(source: Path) -> Iterator[Row]:
    """Warnings as remarks; raises `RunFileError` for a file that is no JSON."""
    yield from json_lines.parse_objects(source, _remarks)


def positions(source: Path) -> tuple[list[Fix | None], int | None]:
    """Positions by the clock of the modem, and what makes one of its times of 1980 a true one.

    A line has the time of the hotspot and that of the last packet, in whole seconds. The packet may
    be old, so the least difference of both clocks counts; each may be set on the way. Older lines
    have one time, UTC. None is a line without a position.
    """
    lines = with_limit(json_lines.objects(source), source, "positions", MOST_READINGS)
    entries = [_position(line) for line in lines]
    rows = [row for row in entries if row is not None]
    ahead_ns: dict[tuple[bool, bool], int] = {}
    for fix, packet_ns in rows:
        system_ns = fix.utc_ns or 0
        if packet_ns is not None:
            clocks = system_ns >= CLOCK_SET_NS, packet_ns >= CLOCK_SET_NS
            difference_ns = system_ns - packet_ns
            ahead_ns[clocks] = min(difference_ns, ahead_ns.get(clocks, difference_ns))
    ahead_ns.setdefault((True, True), 0)
    fixes: list[Fix | None] = [None] * (len(entries) - len(rows))
    for fix, _ in rows:
        system_ns = fix.utc_ns or 0
        if (system_ahead_ns := ahead_ns.get((system_ns >= CLOCK_SET_NS, True))) is not None:
            fixes.append(replace(fix, utc_ns=system_ns - system_ahead_ns))
    shifts_ns = [
        ahead_ns[is_set, False] - ahead_ns[is_set, True]
        for is_set in (True, False)
        if {(is_set, False), (is_set, True)} <= ahead_ns.keys()
    ]
    return fixes, shifts_ns[0] if shifts_ns else None


def _position(entry: json_lines.Object | BadRow) -> tuple[Fix, int | None] | None:
    """Position by the clock of the hotspot, time of the last packet; None for a line without."""
    if isinstance(entry, BadRow):
        return None
    line = entry[1]
    try:
        fix = fix_of(line, "lat", "lon", None)
        system_s = number(line, "unix_ts" if "unix_ts" in line else "system_time", _SECONDS)
        packet = line.get("latest_packet_timestamp")
        packet_s = None if packet is None else number(line, "latest_packet_timestamp", _SECONDS)
    except (ValueError, GeoError):
        return None
    packet_ns = None if packet_s is None else int(packet_s) * 10**9
    return replace(fix, utc_ns=int(system_s) * 10**9), packet_ns


def _remarks(line: int, row: dict[str, Any]) -> list[Row]:
    if "analyzers" in row:
        return [NoCell(line, "the header of the report")]
    analyses = row.get("analysis", [row])
    if not isinstance(analyses, list):
        raise ValueError("analysis is no list")  # noqa: TRY004 (a bad row like any other)
    remarks = [one for part in analyses if isinstance(part, dict) for one in _warnings(line, part)]
    return remarks or [NoCell(line, "a message without a warning")]


def _warnings(line: int, part: dict[str, Any]) -> Iterator[Row]:
    events = part.get("events")
    for event in events if isinstance(events, list) else []:
        severity = _severity(event)
        if severity:
            when = moment_of(text(part, "packet_timestamp", "timestamp"), "packet_timestamp")
            words = f"Rayhunter, {severity}: {_NUMBER.sub('...', text(event, 'message'))}"
            yield Remark(line, when.t_ns, words[:_MOST_CHARACTERS])


def _severity(event: object) -> str:
    """Severity of a warning in either version; empty for no event and for information."""
    if not isinstance(event, dict):
        return ""
    kind = event.get("event_type")
    if isinstance(kind, dict):
        return text(kind, "severity").lower()
    return "" if kind in {None, "Informational"} else str(kind).lower()


IMPORTS = (Format("Rayhunter analysis, NDJSON", read, "packet_timestamp", is_it),)
