"""Rayhunter: its analysis of a recording, NDJSON with a line for each message of the network.

Source: analyzer.rs of EFForg/rayhunter, report versions 1 and 2. A line has no cell and no level:
its warnings become notes of a run, whose positions come from the GPX track that is joined with it
(`--track`). The packets themselves are in another file and are not read.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from postproc.interop import json_lines
from postproc.interop.contents import Contents, Format
from postproc.interop.fields import moment_of, text
from postproc.interop.sighting import NoCell, Remark, Row

_MOST_CHARACTERS = 300
"""A note of the run file holds 400 bytes."""


def is_it(seen: Contents) -> bool:
    return seen.kind == "json" and (seen.has("analyzers") or seen.has("events", "packet_timestamp"))


def read(source: Path) -> Iterator[Row]:
    """Warnings as remarks; raises `RunFileError` for a file that is no JSON."""
    yield from json_lines.parse_objects(source, _remarks)


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
            words = f"Rayhunter, {severity}: {text(event, 'message')}"
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
