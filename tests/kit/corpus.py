"""The corpus of real modem replies: its entries, and the rule by which one is passed."""

import json
from pathlib import Path

from logger.drivers.family import Family
from logger.drivers.reading.row_language import as_json

IDENTITY = ("mcc", "lac", "tac", "cid")


def entries(folder: Path, *dialects: str) -> list[dict]:
    """Entries of the dialects that begin so."""
    return [
        e
        for e in json.loads((folder / "modem" / "expected.json").read_text())
        if e["dialect"].startswith(dialects)
    ]


def lines_of(folder: Path, entry: dict) -> list[str]:
    return (folder / "modem" / entry["file"]).read_text("latin-1").splitlines()


def check_entry(entry: dict, rows: list[dict]) -> None:
    """Every expected row is there, and no cell has an identity that is not expected."""
    for wanted in entry["expected"]:
        assert any(_is(row, wanted) for row in rows), (
            entry["file"],
            wanted,
            [r for r in rows if r["role"] != "gnss"],
        )
    for row in rows:
        if row["role"] in {"serving", "neighbour", "scan"}:
            for key in IDENTITY:
                known = {wanted.get(key) for wanted in entry["expected"]}
                assert row[key] is None or row[key] in known, (entry["file"], key, row)


def check_recorded(folder: Path, driver: Family, *dialects: str) -> None:
    """Every entry of the dialects that begin so passes; there is at least one."""
    recorded = entries(folder, *dialects)
    assert recorded
    for entry in recorded:
        check_entry(entry, [as_json(row) for row in driver.read(lines_of(folder, entry))])


def _is(row: dict, wanted: dict) -> bool:
    return all(key in row and _equal(key, row[key], value) for key, value in wanted.items())


def _equal(key: str, value: object, wanted: object) -> bool:
    if (
        isinstance(wanted, (int, float))
        and not isinstance(wanted, bool)
        and isinstance(value, (int, float))
    ):
        within = 0.5 if key.endswith(("_dbm", "_db")) else 1e-6 if key in {"lat", "lon"} else 1e-9
        return abs(value - wanted) <= within
    return type(value) is type(wanted) and value == wanted
