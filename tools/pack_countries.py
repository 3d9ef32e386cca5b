"""Pack countries and networks for the rules about the numbering plan.

    npm pack world-atlas@2.0.2 mcc-mnc-list@1.1.11 i18n-iso-countries@7.14.0   # and unpack
    python tools/pack_countries.py FOLDER logger/core/suspicion/data/countries.json.gz

FOLDER holds the three unpacked packages. The result has, for each square of a quarter of a degree,
the countries whose territory is nearer than `NEAR_KM` to any point of it, and the networks of each
mobile country code. Borders are those of Natural Earth at 1:50 million, a few kilometres off.
"""

import gzip
import json
import sys
from collections import Counter
from itertools import pairwise
from math import cos, radians
from pathlib import Path

import shapely
from shapely.geometry import box, shape
from shapely.ops import unary_union

STEP_DEG = 0.25
NEAR_KM = 40.0
"""The largest range of a GSM cell (35 km, 3GPP TS 45.010) and the error of the borders."""
_KM_PER_DEG = 111.3


def main(folder: Path, target: Path) -> None:
    """Write the packed tables."""
    names = json.loads((folder / "i18n-iso-countries/langs/en.json").read_text())["countries"]
    numeric = {n: a2 for a2, _, n, *_ in json.loads(
        (folder / "i18n-iso-countries/codes.json").read_text())}  # fmt: skip
    atlas = json.loads((folder / "world-atlas/countries-50m.json").read_text())
    networks = json.loads((folder / "mcc-mnc-list/mcc-mnc-list.json").read_text())
    countries = _polygons(atlas, numeric)
    packed = {
        "step_deg": STEP_DEG,
        "near_km": NEAR_KM,
        "countries": {code: _short(names.get(code, code)) for code in sorted(countries)},
        **_rows(countries),
        **_networks(networks),
    }
    text = json.dumps(packed, separators=(",", ":"), ensure_ascii=False)
    target.write_bytes(gzip.compress(text.encode(), 9, mtime=0))
    print(f"{target}: {target.stat().st_size} bytes")


def _polygons(atlas: dict, numeric: dict[str, str]) -> dict[str, shapely.Geometry]:
    """Territory of each country by its code of two letters."""
    scale, move = atlas["transform"]["scale"], atlas["transform"]["translate"]
    arcs = []
    for arc in atlas["arcs"]:
        x = y = 0
        points = []
        for dx, dy in arc:
            x, y = x + dx, y + dy
            points.append((x * scale[0] + move[0], y * scale[1] + move[1]))
        arcs.append(points)

    def ring(indices: list[int]) -> list[tuple[float, float]]:
        points: list[tuple[float, float]] = []
        for i in indices:
            part = arcs[i] if i >= 0 else arcs[~i][::-1]
            points += part[1:] if points else part
        return _continuous(points)

    found: dict[str, list[shapely.Geometry]] = {}
    for geometry in atlas["objects"]["countries"]["geometries"]:
        code = numeric.get(geometry.get("id", ""), _UNCODED.get(geometry["properties"]["name"]))
        if code is None:
            continue
        polygons = geometry["arcs"]
        if geometry["type"] == "Polygon":
            polygons = [polygons]
        rings = [[ring(indices) for indices in polygon] for polygon in polygons]
        whole = shape({"type": "MultiPolygon", "coordinates": rings})
        found.setdefault(code, []).append(shapely.make_valid(whole))
    for code, boxes in _TERRITORIES.items():
        found.setdefault(code, []).extend(box(*corners) for corners in boxes)
    return {code: unary_union(parts) for code, parts in found.items()}


def _continuous(ring: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """A ring across the antimeridian continues beyond 180 degrees, not around the earth.

    One around a pole does not close that way and stays as it is.
    """
    turns = 0.0
    points = ring[:1]
    for (west, _), (east, north) in pairwise(ring):
        turns -= 360.0 * round((east - west) / 360.0)
        points.append((east + turns, north))
    return ring if turns else points


_TERRITORIES = {
    "BQ": [(-68.43, 12.01, -68.18, 12.32), (-63.27, 17.46, -62.93, 17.66)],
    "CC": [(96.80, -12.22, 96.95, -11.82)],
    "CX": [(105.53, -10.58, 105.72, -10.41)],
    "GF": [(-54.61, 2.11, -51.61, 5.78)],
    "GI": [(-5.37, 36.10, -5.33, 36.16)],
    "GP": [(-61.82, 15.83, -61.00, 16.52)],
    "MQ": [(-61.24, 14.38, -60.80, 14.89)],
    "RE": [(55.21, -21.39, 55.84, -20.86)],
    "TK": [(-172.53, -9.45, -171.18, -8.52)],
    "TV": [(176.05, -10.81, 179.90, -5.64)],
    "YT": [(45.01, -13.02, 45.31, -12.63)],
}
"""West, south, east and north of territories with networks of their own that Natural Earth at this
scale lacks or has as a part of another country."""
_UNCODED = {"Kosovo": "XK", "N. Cyprus": "CY", "Somaliland": "SO"}


def _rows(countries: dict[str, shapely.Geometry]) -> dict[str, object]:
    """Sets of countries, and each row of squares from the south as runs of equal sets."""
    sets: dict[tuple[str, ...], int] = {(): 0}
    codes = sorted(countries)
    tree = shapely.STRtree([countries[code] for code in codes])
    for code in codes:
        shapely.prepare(countries[code])
    rows = []
    n_columns = round(360 / STEP_DEG)
    for i in range(round(180 / STEP_DEG)):
        south = -90.0 + i * STEP_DEG
        dy = NEAR_KM / _KM_PER_DEG
        dx = min(dy / max(cos(radians(min(abs(south) + STEP_DEG, 89.0))), 0.05), 5.0)
        row: list[list[int]] = []
        for j in range(n_columns):
            west = -180.0 + j * STEP_DEG
            near: set[str] = set()
            for shift in (-360.0, 0.0, 360.0):
                reach = box(west - dx + shift, south - dy, west + STEP_DEG + dx + shift,
                            south + STEP_DEG + dy)  # fmt: skip
                near |= {codes[k] for k in tree.query(reach, predicate="intersects")}
            number = sets.setdefault(tuple(sorted(near)), len(sets))
            if not row or row[-1][1] != number:
                row.append([j, number])
        rows.append([value for run in row for value in run])
    return {"sets": [" ".join(names) for names in sets], "rows": rows}


def _networks(networks: list[dict]) -> dict[str, object]:
    """Countries of each mobile country code, that with most networks first; networks; railways.

    Whatever a code's status: older logs have networks that are switched off today, and the list
    calls some switched off that are on the air.
    """
    of_mcc: dict[str, Counter[str]] = {}
    codes: dict[str, dict[str, str]] = {}
    railways = []
    for entry in networks:
        mcc, mnc, country = entry["mcc"], entry["mnc"], entry["countryCode"]
        if not (mcc and mnc and mcc.isdecimal() and mnc.isdecimal()):
            continue
        for code in (country or "").replace("/", " ").split():
            of_mcc.setdefault(mcc, Counter())[code[:2]] += 1
        name = entry["brand"] or entry["operator"] or ""
        codes.setdefault(mcc, {})[mnc] = name.split(",")[0][:24]
        if "GSM-R" in (entry["bands"] or ""):
            railways.append(f"{mcc}-{mnc}")
    return {
        "mcc": {
            mcc: " ".join(code for code, _ in found.most_common())
            for mcc, found in sorted(of_mcc.items())
        },
        "networks": codes,
        "railways": sorted(railways),
    }


def _short(name: str | list[str]) -> str:
    return name if isinstance(name, str) else name[0]


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
