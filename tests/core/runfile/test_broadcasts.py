"""What cells broadcast, in the run file: it reads back as it was printed, or not at all."""

import h5py
import pytest

from logger.core.rows import channels_of
from logger.core.runfile import convert_journal, read_run, read_sound_run
from logger.core.runfile.frames import Kind, scan
from logger.core.schema import list_text
from logger.core.types import MOST_NEIGHBOURS, Broadcast, CellReading, Record, Scan
from tests.kit import runs

FULL = tuple(range(1023 - MOST_NEIGHBOURS + 1, 1024))
PRINTED = [
    None,
    Broadcast(neighbour_arfcns=()),
    Broadcast(neighbour_arfcns=(14, 19, 22, 48, 82), cro_db=60, penalty_time=31, t3212_raw=5),
    Broadcast(neighbour_arfcns=FULL),
    Broadcast(neighbour_arfcns=(0,)),
    Broadcast(t3212_raw=0),
]


def record(t_ns, printed=PRINTED):
    readings = tuple(
        CellReading("scan", "GSM", "262", "01", 4711, i + 1, rssi_dbm=-70.0, broadcast=broadcast)
        for i, broadcast in enumerate(printed)
    )
    return Record(t_ns, "modem", Scan(0, readings))


RECORDS = [record(1), record(2, PRINTED[::-1]), record(3, [])]


@pytest.mark.parametrize("form", ["journal", "h5"])
def test_what_was_printed_reads_back(tmp_path, form):
    runs.write_journal(tmp_path / "a.journal", RECORDS)
    convert_journal(tmp_path / "a.journal", tmp_path / "a.h5")
    for read in (read_run, read_sound_run):
        run = read(tmp_path / f"a.{form}")
        assert [found for _, found in run.records("scans")] == RECORDS
        assert not run.damage.meaningless_values


@pytest.mark.parametrize("channels", [(), (0,), FULL])
def test_a_list_is_text_that_reads_back(channels):
    assert channels_of(list_text(channels)) == channels


@pytest.mark.parametrize(
    "text", ["", "1 ", " 1", "1  2", "1024", "-1", "1,2", "12 none", "1 2…", "٣", "None", "1\n"]
)
def test_what_no_recorder_writes_is_no_list(text):
    assert channels_of(text) is None


def test_lost_rows_of_broadcasts_leave_the_readings(tmp_path):
    path = tmp_path / "a.journal"
    runs.write_journal(path, RECORDS)
    data = bytearray(path.read_bytes())
    for frame in list(scan(bytes(data))):
        if getattr(frame, "kind", None) == Kind.ROWS and _is_broadcasts(data, frame):
            data[frame.start] ^= 0xFF
    path.write_bytes(data)
    run = read_run(path)
    assert run.damage.missing_frames == 1
    assert [
        [reading.broadcast for reading in found.value.readings] for _, found in run.records("scans")
    ] == [[None] * len(PRINTED)] * 2 + [[]]


def _is_broadcasts(data, frame):
    import zlib

    return zlib.decompress(data[frame.start : frame.start + frame.length])[1:11] == b"broadcasts"


@pytest.mark.parametrize(
    ("column", "value", "of_reading"),
    [
        ("neighbour_arfcns", b"14 1024", Broadcast(None, 60, 31, 5)),
        ("neighbour_arfcns", b"14, 19", Broadcast(None, 60, 31, 5)),
        ("cro_db", 127, Broadcast((14, 19, 22, 48, 82), None, 31, 5)),
        ("penalty_time", -7, Broadcast((14, 19, 22, 48, 82), 60, None, 5)),
    ],
)
def test_impossible_values_are_unknown(tmp_path, column, value, of_reading):
    runs.write_journal(tmp_path / "a.journal", RECORDS)
    convert_journal(tmp_path / "a.journal", tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        rows = file["broadcasts"][...]
        rows[column][1] = value
        file["broadcasts"][...] = rows
    run = read_sound_run(tmp_path / "a.h5")
    assert run.damage.meaningless_values == 1
    (_, first), *_ = run.records("scans")
    assert first.value.readings[2].broadcast == of_reading
    assert first.value.readings[3].broadcast == PRINTED[3]
