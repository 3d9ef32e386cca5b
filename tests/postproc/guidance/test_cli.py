import json
import subprocess
import sys

import pytest

from tests.kit.guided_walks import line, rows

COMMAND = [sys.executable, "-m", "postproc.cli", "guide"]
HEADER = "t_s,lat,lon,rssi_dbm\n"


def _run(text, *options):
    return subprocess.run(
        [*COMMAND, *options], input=text, capture_output=True, text=True, timeout=60, check=False
    )


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
            assert set(answer) == {"t_s", "verdict", "best", "area_m2", "next"}
        guide.stdin.close()
    assert guide.returncode == 0


def test_a_bad_row_ends_nothing():
    good = _csv(line((0.0, 0.0), (8.1, 0.0)))
    done = _run(HEADER + good[0] + "x,y\n\n" + "\x00,,\n" + good[1])
    answers = [json.loads(text) for text in done.stdout.splitlines()]
    assert done.returncode == 0
    assert ["error" in answer for answer in answers] == [False, True, True, False]


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
