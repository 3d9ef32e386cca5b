"""A damaged journal: never an exception, every undamaged frame recovered, no record invented."""

import os
import random

import pytest

from logger.core import schema
from logger.core.errors import RunFileError
from logger.core.rows import DTYPES, dtypes_of
from logger.core.runfile import convert_journal, read_run
from logger.core.runfile import journal as journal_module
from logger.core.runfile.frames import HEADER_SIZE, Frame, scan
from logger.core.schema import OLDEST_DESCRIBED, TABLES
from logger.core.types import Note, RawBytes, Record, Scan
from tests.kit import runs

FOUND = runs.records(5)
CRC_SIZE = 4


@pytest.fixture(scope="module")
def journal(tmp_path_factory):
    """Bytes of a small journal."""
    path = tmp_path_factory.mktemp("whole") / "a.journal"
    runs.write_journal(path, FOUND, sync_every=3)
    return path.read_bytes()


@pytest.fixture(scope="module")
def holders(journal):
    """End of each frame, and the records that stand in it alone (a scan stands in two)."""
    return [
        (f.start - HEADER_SIZE, f.start + f.length + CRC_SIZE)
        for f in scan(journal)
        if isinstance(f, Frame)
    ]


def _records(path, data):
    path.unlink(missing_ok=True)  # ext4 flushes what is written over a file
    path.write_bytes(data)
    run = read_run(path)
    return run, dict(run.records())


def _nothing_invented(got):
    for seq, record in got.items():
        if isinstance(record.value, Scan):
            # the readings of a scan stand in a frame of their own
            assert set(record.value.readings) <= set(FOUND[seq].value.readings)
        else:
            assert FOUND[seq] == record


def _check_damage(path, data, journal, spans):
    """Read damaged bytes; every frame that stands in them untouched must have been read."""
    complete = [journal[start:end] for start, end in spans]
    intact = sum(frame in data for frame in complete)
    if not intact:
        with pytest.raises(RunFileError):
            read_run(path)
        return
    run, got = _records(path, data)
    _nothing_invented(got)
    n_numbered = sum(
        frame in data
        for frame in complete[: max(i for i, f in enumerate(complete) if f in data) + 1]
    )
    last = max(i for i, frame in enumerate(complete) if frame in data)
    assert run.damage.missing_frames == last + 1 - n_numbered


def test_every_truncation(journal, holders, tmp_path):
    path, least = tmp_path / "cut.journal", -1
    path.write_bytes(journal)
    for end in range(len(journal), 0, -1):
        os.truncate(path, end)
        if end < holders[0][1]:
            with pytest.raises(RunFileError):
                read_run(path)
            continue
        run = read_run(path)
        got = dict(run.records())
        _nothing_invented(got)
        assert run.damage.missing_frames == 0
        assert list(got) == list(range(len(got))) or run.end is None
        assert least == -1 or len(got) <= least
        least = len(got)


def _flips(n):
    return pytest.mark.parametrize(
        "n", [pytest.param(n, id="short"), pytest.param(10_000, id="long", marks=pytest.mark.slow)]
    )


@_flips(50)
def test_random_flips(journal, holders, tmp_path, n):
    rng = random.Random(7)
    for _ in range(n):
        data = bytearray(journal)
        for _ in range(rng.choice([1, 1, 1, 4, 30])):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        _check_damage(tmp_path / "hit.journal", bytes(data), journal, holders)


@_flips(50)
def test_random_splices(journal, holders, tmp_path, n):
    """Pieces of it in any order, doubled, with noise and with a foreign journal between."""
    runs.write_journal(
        tmp_path / "other.journal",
        [Record(1, "x", Note("info", "foreign", "must not be read"))] * 9,
    )
    other = (tmp_path / "other.journal").read_bytes()
    rng = random.Random(8)
    for _ in range(n):
        pieces = [
            journal[slice(*sorted(rng.sample(range(len(journal)), 2)))]
            for _ in range(rng.randrange(1, 5))
        ]
        pieces.insert(rng.randrange(len(pieces) + 1), rng.randbytes(rng.randrange(300)))
        data = b"".join(pieces)
        complete = sum(journal[start:end] in data for start, end in holders)
        other_run = rng.randrange(2) and complete > 4
        path = tmp_path / "spliced.journal"
        if other_run:
            data += other
        if complete:
            _, got = _records(path, data)
            _nothing_invented(got)
        else:
            path.write_bytes(data)
            with pytest.raises(RunFileError):
                read_run(path)


def test_damage_goes_into_the_hdf5_too(journal, holders, tmp_path):
    data = bytearray(journal)
    data[holders[4][0] + 30] ^= 0xFF
    data[holders[6][0] + 3] ^= 0xFF
    (tmp_path / "a.journal").write_bytes(data)
    stated = convert_journal(tmp_path / "a.journal", tmp_path / "a.h5")
    run = read_run(tmp_path / "a.h5")
    assert run.damage == read_run(tmp_path / "a.journal").damage == stated
    assert run.damage.missing_frames == 2
    assert run.damage.skipped_bytes == sum(holders[i][1] - holders[i][0] for i in (4, 6))


def test_a_run_without_any_description_keeps_its_rows(journal, holders, tmp_path):
    data = bytearray(journal)
    data[holders[0][0] + 40] ^= 0xFF
    run, got = _records(tmp_path / "a.journal", data)
    assert [got[seq] for seq in range(len(FOUND))] == FOUND
    assert run.damage.description_lost
    assert run.meta.run_id == ""
    convert_journal(run.path, tmp_path / "a.h5")
    assert read_run(tmp_path / "a.h5").damage.description_lost
    assert dict(read_run(tmp_path / "a.h5").records()) == got


def test_a_run_of_an_older_version_without_any_description_keeps_its_rows(tmp_path, monkeypatch):
    """Its rows are shorter than those of today: every frame names the version that divides them."""
    old = dtypes_of(OLDEST_DESCRIBED)
    assert old["readings"].itemsize < DTYPES["readings"].itemsize
    tables = {
        table: [c for c in columns if c.name in old[table].names]
        for table, columns in TABLES.items()
        if table in old
    }
    with monkeypatch.context() as past:
        past.setattr(schema, "TABLES", tables)
        past.setattr(schema, "_PACKING", schema.packing_of(OLDEST_DESCRIBED))
        past.setattr(journal_module, "SCHEMA_VERSION", OLDEST_DESCRIBED)
        runs.write_journal(tmp_path / "a.journal", FOUND, sync_every=3)
    data = bytearray((tmp_path / "a.journal").read_bytes())
    data[HEADER_SIZE + 10] ^= 0xFF
    run, got = _records(tmp_path / "a.journal", data)
    assert run.damage.description_lost
    assert [got[seq] for seq in range(len(FOUND))] == FOUND
    convert_journal(run.path, tmp_path / "a.h5")
    assert dict(read_run(tmp_path / "a.h5").records()) == got
    assert read_run(tmp_path / "a.h5").meta.schema == OLDEST_DESCRIBED


def test_a_frame_that_is_no_row_in_spite_of_its_crc_is_damage(tmp_path):
    from logger.core.runfile.frames import Kind
    from logger.core.runfile.journal import Journal

    journal = Journal(tmp_path / "a.journal", b"{}")
    for kind, payload in (
        (Kind.ROWS, b"\x05notes" + bytes(7)),
        (Kind.ROWS, b"\x05wrong"),
        (Kind.ROWS, b""),
        (Kind.RAW, b"\xff\xff\xff\xff"),
        (Kind.RAW, b""),
        (Kind.END, b"?"),
    ):
        journal.add(kind, payload)
    journal.close()
    run = read_run(tmp_path / "a.journal")
    assert run.damage.missing_frames == 6
    assert not list(run.records())


def test_raw_bytes_stay_with_their_records(tmp_path):
    found = [Record(i, "gnss", RawBytes(bytes([i]) * i)) for i in range(200)]
    runs.write_journal(tmp_path / "a.journal", found, sync_every=10)
    data = bytearray((tmp_path / "a.journal").read_bytes())
    data[len(data) // 2] ^= 1
    run, got = _records(tmp_path / "a.journal", data)
    assert run.damage.missing_frames == 1
    assert len(got) == 190
    assert all(found[seq] == record for seq, record in got.items())
