import pytest

from logger.core.runfile import read_run
from logger.core.types import Fix, RawBytes, Record
from logger.doctor.single_tests import fixes_lines, jumps, satellites_in_use
from tests.kit import runs

S = 10**9


def _gsv(*densities):
    """GSV sentences of GPS with these densities, four satellites in each."""
    text, groups = b"", [densities[i : i + 4] for i in range(0, len(densities), 4)]
    for n, group in enumerate(groups, 1):
        cells = "".join(f",{4 * n + i:02d},40,083,{d:02d}" for i, d in enumerate(group))
        body = f"GPGSV,{len(groups)},{n},{len(densities):02d}{cells}"
        checksum = 0
        for byte in body.encode():
            checksum ^= byte
        text += f"${body}*{checksum:02X}\r\n".encode()
    return text


def _run(tmp_path, records):
    path = tmp_path / "a.journal"
    path.unlink(missing_ok=True)
    runs.write_journal(path, records)
    return read_run(path)


def _fixes(lat_deg):
    return [
        Record(i * S, "gnss", Fix(True, None, lat, 13.0, hdop=1.0)) for i, lat in enumerate(lat_deg)
    ]


@pytest.mark.parametrize(
    ("densities", "says"),
    [
        ((45, 44, 40, 38, 33, 30, 12), "although 6 satellites are received"),
        ((30, 28), "2 satellites are received; go under open sky"),
        ((), "a cold start under open sky takes minutes"),
    ],
)
def test_satellites_without_a_position_are_counted(tmp_path, densities, says):
    sentences = _gsv(*densities) if densities else b"$GPRMC,\r\n"
    records = [Record(t * S, "gnss", RawBytes(sentences)) for t in range(1, 9)]
    run = _run(tmp_path, [*records, Record(9 * S, "gnss", Fix(False))])
    (line,) = fixes_lines(run, run.tables["fixes"])
    assert (line.state, says in line.text) == ("warn", True), line


@pytest.mark.parametrize(
    ("valid", "hdop", "says"),
    [
        ([False] * 8 + [True] * 4, 1.0, "wait a minute under open sky"),
        ([True] * 12, 9.0, "has the antenna a clear sky?"),
    ],
)
def test_poor_positions_have_a_remedy(tmp_path, valid, hdop, says):
    fixes = [Fix(is_valid, None, 52.0, 13.0, hdop=hdop) for is_valid in valid]
    run = _run(tmp_path, [Record(i * S, "gnss", fix) for i, fix in enumerate(fixes)])
    (line,) = fixes_lines(run, run.tables["fixes"])
    assert (line.state, line.text.endswith(says)) == ("warn", True), line


def test_only_the_latest_sentences_count(tmp_path):
    records = [
        Record(1 * S, "gnss", RawBytes(_gsv(45, 44, 40, 38, 33))),
        Record(60 * S, "gnss", RawBytes(_gsv(30, 28))),
        Record(61 * S, "modem", RawBytes(_gsv(45, 44, 40, 38, 33))),
    ]
    assert satellites_in_use(_run(tmp_path, records)) == 2


def test_positions_that_no_car_reaches_are_jumps(tmp_path):
    places = [52.0 + i * 1e-5 for i in range(20)]
    assert jumps(_run(tmp_path, _fixes(places)).tables["fixes"]) == (0, 0.0)
    places[10] += 0.01
    run = _run(tmp_path, _fixes(places))
    *_, line = fixes_lines(run, run.tables["fixes"])
    assert (line.what, line.state) == ("jumps", "warn")
    assert "jumped 2 times, once by 1113 m" in line.text
