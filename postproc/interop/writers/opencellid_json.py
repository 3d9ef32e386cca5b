"""OpenCelliD measurements as the API takes them (wiki.opencellid.org/wiki/API)."""

import json
from pathlib import Path

from postproc.interop.exporting import ExportWalk
from postproc.interop.writers.opencellid_csv import measurement, writable

__all__ = ["writable", "write"]


def write(walk: ExportWalk, target: Path) -> None:
    """Levels that are `writable`; codes are integers."""
    numbered = [
        one | {"mcc": int(one["mcc"]), "mnc": int(one["mnc"])}
        for one in map(measurement, walk.sightings)
    ]
    target.write_text(json.dumps({"measurements": numbered}, indent=1) + "\n", encoding="utf-8")
