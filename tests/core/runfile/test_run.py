import math
import random
import subprocess
import sys

import h5py
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from logger.core.errors import RunFileError
from logger.core.runfile import (
    convert_journal,
    finish_journal,
    journal_path,
    read_latest,
    read_run,
    unfinished_journals,
)
from logger.core.schema import TABLES
from logger.core.types import CellReading, Fix, LiveEstimate, Note, RawBytes, Record, Scan
from tests.kit import runs

NAMES = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=6)
UNSIGNED = st.none() | st.integers(0, 2**31 - 1)
NUMBER = st.none() | st.floats(allow_nan=False)
READINGS = st.builds(
    CellReading,
    st.sampled_from(["serving", "neighbour", "scan"]),
    rat=st.sampled_from([None, "GSM", "LTE"]),
    mcc=st.none() | st.sampled_from(["262", "001"]),
    mnc=st.none() | st.sampled_from(["01", "001"]),
    lac=UNSIGNED,
    cid=st.none() | st.integers(0, 2**36),
    arfcn=UNSIGNED,
    bsic=UNSIGNED,
    rxlev_raw=UNSIGNED,
    rssi_dbm=NUMBER,
    ta=UNSIGNED,
    c1=st.none() | st.integers(-1000, 1000),
)
VALUES = st.one_of(
    st.builds(RawBytes, st.binary(max_size=50), st.booleans()),
    st.builds(
        Fix, st.booleans(), st.none() | st.integers(0, 2**62), *[NUMBER] * 5,
        UNSIGNED, UNSIGNED, NUMBER, NUMBER,
    ),
    st.builds(Scan, st.integers(0, 2**62), st.lists(READINGS, max_size=4).map(tuple), UNSIGNED),
    st.builds(Note, st.sampled_from(["info", "error"]), NAMES, NAMES),
    st.builds(
        LiveEstimate, st.integers(0, 99), st.just("s"), st.just("c"),
        st.integers(0, 9), st.just(-33),
        *[st.floats(allow_nan=False)] * 17,
    ),
)  # fmt: skip
RECORDS = st.lists(
    st.builds(Record, st.integers(0, 2**62), st.sampled_from(["modem", "gnss"]), VALUES),
    max_size=75,
)


@settings(max_examples=10, deadline=None)  # each starts a process that reads HDF5
@given(RECORDS)
def test_every_record_reads_back_equal_from_both_forms(tmp_path_factory, found):
    folder = tmp_path_factory.mktemp("run")
    runs.write_journal(folder / "a.journal", found)
    convert_journal(folder / "a.journal", folder / "a.h5")
    for path in (folder / "a.journal", folder / "a.h5"):
        assert found == [record for _, record in read_run(path).records()]


@pytest.mark.parametrize("n", [1365, 4096, 12_000])
def test_long_runs_without_a_sync_between(tmp_path, n):
    """Whatever falls on the edge of a frame or of a block of HDF5."""
    found = [Record(i, "gnss", Fix(True, i, 52.0, 13.0)) for i in range(n)]
    runs.write_journal(tmp_path / "a.journal", found, sync_every=10**9)
    convert_journal(tmp_path / "a.journal", tmp_path / "a.h5")
    for path in (tmp_path / "a.journal", tmp_path / "a.h5"):
        run = read_run(path)
        assert run.tables["fixes"]["seq"].tolist() == list(range(n))
        assert run.damage.missing_frames == 0


def test_the_latest_of_a_long_run_is_read_with_all_notes(tmp_path):
    stream = runs.records(5000)
    runs.write_journal(tmp_path / "a.journal", stream, sync_every=10)
    latest, whole = read_latest(tmp_path / "a.journal", 60.0), read_run(tmp_path / "a.journal")
    assert latest.tables["notes"].tobytes() == whole.tables["notes"].tobytes()
    for table in ("fixes", "scans", "readings"):
        rows, every = latest.tables[table], whole.tables[table]
        assert 60 <= len(rows) < 140
        assert rows.tobytes() == every[-len(rows) :].tobytes()
    raw = latest.tables["raw"]
    assert latest.bytes_of(raw[-2:]) == b"$GPGGA,4998\r\n$GPGGA,4999\r\n"
    assert len(latest.raw_bytes) < 2000 < len(whole.raw_bytes)


def test_labelled_cells_read_back_equal(tmp_path):
    labelled = [
        CellReading("scan", label="target"),
        CellReading("scan", mcc="262", mnc="01", lac=1, cid=2),
        CellReading("scan", mcc="262", mnc="01", lac=1, cid=2, label="mine"),
    ]
    found = [Record(1, "import", Scan(1, tuple(labelled)))]
    runs.write_journal(tmp_path / "a.journal", found)
    assert [record for _, record in read_run(tmp_path / "a.journal").records()] == found


def test_runs_are_numbered_and_can_be_finished_again(tmp_path):
    journal = journal_path(tmp_path)
    assert journal.name == "run-000001.journal"
    runs.write_journal(journal, runs.records(30))
    assert unfinished_journals(tmp_path) == [journal]
    run = finish_journal(journal)
    assert run.name == "run-000001.h5"
    assert unfinished_journals(tmp_path) == []
    assert finish_journal(journal) == run
    assert {path.name for path in tmp_path.iterdir()} == {"run-000001.h5", "run-000001.journal"}


@pytest.mark.parametrize(
    ("there", "expected"),
    [
        (["run-000007.h5"], 8),
        (["run-000007.journal.3", "run-000002.h5"], 8),
        (["run-000007.h5.part"], 8),
        (["run-999999.h5", "run-1000000.journal"], 1_000_001),
        (["run-20260921T141320Z.h5", "run-1a2b3c4d.journal", "run.h5", "notes.txt"], 1),
    ],
)
def test_the_next_number_is_above_all_there_are(tmp_path, there, expected):
    for name in there:
        (tmp_path / name).touch()
    assert journal_path(tmp_path).name == f"run-{expected:06d}.journal"


def test_the_hdf5_of_another_run_is_not_overwritten(tmp_path):
    for name, run_id in (("run-000001", "a"), ("run-000002", "b")):
        runs.write_journal(tmp_path / f"{name}.journal", runs.records(3), run_id=run_id)
    finish_journal(tmp_path / "run-000001.journal").rename(tmp_path / "run-000002.h5")
    with pytest.raises(RunFileError, match="another run"):
        finish_journal(tmp_path / "run-000002.journal")
    assert read_run(tmp_path / "run-000002.h5").meta.run_id == "a"
    (tmp_path / "run-000002.h5").write_bytes(b"rubbish")
    assert read_run(finish_journal(tmp_path / "run-000002.journal")).meta.run_id == "b"


def test_a_journal_being_recorded_is_left_alone(tmp_path):
    from logger.core.runfile import RunWriter

    writer = RunWriter(tmp_path / "run-a.journal", runs.meta())
    assert unfinished_journals(tmp_path) == []
    writer.close(0, "test")
    assert unfinished_journals(tmp_path) == [tmp_path / "run-a.journal"]


def test_cut_journal_keeps_whole_ticks(tmp_path):
    """Cut at every 97th byte: always readable, always a prefix of what was recorded, never more
    than a tick short.
    """
    found = runs.records(40)
    complete = tmp_path / "whole.journal"
    runs.write_journal(complete, found, sync_every=20)
    data = complete.read_bytes()
    cut = tmp_path / "cut.journal"
    lengths = []
    for end in range(4000, len(data), 97):
        cut.write_bytes(data[:end])
        run = read_run(cut)
        got = dict(run.records())
        assert all(
            found[seq] == record
            for seq, record in got.items()
            if not isinstance(record.value, Scan)
        )
        lengths.append(len(got))
    assert lengths == sorted(lengths)
    assert read_run(cut).end is None


def test_damage_is_stated_and_nothing_is_invented(tmp_path):
    found = runs.records(60)
    complete = tmp_path / "whole.journal"
    runs.write_journal(complete, found)
    data = complete.read_bytes()
    rng = random.Random(3)
    hit = tmp_path / "hit.journal"
    for _ in range(60):
        damaged = bytearray(data)
        at = rng.randrange(3000, len(data) - 10)
        damaged[at : at + 5] = rng.randbytes(5)
        hit.write_bytes(damaged)
        run = read_run(hit)
        assert run.damage.missing_frames + (run.end is None) >= 1
        assert run.damage.skipped_bytes > 0
        for seq, record in run.records():
            if not isinstance(record.value, Scan):
                assert found[seq] == record


def test_lost_first_block_is_mended_by_the_repeated_meta(tmp_path):
    found = runs.records(200)
    path = tmp_path / "a.journal"
    runs.write_journal(path, found, sync_every=5)
    path.write_bytes(bytes(4096) + path.read_bytes()[4096:])
    run = read_run(path)
    assert run.meta.run_id == "0" * 32
    assert run.end is not None
    assert len(list(run.records())) > 500


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "empty"),
        (b"lat,lon\n1,2\n", "no cellwalk run"),
        (b"\x89HDF\r\n\x1a\nrubbish" * 20, "damaged"),
        (bytes(5000), "no cellwalk run"),
    ],
)
def test_what_is_no_run_is_refused_in_one_line(tmp_path, content, message):
    path = tmp_path / "run.h5"
    path.write_bytes(content)
    with pytest.raises(RunFileError, match=message) as error:
        read_run(path)
    assert "\n" not in str(error.value)


def test_missing_file_folder_and_foreign_hdf5(tmp_path):
    with pytest.raises(RunFileError, match="no such file"):
        read_run(tmp_path / "none.h5")
    with pytest.raises(RunFileError, match="cannot be read"):
        read_run(tmp_path)
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["a"] = 1
    with pytest.raises(RunFileError, match="no cellwalk run"):
        read_run(tmp_path / "other.h5")


def test_damaged_hdf5_is_refused(tmp_path):
    runs.write_journal(tmp_path / "a.journal", runs.records(300))
    convert_journal(tmp_path / "a.journal", tmp_path / "a.h5")
    data = bytearray((tmp_path / "a.h5").read_bytes())
    for at in range(len(data) // 4, len(data), 2000):
        data[at] ^= 0xFF
    (tmp_path / "a.h5").write_bytes(data)
    with pytest.raises(RunFileError):
        read_run(tmp_path / "a.h5")


def test_half_of_a_copy_says_so(tmp_path):
    runs.write_journal(tmp_path / "a.journal", runs.records(300))
    convert_journal(tmp_path / "a.journal", tmp_path / "a.h5")
    data = (tmp_path / "a.h5").read_bytes()
    (tmp_path / "a.h5").write_bytes(data[:5000])
    with pytest.raises(RunFileError, match=f"5,000 of its {len(data):,} bytes .* copy it again"):
        read_run(tmp_path / "a.h5")


def test_a_newer_schema_is_refused(tmp_path):
    from logger.core.runfile import RunWriter

    writer = RunWriter(tmp_path / "a.journal", runs.meta(schema=99))
    writer.close(0, "x")
    with pytest.raises(RunFileError, match="please update"):
        read_run(tmp_path / "a.journal")


def test_hdf5_is_of_the_oldest_format_and_describes_its_columns(tmp_path):
    runs.write_journal(tmp_path / "a.journal", runs.records(3))
    convert_journal(tmp_path / "a.journal", tmp_path / "a.h5")
    assert (tmp_path / "a.h5").read_bytes()[8] == 0  # superblock version
    with h5py.File(tmp_path / "a.h5") as file:
        for table, columns in TABLES.items():
            assert file[table].attrs["columns"].splitlines() == [
                f"{c.name}: {c.unit}" for c in columns
            ]


def test_long_texts_are_cut_between_characters(tmp_path):
    found = [Record(1, "logger", Note("info", "code", "ä" * 500))]
    runs.write_journal(tmp_path / "a.journal", found)
    ((_, record),) = read_run(tmp_path / "a.journal").records()
    assert record.value.text == "ä" * 198 + "…"


def test_diverged_estimate_reads_back_as_nan(tmp_path):
    estimate = LiveEstimate(1, "s", "c", 1, 33, *[math.nan] * 17)
    runs.write_journal(tmp_path / "a.journal", [Record(1, "live", estimate)])
    ((_, record),) = read_run(tmp_path / "a.journal").records()
    assert math.isnan(record.value.x_m)
    assert math.isnan(record.value.innovation_db)


WRITE_FOREVER = """
import sys, time
from pathlib import Path
from tests.kit import runs
from logger.core.runfile import RunWriter
writer = RunWriter(Path(sys.argv[1]), runs.meta())
acknowledged = 0
for record in runs.records(5000):
    acknowledged = writer.append(record)
    if acknowledged % 50 == 49:
        writer.sync()
        print(acknowledged, flush=True)
"""


@pytest.mark.parametrize("seed", range(10))
def test_kill_9_loses_nothing_that_was_synced(tmp_path, seed):
    path = tmp_path / "a.journal"
    with subprocess.Popen(
        [sys.executable, "-c", WRITE_FOREVER, str(path)], stdout=subprocess.PIPE, text=True
    ) as child:
        for _ in range(random.Random(seed).randrange(1, 60)):
            acknowledged = int(child.stdout.readline())
        child.kill()
        child.wait()
    got = [seq for seq, _ in read_run(path).records()]
    assert got[: acknowledged + 1] == list(range(acknowledged + 1))
