import pytest

from logger.core.baseline import HeardInSquare, NotedBaseline, SquareHistory, square_of
from logger.core.runfile import read_run
from logger.core.types import CellReading, Fix, Record, Scan
from logger.doctor.single_tests import antenna_line
from tests.kit import runs

S = 10**9


class Earlier(NotedBaseline):
    """Each cell had -70 dBm here."""

    def square(self, square):
        assert square == square_of(52.0, 13.0)
        heard = HeardInSquare(4, 40, -60.0, -65.0, -70.0, 5.0)
        return SquareHistory(square, {}, {f"262-01-1-{i}": heard for i in range(1, 6)})


def _line(tmp_path, levels, baseline=None, rat="GSM"):
    records = [Record(S, "gnss", Fix(True, None, 52.0, 13.0, hdop=1.0))]
    area = {"lac": 1} if rat in {"GSM", "WCDMA"} else {"tac": 1}
    column = {"GSM": "rssi_dbm", "WCDMA": "rscp_dbm"}.get(rat, "rsrp_dbm")
    for t, level in enumerate(levels, 2):
        cells = [
            CellReading("scan", rat, "262", "01", cid=i, **area, **{column: level})
            for i in range(1, 5)
        ]
        records.append(Record(t * S, "modem", Scan(t * S, tuple(cells))))
    (tmp_path / "a.journal").unlink(missing_ok=True)
    runs.write_journal(tmp_path / "a.journal", records)
    tables = read_run(tmp_path / "a.journal").tables
    return antenna_line(tables["readings"], tables["fixes"], baseline)


def test_20_db_below_what_this_place_gave_before(tmp_path):
    line = _line(tmp_path, [-92.0, -94.0], Earlier())
    assert line.state == "warn"
    assert "4 cells are 23 dB weaker here than on earlier walks: is the antenna" in line.text
    assert _line(tmp_path, [-76.0], Earlier()).state == "ok"
    assert "6 dB stronger" in _line(tmp_path, [-64.0], Earlier()).text


@pytest.mark.parametrize(
    ("rat", "level", "state"),
    [
        ("GSM", -99.0, "warn"),
        ("GSM", -80.0, "ok"),
        ("WCDMA", -110.0, "warn"),
        ("LTE", -119.0, "warn"),
        ("LTE", -100.0, "ok"),
        ("NR", -100.0, "ok"),
    ],
)
def test_without_earlier_walks_the_strongest_cell_counts(tmp_path, rat, level, state):
    assert _line(tmp_path, [level], NotedBaseline(), rat).state == state


def test_without_a_level_there_is_nothing_to_say(tmp_path):
    assert _line(tmp_path, []) is None
