import json
import subprocess
import sys

import pytest

from tests.kit.guided_walks import line, rows

COMMAND = [sys.executable, "-m", "postproc.cli", "guide"]
HEADER = "t_s,lat,lon,rssi_dbm\n"


def _run(text, *options):
    content = text if isinstance(text, bytes) else text.encode()
    done = subprocess.run(
        [*COMMAND, *options], input=content, capture_output=True, timeout=60, check=False
    )
    done.stdout, done.stderr = done.stdout.decode(), done.stderr.decode()
    return done


def _csv(points_m):
    return [",".join(row.values()) + "\n" for row in rows(points_m, (120.0, 90.0))]


def test_each_row_is_answered_before_the_next_one_is_sent():
    with subprocess.Popen(
        COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as guide:
        guide.stdin.write(HEADER)
        for k, row in enumerate(_csv(line((0.0, 0.0), (80.0, 0.0)))):
            guide.stdin.write(row)
            guide.stdin.flush()
            answer = json.loads(guide.stdout.readline())
            assert answer["t_s"] == 3.0 * k
            assert set(answer) == {"t_s", "verdict", "best", "area_m2", "next", "text"}
            assert answer["text"].startswith(answer["verdict"])
        guide.stdin.close()
    assert guide.returncode == 0


def test_a_bad_row_ends_nothing():
    good = _csv(line((0.0, 0.0), (8.1, 0.0)))
    done = _run(HEADER + good[0] + "x,y\n\n" + "\x00,,\n" + good[1])
    answers = [json.loads(text) for text in done.stdout.splitlines()]
    assert done.returncode == 0
    assert ["error" in answer for answer in answers] == [False, True, True, False]


def test_a_decimal_comma_is_no_position():
    done = _run(HEADER + "0,52,5,13,4,-70\n3,52.5,13.4,-70,\n")
    first, second = map(json.loads, done.stdout.splitlines())
    assert first["error"] == "more values than columns; decimals are written with a point"
    assert "error" not in second  # a comma at the end of each line is no value


@pytest.mark.parametrize(
    "bad", [b'12,"52.5,13.4,-70\n', b"12,\xff\xfe,13.4,-70\n", b"12," + b"9" * 200_000 + b",1,2\n"]
)
def test_a_row_that_is_no_csv_ends_nothing_and_swallows_nothing(bad):
    good = [row.encode() for row in _csv(line((0.0, 0.0), (8.1, 0.0)))]
    done = _run(HEADER.encode() + good[0] + bad + good[1])
    assert done.returncode == 0, done.stderr
    answers = [json.loads(text) for text in done.stdout.splitlines()]
    assert ["error" in answer for answer in answers] == [False, True, False]


def test_a_file_as_a_spreadsheet_saves_it_is_read():
    rows_of_csv = _csv(line((0.0, 0.0), (40.0, 0.0)))
    plain = _run(HEADER + "".join(rows_of_csv))
    saved = "\ufeff" + '"T_S","lat","lon","rssi_dbm"\n' + "".join(rows_of_csv)
    done = _run(saved.replace("\n", "\r\n"))
    assert (done.returncode, done.stdout) == (0, plain.stdout)


def test_a_column_that_is_named_twice_is_one_line():
    done = _run("t_s,lat,lon,rssi_dbm,lat\n")
    assert done.returncode == 2
    assert "names lat twice" in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_cell_that_no_row_names_is_said_at_the_end():
    rows_of_csv = _csv(line((0.0, 0.0), (40.0, 0.0)))
    text = "t_s,lat,lon,rssi_dbm,cell\n" + "".join(row.strip() + ",a\n" for row in rows_of_csv)
    assert _run(text, "--cell", "a").stderr == ""
    done = _run(text, "--cell", "b")
    assert len(done.stdout.splitlines()) == len(rows_of_csv)
    assert done.stderr == "postproc: no row had a level of b with a position\n"


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "t_s,lat,lon\n"])
def test_a_header_without_the_columns_is_one_line(text):
    done = _run(text)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "rssi_dbm" in done.stderr


def test_a_cell_needs_its_column():
    done = _run(HEADER, "--cell", "262-01-1-1")
    assert (done.returncode, "cell" in done.stderr) == (2, True)


def test_a_file_without_streets_is_one_line(tmp_path):
    path = tmp_path / "streets.geojson"
    path.write_text('{"type": "Point", "coordinates": [13.4, 52.5]}')
    done = _run(HEADER, "--streets", str(path))
    assert done.returncode == 2
    assert "has no line" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("lon_deg", "lat_deg", "is_said"),
    [(13.4, 52.51, False), (13.4, 52.6, True), (52.5, 13.4, True)],
)
def test_streets_of_another_town_are_said(tmp_path, lon_deg, lat_deg, is_said):
    path = tmp_path / "streets.geojson"
    street = [[lon_deg, lat_deg], [lon_deg + 0.001, lat_deg]]
    path.write_text(json.dumps({"type": "LineString", "coordinates": street}))
    rows_of_csv = _csv(line((0.0, 0.0), (40.0, 0.0)))
    done = _run(HEADER + "".join(rows_of_csv), "--streets", str(path))
    assert len(done.stdout.splitlines()) == len(rows_of_csv)
    assert done.stderr.count("no street near the first position") == int(is_said)
