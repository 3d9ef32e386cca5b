"""Records of a run, decoded in parts."""

import random

from logger.core.rows import values_of
from logger.core.runfile import read_run
from logger.core.types import CellReading, Record, Scan
from tests.kit import runs


def test_more_readings_than_are_decoded_together(tmp_path):
    """Scans of up to 39 cells, with unknown values; a row that is decoded alone is the same."""
    drawn = random.Random(1)
    sizes = [drawn.randrange(40) for _ in range(500)]
    records = [
        Record(
            k + 1,
            "modem",
            Scan(k, tuple(
                CellReading("scan", "GSM", "262", "01", 7, c + 1, rssi_dbm=-60.0 if c % 3 else None)
                for c in range(size)
            )),
        )
        for k, size in enumerate(sizes)
    ]  # fmt: skip
    runs.write_journal(tmp_path / "a.journal", records)
    run = read_run(tmp_path / "a.journal")
    assert sum(sizes) > 2 * 4096
    assert [found for _, found in run.records("scans")] == records
    rows = run.tables["readings"]
    alone = [next(values_of("readings", rows[k : k + 1])) for k in range(0, len(rows), 97)]
    assert list(values_of("readings", rows))[::97] == alone
