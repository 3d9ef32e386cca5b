"""WiGLE CSV 1.6 (api.wigle.net/csvFormat.html); nothing in it identifies the device."""

import csv
from pathlib import Path

from logger.core.types import utc_text
from postproc.interop.exporting import ExportWalk
from postproc.interop.readers.wigle import PREFIX
from postproc.interop.sighting import Sighting, is_plmn

_COLUMNS = (
    "MAC", "SSID", "AuthMode", "FirstSeen", "Channel", "Frequency", "RSSI",
    "CurrentLatitude", "CurrentLongitude",
    "AltitudeMeters", "AccuracyMeters", "RCOIs", "MfgrId", "Type",
)  # fmt: skip


def writable(sighting: Sighting) -> bool:
    """Whether a sighting has all that the format needs: who, and when in UTC."""
    return (
        sighting.fix.utc_ns is not None
        and _mac(sighting) is not None
        and sighting.reading.rat is not None
    )


def write(walk: ExportWalk, target: Path) -> None:
    """Levels that are `writable`."""
    with target.open("w", newline="", encoding="utf-8") as file:
        file.write(
            f"{PREFIX}1.6,appRelease=cellwalk,model=,release=,device=,"
            "display=,board=,brand=,star=Sol,body=3,subBody=0\n"
        )
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(_COLUMNS)
        writer.writerows(map(_line, walk.sightings))


def _line(sighting: Sighting) -> list[object]:
    fix, reading = sighting.fix, sighting.reading
    assert fix.utc_ns is not None
    kind = reading.rat if reading.rat in {"GSM", "WCDMA", "NR"} else "LTE"
    seen = utc_text(fix.utc_ns).replace("T", " ").rstrip("Z")
    position = (fix.lat_deg, fix.lon_deg, _or_empty(fix.alt_m), _or_empty(fix.acc_m))
    channel = _or_empty(reading.arfcn)
    auth = f"{kind};{reading.mcc}{reading.mnc}"
    return [
        _mac(sighting),
        "",
        auth,
        seen,
        channel,
        channel,
        round(sighting.rssi_dbm),
        *position,
        "",
        "",
        kind,
    ]


def _mac(sighting: Sighting) -> str | None:
    cell = sighting.reading
    area = cell.tac if cell.lac is None else cell.lac
    known = is_plmn(cell.mcc, cell.mnc) and None not in (area, cell.cid)
    return f"{cell.mcc}{cell.mnc}_{area}_{cell.cid}" if known else None


def _or_empty(value: float | None) -> float | str:
    return "" if value is None else value
