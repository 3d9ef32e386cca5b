"""A walk recorded by another program, made into a run: the format is recognised by what is in the file."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from logger.core.errors import RunFileError
from logger.core.types import Fix, Note, Record, Scan
from postproc.interop import csv_table, kismet, network_survey, opencellid, walk_csv, wigle
from postproc.interop.fields import RATS
from postproc.interop.heard import BadRow, Heard, NoCell, Row
from postproc.interop.writing import Append, meta_of, spare, write_run

ORIGIN = "import of"
_SQLITE = b"SQLite format 3\0"
_HDF5 = b"\x89HDF\r\n\x1a\n"
_GZIP = b"\x1f\x8b"


@dataclass(frozen=True, slots=True)
class Format:
    """A format that can be imported."""

    name: str
    read: Callable[[Path], Iterator[Row]]


@dataclass(frozen=True, slots=True)
class Imported:
    """What an import did; `n_other` counts rows that are no cells, as Wi-Fi, `n_repeated` repetitions."""

    path: Path
    format: str
    n_rows: int
    n_other: int
    n_repeated: int
    bad_rows: tuple[BadRow, ...]
    was_sorted: bool


WALK_CSV = Format("CSV", walk_csv.read)
WIGLE = Format("WiGLE CSV", wigle.read)
OPENCELLID_CSV = Format("OpenCelliD measurements, CSV", opencellid.read_csv)
OPENCELLID_JSON = Format("OpenCelliD measurements, JSON", opencellid.read_json)
KISMET = Format("Kismet log", kismet.read)
SURVEY_CSV = Format("Network Survey CSV", network_survey.read_csv)
SURVEY_GEOPACKAGE = Format("Network Survey GeoPackage", network_survey.read_geopackage)


def import_walk(source: Path, target: Path) -> Imported:
    """Make a run of a foreign file; raises `RunFileError` for a file without a usable row, or to spare data."""
    spare(target, ORIGIN, "import")
    form = recognise(source)
    rows = list(form.read(source))
    heard = [row for row in rows if isinstance(row, Heard)]
    bad = tuple(row for row in rows if isinstance(row, BadRow))
    n_other = sum(isinstance(row, NoCell) for row in rows)
    if not heard:
        why = f"; line {bad[0].line}: {bad[0].why}" if bad else f"; {n_other} rows are no cells" * bool(n_other)
        raise RunFileError(f"{source} has no usable row{why}")
    n_read = len(heard)
    if form is not WALK_CSV:
        # apps write a measurement again when they are asked for it again
        heard = list({(row.t_ns, row.fix, row.reading): row for row in reversed(heard)}.values())[::-1]
    in_order = all(a.t_ns <= b.t_ns for a, b in pairwise(heard))
    imported = Imported(target, form.name, len(heard), n_other, n_read - len(heard), bad, not in_order)
    in_time = sorted(heard, key=lambda row: row.t_ns)
    write_run(target, meta_of(f"{ORIGIN} {source.name}"), lambda append: _fill(append, in_time, imported), "imported")
    return imported


def recognise(source: Path) -> Format:
    """Format of a file by its content; raises `RunFileError` for one that is none of them."""
    try:
        with source.open("rb") as file:
            head = file.read(4096)
    except OSError as error:
        raise RunFileError(f"{source}: {error.strerror}") from error
    if head.startswith(_SQLITE):
        return _of_tables(source)
    if head.startswith(_HDF5):
        raise RunFileError(f"{source} is HDF5: a run needs no import")
    if head.startswith(_GZIP):
        raise RunFileError(f"{source} is compressed: unpack it with gunzip first")
    if head.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"{"):
        return OPENCELLID_JSON
    return _of_columns(source)


def _of_tables(source: Path) -> Format:
    try:
        with closing(sqlite3.connect(f"{source.resolve().as_uri()}?mode=ro", uri=True)) as database:
            tables = {str(name) for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    except sqlite3.Error as error:
        raise RunFileError(f"{source} is a damaged SQLite file: {error}") from error
    if {name.lower() for name in tables} >= {"kismet", "data"}:
        return KISMET
    if tables & set(network_survey.TABLES):
        return SURVEY_GEOPACKAGE
    raise RunFileError(
        f"{source} is SQLite, but neither a Kismet log (tables KISMET and data) nor a GeoPackage of Network Survey "
        f"(one of {', '.join(network_survey.TABLES)}); it has {', '.join(sorted(tables)[:8]) or 'no table'}"
    )


def _of_columns(source: Path) -> Format:
    """Format of a text file; what is unknown is taken for our own, which then names the columns that are missing."""
    with csv_table.text_lines(source) as lines:
        header = next((line for line in lines if not line.startswith("#")), "")
        if header.startswith(wigle.PREFIX):
            return WIGLE
        names = set(csv_table.names_of(header))
    if {"mac", "firstseen"} <= names:
        return WIGLE
    # country files of OpenCelliD have no header: they begin with the technology of a cell
    if {"radio", "net", "area", "cell"} <= names or header.partition(",")[0].upper() in {*RATS, "CDMA"}:
        raise RunFileError(f"{source} is a list of cells, not a walk; `postproc celldb import` reads it")
    if {"mcc", "measured_at"} <= names:
        return OPENCELLID_CSV
    if {"devicetime", "latitude", "longitude"} <= names:
        return SURVEY_CSV
    return WALK_CSV


def _fill(append: Append, heard: list[Heard], imported: Imported) -> int:
    """Notes, then a fix wherever place or time changes, and a scan for each row."""
    start_ns = heard[0].t_ns
    for note in _notes(imported):
        append(Record(0, "import", note))
    place: tuple[int, Fix] | None = None
    fix_seq = 0
    for row in heard:
        t_ns = row.t_ns - start_ns
        if place != (row.t_ns, row.fix):
            place = (row.t_ns, row.fix)
            fix_seq = append(Record(t_ns, "import", row.fix))
        append(Record(t_ns, "import", Scan(t_ns, (row.reading,), fix_seq, fix_seq)))
    return heard[-1].t_ns - start_ns


def _notes(imported: Imported) -> Iterator[Note]:
    if imported.was_sorted:
        yield Note("warning", "sorted", "rows were out of order and have been sorted by time")
    if imported.n_other:
        yield Note("info", "no-cells", f"{imported.n_other} rows are no cells and were passed over")
    if imported.n_repeated:
        yield Note("info", "repeated", f"{imported.n_repeated} rows repeat others and were left out")
    for bad in imported.bad_rows:
        yield Note("warning", "bad-row", f"line {bad.line}: {bad.why}")


def summary(imported: Imported) -> dict[str, object]:
    """What `--json` prints."""
    return {
        "run": str(imported.path),
        "format": imported.format,
        "rows": imported.n_rows,
        "other_rows": imported.n_other,
        "repeated_rows": imported.n_repeated,
        "sorted": imported.was_sorted,
        "bad_rows": [{"line": bad.line, "why": bad.why} for bad in imported.bad_rows],
    }
