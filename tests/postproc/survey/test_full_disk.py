"""A disk that is full while a survey is made or located: one line, and the next call ends it."""

import json
import os
import shutil
import subprocess

import pytest

from postproc.cli import main
from postproc.survey.dataset import Survey
from tests.kit.faulty_card import small_file_system
from tests.postproc.baseline.walks import cell, write_walk


@pytest.fixture
def disk(tmp_path):
    with small_file_system(tmp_path / "disk", "size=8m") as folder:
        yield folder


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    folder = tmp_path_factory.mktemp("walks")
    for number in range(4):
        write_walk(
            folder, number,
            lambda k, n=number: (cell(1, -55.0 - abs(k - 30) // 2 - n), cell(2, -70.0 - k % 5)),
            n=60, lon_deg=13.4 + 2e-3 * number,
        )  # fmt: skip
    return folder


def _fill(disk, left_bytes):
    """Use up all but some bytes."""
    status = os.statvfs(disk)
    ballast = disk / "ballast"
    ballast.write_bytes(bytes(max(status.f_bavail * status.f_frsize - left_bytes, 0)))
    return ballast


def _locate(folder, scheduler, capsys):
    code = main(["survey", "locate", str(folder), "--scheduler", scheduler, "--json"])
    shown = capsys.readouterr()
    document = json.loads(shown.out) if shown.out else None
    if document is not None:
        del document["files"]
    return code, document, shown.err


@pytest.mark.parametrize("left_bytes", [4096, 16384, 24576])
def test_full_while_adding(disk, walks, left_bytes, capsys):
    first, *others = sorted(walks.glob("*.h5"))
    survey = disk / "s"
    assert main(["survey", "add", str(first), "-o", str(survey)]) == 0
    before = {path: path.read_bytes() for path in survey.rglob("*.parquet")}
    ballast = _fill(disk, left_bytes)
    capsys.readouterr()
    assert main(["survey", "add", *map(str, others), "-o", str(survey)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "No space left on device; what was added before is safe" in line
    assert {path: path.read_bytes() for path in survey.rglob("*.parquet")} == before
    assert len(Survey.open(survey).runs) == 1
    ballast.unlink()
    assert main(["survey", "add", str(walks), "-o", str(survey)]) == 0
    whole = Survey.open(survey)
    assert len(whole.runs) == 4
    assert [(one.n_readings, one.n_runs) for one in whole.cells()] == [(240, 4)] * 2


@pytest.mark.parametrize("left_bytes", [0, 4096, 16384, 65536])
def test_full_while_locating(disk, walks, left_bytes, scheduler, capsys, tmp_path):
    assert main(["survey", "add", str(walks), "-o", str(disk / "s")]) == 0
    shutil.copytree(disk / "s", tmp_path / "s")
    capsys.readouterr()
    code, expected, _ = _locate(tmp_path / "s", scheduler, capsys)
    assert code == 0
    ballast = _fill(disk, left_bytes)
    code, _, error = _locate(disk / "s", scheduler, capsys)
    _, line = error.splitlines()  # after the one that says how large the survey is
    assert (code, line.startswith(f"postproc: cannot write {disk}")) == (2, True)
    ballast.unlink()
    assert _locate(disk / "s", scheduler, capsys)[:2] == (0, expected)
    assert not list(disk.rglob("*.part"))
    for name in ("estimates.jsonl", "words.jsonl"):
        assert _lines(disk / "s" / name) == _lines(tmp_path / "s" / name)
    assert all((disk / "s" / f"located.{form}").exists() for form in ("parquet", "gpkg"))


def test_of_a_survey_that_cannot_be_written(disk, walks, scheduler, capsys, tmp_path):
    """Another's, on a share that is mounted to be read: located, drawn and planned elsewhere."""
    survey = disk / "s"
    assert main(["survey", "add", str(walks), "-o", str(survey)]) == 0
    subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
    capsys.readouterr()
    code, document, error = _locate(survey, scheduler, capsys)
    assert (code, document) == (2, None)
    assert error == f"postproc: cannot write {survey}/located.parquet: Read-only file system\n"
    for command, name in (("locate", "of 2026.11"), ("map", "s.html")):
        target = ["-o", str(tmp_path / name), "--scheduler", scheduler]
        assert main(["survey", command, str(survey), *target]) == 0
        assert "no estimate is kept" in capsys.readouterr().err
    written = {path.name for path in tmp_path.iterdir() if path.is_file()}
    assert written == {"of 2026.11.parquet", "of 2026.11.gpkg", "s.html"}


def _lines(path):
    """Whole lines, each as often as it is there."""
    found = []
    for text in path.read_text().splitlines():
        try:
            found.append(json.dumps(json.loads(text), sort_keys=True))
        except ValueError:
            continue
    return sorted(found)
