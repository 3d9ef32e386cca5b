"""A walk and its results, as they are exported."""

from logger.core.runfile import RunWriter, read_run
from logger.core.types import CellReading, Fix, Record, Scan
from postproc.interop.exporting import ExportWalk, walk_of_run
from postproc.interop.readers import walk_csv
from postproc.interop.sighting import BadRow, Sighting
from tests.kit import sample_results as kit
from tests.kit.runs import UTC0_NS, meta


def around_a_square(tmp_path, *, verdict="ambiguous", **changes):
    """Walk of two cells, and the result about them: one has a posterior."""
    run = kit.write_run(tmp_path / "walk.journal", **{"seconds": 120, "cells": 2} | changes)
    return run, walk_of_run(run), kit.sample_result(run, verdict=verdict, places=2)


def over_the_date_line(tmp_path):
    """Walk eastwards over 180 degrees, with a gap of a minute on the way."""
    writer = RunWriter(tmp_path / "date-line.journal", meta())
    for i in range(40):
        t_ns = (i + 60 * (i >= 30)) * 10**9
        lon = (179.999 + i * 1e-4 + 180.0) % 360.0 - 180.0
        writer.append(Record(t_ns, "gnss", Fix(True, UTC0_NS + t_ns, -16.5, lon, hdop=1.0)))
        reading = CellReading("serving", "GSM", "542", "01", 1, 2, rssi_dbm=-60.0 - i % 25)
        writer.append(Record(t_ns, "modem", Scan(t_ns, (reading,))))
    writer.close(10**11, "test")
    return walk_of_run(read_run(tmp_path / "date-line.journal"))


def export_of(sightings):
    """Sightings as an export has them."""
    return ExportWalk(tuple(sightings), (), 0)


def read_walk(source):
    """Usable rows of our CSV, and those that are not, each in the file's order."""
    rows = list(walk_csv.read(source))
    return [row for row in rows if isinstance(row, Sighting)], [
        row for row in rows if isinstance(row, BadRow)
    ]
