"""Values that no recorder writes are unknown to whoever computes with a run; an honest run stays as
it is.
"""

import numpy as np
import pytest

from logger.core.runfile import convert_journal, read_run, read_sound_run
from logger.core.types import UNKNOWN_ID, UNKNOWN_TIME
from postproc.cli import main
from tests.kit import runs


@pytest.fixture
def crafted_run(tmp_path):
    """Writes a run whose rows were changed before they were recorded, as a forger would."""
    import h5py

    def craft(*changes):
        runs.write_journal(tmp_path / "a.journal", runs.records(20))
        convert_journal(tmp_path / "a.journal", tmp_path / "a.h5")
        with h5py.File(tmp_path / "a.h5", "r+") as file:
            for table, column, value in changes:
                rows = file[table][...]
                rows[column][3] = value
                file[table][...] = rows
        return tmp_path / "a.h5"

    return craft


def test_an_honest_run_is_the_same_for_both_readers(crafted_run):
    path = crafted_run()
    exact, sound = read_run(path), read_sound_run(path)
    assert not sound.damage
    for table, rows in exact.tables.items():
        assert sound.tables[table].tobytes() == rows.tobytes()


@pytest.mark.parametrize(
    ("table", "column", "value", "instead"),
    [
        ("fixes", "lat_deg", 91.0, np.nan),
        ("fixes", "lon_deg", np.inf, np.nan),
        ("fixes", "acc_m", -1.0, np.nan),
        ("fixes", "utc_ns", 2**63 - 1, UNKNOWN_TIME),
        ("fixes", "valid", 77, 1),
        ("readings", "rssi_dbm", 1e300, np.nan),
        ("readings", "ta", 2**31 - 1, UNKNOWN_ID),
        ("readings", "rat", b"GSM2", b""),
        ("readings", "role", b"king", b"scan"),
        ("readings", "cell", b"a\0b", b"a?b"),
        ("readings", "cell", b"\xff", "\ufffd".encode()),
        ("scans", "t_start_ns", -(2**63), 3 * 10**9 + 5),
        ("notes", "level", b"shout", b"info"),
        ("raw", "offset", -7, 0),
        ("raw", "length", 2**31 - 1, 0),
    ],
)
def test_what_no_recorder_writes_is_unknown(crafted_run, capsys, table, column, value, instead):
    path = crafted_run((table, column, value)) if table != "notes" else None
    if path is None:
        path = crafted_run()
        import h5py

        with h5py.File(path, "r+") as file:
            rows = file[table][...]
            rows[column][0] = value
            file[table][...] = rows
    row = read_sound_run(path).tables[table][0 if table == "notes" else 3]
    np.testing.assert_equal(row[column], instead)
    assert read_sound_run(path).damage.meaningless_values >= 1
    assert main(["info", str(path)]) == 0
    assert "no recorder writes" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("column", "value"), [("seq", -1), ("seq", 2**63 - 1), ("t_ns", 2**63 - 1), ("t_ns", -(2**63))]
)
def test_rows_at_no_time_are_left_out(crafted_run, column, value):
    run = read_sound_run(crafted_run(("readings", column, value)))
    assert len(run.tables["readings"]) == 39
    assert run.damage.meaningless_values == 1
