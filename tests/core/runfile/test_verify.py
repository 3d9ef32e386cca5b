"""The hash chain: from either form alone, and broken by whatever is changed, left out or added."""

import h5py
import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import convert_journal, read_run, sealing_of
from logger.core.runfile.frames import Frame, Kind, encode, payload_of, scan
from postproc.cli import main
from tests.kit import runs


@pytest.fixture
def journal(tmp_path):
    path = tmp_path / "a.journal"
    runs.write_journal(path, runs.records(300), sync_every=7)
    return path


def test_both_forms_give_the_digest_of_the_seal(journal, tmp_path):
    convert_journal(journal, tmp_path / "a.h5")
    sealed = read_run(journal).end.digest
    assert len(sealed) == 64
    for path in (journal, tmp_path / "a.h5"):
        assert sealing_of(path).holds
        assert sealing_of(path).recomputed_digest == read_run(path).digest == sealed
    assert sealing_of(journal) == sealing_of(tmp_path / "a.h5")


def test_the_digest_is_what_the_page_says(journal):
    """As a third party would write it."""
    from hashlib import sha256

    data, digest = journal.read_bytes(), bytes(32)
    for frame in scan(data):
        if frame.kind == Kind.END:
            break
        payload = payload_of(data[frame.start : frame.start + frame.length], frame.version)
        digest = sha256(
            digest + frame.number.to_bytes(4, "little") + bytes([frame.kind]) + payload
        ).digest()
    assert digest.hex() == read_run(journal).digest


def _rewrite(journal, change):
    """The journal with one frame changed, its CRC right."""
    data, out = journal.read_bytes(), []
    for frame in scan(data):
        assert isinstance(frame, Frame)
        payload = payload_of(data[frame.start : frame.start + frame.length], frame.version)
        out.append((frame.run, frame.number, Kind(frame.kind), payload, frame.schema))
    journal.write_bytes(b"".join(encode(*frame) for frame in change(out)))


def _touch_a_byte(frames):
    run, number, kind, payload, schema = frames[20]
    frames[20] = (run, number, kind, payload[:-1] + bytes([payload[-1] ^ 1]), schema)
    return frames


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_touch_a_byte, "altered"),
        (lambda frames: frames[:20] + frames[21:], "frame 20 is missing"),
        (lambda frames: frames[:-1], "not sealed"),
        (lambda frames: frames[:-5], "not sealed"),
    ],
)
def test_what_was_changed_with_care_is_found(journal, tmp_path, capsys, change, message):
    _rewrite(journal, change)
    convert_journal(journal, tmp_path / "a.h5")
    for path in (journal, tmp_path / "a.h5"):
        assert not sealing_of(path).holds
        assert main(["info", "--verify", str(path)]) == 3
        assert message in capsys.readouterr().out


def test_a_changed_hdf5_is_found(journal, tmp_path, capsys):
    convert_journal(journal, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        row = file["readings"][5]
        row["rssi_dbm"] += 1.0
        file["readings"][5] = row
    assert sealing_of(journal) != sealing_of(tmp_path / "a.h5")
    assert main(["info", "--verify", str(tmp_path / "a.h5")]) == 3
    assert "altered" in capsys.readouterr().out


def test_rows_added_to_hdf5_are_found(journal, tmp_path, capsys):
    convert_journal(journal, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        fixes = file["fixes"]
        fixes.resize((len(fixes) + 1,))
        fixes[-1] = fixes[0]
    assert not sealing_of(tmp_path / "a.h5").holds
    assert main(["info", "--verify", str(tmp_path / "a.h5")]) == 3
    assert "fixes has rows that were not recorded" in capsys.readouterr().out


def test_a_whole_run_passes_every_check(journal, tmp_path, capsys):
    convert_journal(journal, tmp_path / "a.h5")
    for path in (journal, tmp_path / "a.h5"):
        assert main(["info", "--verify", str(path)]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert [line.split()[1] for line in lines] == [
            "checksums:",
            "counts:",
            "time:",
            "stop:",
            "chain:",
        ]
        assert all(line.startswith("ok ") for line in lines)


def test_time_that_goes_back_is_found(tmp_path, capsys):
    found = runs.records(5)
    runs.write_journal(tmp_path / "a.journal", found + runs.records(2))
    assert main(["info", "--verify", str(tmp_path / "a.journal")]) == 3
    assert "FAIL  time" in capsys.readouterr().out


def test_what_is_no_run_is_refused(tmp_path):
    (tmp_path / "x").write_text("nothing")
    with pytest.raises(RunFileError):
        sealing_of(tmp_path / "x")
    with pytest.raises(RunFileError):
        sealing_of(tmp_path / "none")
