"""Damaged files of other programs: `python fuzz_foreign.py -max_total_time=3600 [-seed=1]`.

Bytes are changed, cut out, doubled or filled in. Each file must be read or refused by an error of
ours, within limits of time and memory."""

import gzip
import json
import random
import resource
import sqlite3
import sys
import time
import zipfile
from collections import Counter
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image
from pmtiles.tile import TileType
from pyproj import CRS

from logger.core.certainty import OnMap
from logger.core.errors import FieldLoggerError
from postproc.basemap import Area, open_ground, street_at
from postproc.interop.importing import import_walk
from postproc.survey.dataset import Survey
from postproc.verification.claims import read_claims
from tests.kit.diag_capture import (
    T0_NS,
    gps_lines,
    log_frame,
    pcapng,
    rayhunter_zip,
    stream,
    udp_packet,
)
from tests.kit.foreign_files import damage
from tests.kit.vector_tiles import feature, layer, tile_at, write_pmtiles
from tests.postproc.survey.cities import write_city

MOST_S, MOST_MB = 10.0, 300
LAT, LON = 52.5, 13.4
CSV = "t_s,lat,lon,rssi_dbm\n" + "".join(f"{i},52,13.{i:04d},-70\n" for i in range(40))
OPENCELLID: dict[str, object] = {
    "mcc": 262,
    "mnc": 1,
    "lac": 1,
    "cellid": 2,
    "lat": 52,
    "lon": 13,
    "signal": -70,
}
OPENCELLID |= {"measured_at": 1598796852000, "act": "GSM"}
POINT = (
    '<trkpt lat="52" lon="13"><time>2024-01-01T00:00:0{}Z</time><name>(MCC 262, MNC 1, LAC 1, '
    "CID 2, Signal strength -70 dBm, Network GSM)</name></trkpt>"
)

Use = Callable[[Path], object]


def area() -> Area:
    x, y = 391_000.0, 5_818_000.0
    grid = np.meshgrid(np.linspace(x, x + 200.0, 5), np.linspace(y + 200.0, y, 5))
    return Area(CRS.from_epsg(32633), np.stack(grid), 0.2)


def png() -> bytes:
    file = BytesIO()
    pixels = np.random.default_rng(1).integers(0, 255, (64, 64, 3), np.uint8)
    Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()


def places(zoom: int) -> list[tuple[int, int, int]]:
    column, row = tile_at(LAT, LON, zoom)
    return [(zoom, column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]


def streets() -> bytes:
    lines = [feature("line", [[(x, 0), (x, 4096)]], [0, 0]) for x in range(0, 4096, 99)]
    return layer("roads", lines, ["name"], ["Street"])


def _import(path: Path) -> None:
    import_walk(path, path.with_name("run.h5"))


def _map(path: Path) -> None:
    open_ground(path, area())
    street_at(path, OnMap(lat=LAT, lon=LON))


def _survey(path: Path) -> None:
    survey = Survey.open(next(folder for folder in path.parents if (folder / "runs").is_dir()))
    cells = survey.cells()
    for batch in survey.batches:
        survey.heard_in(batch)
        survey.batch_rows(batch)
        list(survey.rule_inputs(batch, list(survey.runs)))
    for area in {cell.area for cell in cells}:
        survey.observations(area, [cell.cell for cell in cells if cell.area == area])


def sources(folder: Path) -> list[tuple[Path, Use]]:
    """One file of each kind, and what reads it."""
    tiles = dict.fromkeys(places(14), streets())
    write_pmtiles(folder / "vector.pmtiles", tiles)
    pictures = dict.fromkeys(places(14), png())
    write_pmtiles(folder / "pictures.pmtiles", pictures, TileType.PNG)
    with sqlite3.connect(folder / "map.mbtiles") as database:
        database.execute("CREATE TABLE metadata (name, value)")
        database.execute("CREATE TABLE tiles (zoom_level, tile_column, tile_row, tile_data)")
        rows = [(z, x, 2**z - 1 - y, png()) for z, x, y in places(14)]
        database.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)", rows)
    database.close()
    reply = {"rat": "LTE", "mcc": 262, "mnc": 1, "tac": 1, "cell_id": 2, "rsrp": -100}
    with sqlite3.connect(folder / "log.kismet") as database:
        database.execute("CREATE TABLE KISMET (db_version INT)")
        database.execute("CREATE TABLE data (ts_sec, ts_usec, lat, lon, alt, type, json)")
        cells = [
            (1_790_028_000 + i, 0, 52, 13, 30, "Cellular", json.dumps(reply)) for i in range(9)
        ]
        database.executemany("INSERT INTO data VALUES (?, ?, ?, ?, ?, ?, ?)", cells)
    database.close()
    (folder / "log.csv").write_text(CSV)
    (folder / "log.csv.gz").write_bytes(gzip.compress(CSV.encode()))
    with zipfile.ZipFile(folder / "log.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("log.csv", CSV)
    frames = stream(range(9))  # type: ignore[no-untyped-call]
    (folder / "capture.qmdl").write_bytes(frames)
    lines = gps_lines(range(0, 11, 5))  # type: ignore[no-untyped-call]
    rayhunter_zip(folder / "capture.zip", frames, lines)
    mode = bytes.fromhex("803503063511")
    cipher = log_frame(0x512F, T0_NS, mode)  # type: ignore[no-untyped-call]
    rayhunter_zip(folder / "signals.zip", cipher, lines)
    comment = '{"unix_ts": 1790028000, "lat": 52, "lon": 13}'
    packet = udp_packet(bytes([3]) * 40)  # type: ignore[no-untyped-call]
    packets = [(T0_NS + i * 10**9, 228, packet, comment) for i in range(9)]
    (folder / "capture.pcapng").write_bytes(pcapng(packets))  # type: ignore[no-untyped-call]
    (folder / "log.json").write_text(json.dumps({"measurements": [OPENCELLID] * 9}))
    points = "".join(map(POINT.format, range(9)))
    (folder / "log.gpx").write_text(f'<gpx creator="Tower Collector">{points}</gpx>')
    (folder / "claims.csv").write_text("cell,lat,lon\n" + "262-1-1-2,52,13\n" * 9)
    write_city(folder / "survey")  # type: ignore[no-untyped-call]
    used: dict[str, Use] = dict.fromkeys(("pmtiles", "mbtiles"), _map)
    used |= {"parquet": _survey}
    named: dict[str, Use] = {"claims.csv": lambda path: read_claims(path, ["262-1-1-2"])}
    files = sorted(folder.rglob("*.*"))
    return [
        (path, named.get(path.name) or used.get(path.suffix[1:], _import))
        for path in files
        if path.is_file() and path.name not in {"survey.json", ".lock"}
    ]


def check(path: Path, use: Use, data: bytes, rng: random.Random) -> str:
    """How a damaged file ends: "read" or "refused"; raises what the program would print."""
    path.write_bytes(damage(data, rng))
    before_mb, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10, time.monotonic()
    try:
        use(path)
        end = "read"
    except FieldLoggerError:
        end = "refused"
    finally:
        path.write_bytes(data)
    seconds = time.monotonic() - began
    more_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10) - before_mb
    assert more_mb < MOST_MB, f"{path.name}: {more_mb} MB"
    assert seconds < MOST_S, f"{path.name}: {seconds:.1f} s"
    return end


def main() -> None:
    """Damage one file after another until the time is over."""
    options = dict(option.lstrip("-").split("=") for option in sys.argv[1:])
    seed, end = int(options.get("seed", 1)), time.monotonic() + int(options["max_total_time"])
    ends: Counter[str] = Counter()
    with TemporaryDirectory() as folder:
        kinds = [(path, use, path.read_bytes()) for path, use in sources(Path(folder))]
        while time.monotonic() < end:
            for path, use, data in kinds:
                try:
                    ends[f"{path.name} {check(path, use, data, random.Random(seed))}"] += 1
                except BaseException:
                    print(f"{path.name}: seed {seed}")
                    raise
            seed += 1
    print(*sorted(ends.items()), sep="\n")


if __name__ == "__main__":
    main()
