"""`postproc survey add`: each run once, damaged ones left out, safe to kill, nothing private."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import read_sound_run
from postproc.cli import main
from postproc.interop.importing import import_walk
from postproc.multi_run import merge
from postproc.survey import layout, parquet_batch
from postproc.survey.dataset import Survey
from postproc.survey.intake import add_files
from postproc.walk import observe_run
from tests.postproc.baseline.walks import cell, name, two_cells, write_walk

ROOT = Path(__file__).parents[3]
KILLS = int(os.environ.get("CELLWALK_SURVEY_KILLS", "2"))


@pytest.fixture
def walks(tmp_path):
    folder = tmp_path / "walks"
    folder.mkdir()
    for number in range(3):
        write_walk(folder, number, two_cells(-60.0 - number), n=40, lat_deg=52.5 + 0.001 * number)
    return folder


def _add(capsys, *arguments):
    code = main(["survey", "add", *map(str, arguments), "--json"])
    shown = capsys.readouterr()
    return code, json.loads(shown.out) if shown.out else None, shown.err


def test_a_run_and_its_shared_copy_are_one_run(tmp_path, capsys):
    whole, copy = write_walk(tmp_path, 1, two_cells()), tmp_path / "a-copy.h5"
    assert main(["share", str(whole), "-o", str(copy), "--blur-m", "50"]) == 0
    capsys.readouterr()
    for order in ((whole, copy, whole), (copy, whole, copy)):
        code, said, err = _add(capsys, *order[:2], "-o", tmp_path / "survey")
        assert (code, said["runs"]) == (0, 1)
        assert "copy of" in err
        code, said, _ = _add(capsys, order[2], "-o", tmp_path / "survey")
        assert (code, said["runs"], said["files"][0]["is_known"]) == (0, 1, True)
        assert [run.name for run in Survey.open(tmp_path / "survey").runs.values()] == [whole.name]
        shutil.rmtree(tmp_path / "survey")


@pytest.mark.parametrize("suffix", ["csv", "wigle.csv", "opencellid.json"])
def test_a_run_and_what_was_exported_of_it_are_one_run(tmp_path, capsys, suffix):
    whole, levels = write_walk(tmp_path, 1, two_cells()), tmp_path / f"a.{suffix}"
    form = {"csv": "csv", "wigle.csv": "wigle", "opencellid.json": "opencellid-json"}[suffix]
    assert main(["export", str(whole), "-o", str(levels), "--format", form]) == 0
    capsys.readouterr()
    for order in ((whole, levels), (levels, whole)):
        code, said, err = _add(capsys, *order, "-o", tmp_path / "survey")
        assert (code, said["runs"]) == (0, 1)
        assert "copy of" in err
        assert [run.name for run in Survey.open(tmp_path / "survey").runs.values()] == [whole.name]
        shutil.rmtree(tmp_path / "survey")


def test_readings_are_those_of_smooth(walks, tmp_path):
    survey = Survey.open_or_make(tmp_path / "survey")
    list(add_files(survey, sorted(walks.glob("*.h5"))))
    survey = Survey.open(survey.folder)
    by_run = survey.observations("262-01-801", [name(1)])[name(1)]
    assert list(by_run) == list(survey.runs)  # in the order in which they began
    assert len(by_run) == 3
    for digest, kept in by_run.items():
        observed = observe_run(read_sound_run(walks / survey.runs[digest].name)).observations
        (own,) = [obs for obs in observed.cells if obs.cell == name(1)]
        for column in ("x_m", "y_m", "position_sigma_m", "level_dbm", "scan_seq", "named_share"):
            np.testing.assert_array_equal(getattr(kept, column), getattr(own, column))
        assert (kept.rat, kept.utm, kept.ta) == (own.rat, own.utm, own.ta)
    assert len(merge(dict(enumerate(by_run.values())), range(3))) == 120


def test_timing_advances_are_those_of_smooth(tmp_path):
    """LTE counts to 1282, more than the column of older surveys holds."""

    def hear(k):
        heard = cell(1, -70.0)
        return (replace(heard, rat="LTE", role="serving", ta_16ts=100 * (k % 12)),)

    survey = Survey.open_or_make(tmp_path / "survey")
    list(add_files(survey, [write_walk(tmp_path, 1, hear, n=40)]))
    survey = Survey.open(survey.folder)
    rows = survey.rows("262-01-801")
    assert rows["ta"].to_pylist() == [100 * (k % 12) for k in range(40)]
    (file,) = (survey.folder / "readings").glob("*/*.parquet")
    at = rows.schema.get_field_index("ta")
    older = rows.set_column(at, "ta", pa.array([k % 12 for k in range(40)], pa.int8()))
    pq.write_table(older, file)
    assert survey.rows("262-01-801")["ta"].to_pylist() == [k % 12 for k in range(40)]
    assert survey.rows("262-01-801").schema.field("ta") == layout.READINGS.field("ta")


def test_readings_without_times_are_known_as_such(tmp_path):
    log = tmp_path / "log.csv"
    rows = [f"{3 * k},{52.5 + 3e-5 * k},13.4,{-60 - k % 7},cell" for k in range(30)]
    log.write_text("\n".join(["t_s,lat,lon,rssi_dbm,cell", *rows, ""]))
    for has_times in (True, False):
        path = tmp_path / f"{has_times}.h5"
        import_walk(log, path, times=has_times)
        survey = Survey.open_or_make(tmp_path / f"survey-{has_times}")
        list(add_files(survey, [path]))
        (kept,) = Survey.open(survey.folder).observations("none", ["cell"])["cell"].values()
        assert kept.is_timed == has_times


def test_each_run_once(walks, tmp_path, capsys):
    first = min(walks.glob("*.h5"))
    code, added, _ = _add(capsys, first, "-o", tmp_path / "s")
    assert (code, added["runs"], added["cells"], added["left_out"]) == (0, 1, 2, 0)
    code, added, _ = _add(capsys, walks, "-o", tmp_path / "s")
    assert (code, added["runs"]) == (0, 3)
    assert [one["is_known"] for one in added["files"]] == [True, False, False]
    # the journal of a run is that run
    code, added, _ = _add(capsys, first.with_suffix(".journal"), "-o", tmp_path / "s")
    assert (code, added["runs"], added["files"][0]["is_known"]) == (0, 3, True)
    assert main(["survey", "add", str(first), "-o", str(tmp_path / "one")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'one'}: 1 added; 1 run, 2 cells\n"
    assert sum(one.n_readings for one in Survey.open(tmp_path / "s").cells()) == 240


def test_what_postproc_keeps_beside_the_runs_is_no_log(walks, tmp_path, capsys):
    """A survey within the folder of its runs, a baseline and a database of cells."""
    main(
        ["baseline", "add", str(walks / "run-000000.h5"), "--baseline", str(walks / "baseline.db")]
    )
    (tmp_path / "cells.csv").write_text(
        "radio,mcc,net,area,cell,unit,lon,lat,range,samples,changeable,created,updated,"
        "averageSignal\nGSM,262,1,801,1,0,13.4,52.5,1000,5,1,1,1,0\n"
    )
    cells = ["-o", str(walks / "cells.db")]
    assert main(["celldb", "import", str(tmp_path / "cells.csv"), *cells]) == 0
    capsys.readouterr()
    survey = walks / "survey"
    assert _add(capsys, walks, "-o", survey)[::2] == (0, "")
    assert main(["survey", "map", str(survey), "--workers", "1"]) == 0
    capsys.readouterr()
    code, added, said = _add(capsys, walks, "-o", survey)
    assert (code, said) == (0, "")
    assert [file["is_known"] for file in added["files"]] == [True] * 3


def test_damaged_runs_are_named_and_left_out(walks, tmp_path, capsys):
    (walks / "broken.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    torn = write_walk(walks, 7, two_cells(), n=60, finish=False)
    content = bytearray(torn.read_bytes())
    content[len(content) // 2] ^= 0xFF
    torn.write_bytes(content)
    code, added, error = _add(capsys, walks, "-o", tmp_path / "s")
    assert (code, added["runs"], added["left_out"]) == (3, 3, 2)
    assert "broken.h5" in error
    assert "run-000007.journal: it is damaged" in error
    assert len(error.splitlines()) == 2


def test_logs_and_loggers(tmp_path, capsys):
    log = tmp_path / "logs" / "drive.csv"
    log.parent.mkdir()
    rows = [
        f"{1790000000 + 4 * k},{52.5 + k * 5e-5:.6f},13.4,262,1,801,5,{-60 - k % 5}"
        for k in range(40)
    ]
    log.write_text("time,lat,lon,mcc,mnc,area,cid,level\n" + "\n".join(rows) + "\n")
    code, added, _ = _add(capsys, log.parent, "-o", tmp_path / "s", "--logger", "blue")
    assert (code, added["runs"], added["cells"]) == (0, 1, 1)
    (run,) = Survey.open(tmp_path / "s").runs.values()
    assert (run.logger, run.name, run.n_readings) == ("blue", "drive.csv", 40)
    code, added, _ = _add(capsys, log, "-o", tmp_path / "s")
    assert (code, added["files"][0]["is_known"]) == (0, True)


def test_duckdb_reads_the_dataset(walks, tmp_path, capsys):
    _add(capsys, walks, "-o", tmp_path / "s")
    query = (
        "SELECT area, cell, count(*), count(DISTINCT run) FROM "
        f"read_parquet('{tmp_path}/s/readings/**/*.parquet', hive_partitioning = true) "
        "GROUP BY ALL ORDER BY cell"
    )
    assert duckdb.sql(query).fetchall() == [
        ("262-01-801", name(1), 120, 3),
        ("262-01-801", name(2), 120, 3),
    ]


def test_nothing_private_is_kept(tmp_path, capsys):
    from logger.core.runfile import RunWriter
    from logger.core.types import Fix, Note, RawBytes, Record, Scan
    from tests.kit.runs import meta

    walk = tmp_path / "run-000001.journal"
    config = '[modem]\nport = "/dev/serial/by-id/usb-SECRETPORT-if00"\ndriver = "a7608"\n'
    writer = RunWriter(walk, meta(boot_id="secretboot", config_text=config, started_ns=77 * 10**9))
    for k in range(30):
        t_ns = (77 + k) * 10**9
        writer.append(Record(t_ns, "gnss", RawBytes(b"secretbytes")))
        fix = Fix(True, 1_790_000_000 * 10**9 + k * 10**9, 52.5 + k * 2e-5, 13.4)
        seq = writer.append(Record(t_ns, "gnss", fix))
        writer.append(Record(t_ns, "modem", Scan(t_ns, (cell(1, -60.0 - k % 3),), seq, seq)))
        writer.append(Record(t_ns, "logger", Note("info", "mark", "secretnote")))
    writer.close(107 * 10**9, "test")
    assert _add(capsys, walk, "-o", tmp_path / "s")[0] == 0
    survey = Survey.open(tmp_path / "s")
    (run,) = survey.runs.values()
    assert run.logger == run.modem
    assert len(run.modem) == 8
    table = survey.rows("262-01-801")
    assert table["t_ns"].to_pylist() == [k * 10**9 for k in range(30)]  # the ends are there
    for kept in (tmp_path / "s").rglob("*.parquet"):
        content = str(duckdb.sql(f"SELECT * FROM '{kept}'").fetchall()).lower()
        assert "secret" not in content


def test_killed_at_any_time(tmp_path):
    """SIGKILL at random moments: a survey is whole, nothing is lost or twice."""
    folder = tmp_path / "walks"
    folder.mkdir()
    files = [
        write_walk(folder, n, two_cells(-50.0 - n), n=20).with_suffix(".journal") for n in range(24)
    ]
    target, chance = tmp_path / "s", random.Random(3)
    program = (
        "import sys\nfrom postproc.survey import parquet_batch\nparquet_batch.MOST_ROWS = 80\n"
        "from postproc.cli import main\nsys.exit(main(sys.argv[1:]))"
    )
    command = [sys.executable, "-c", program, "survey", "add", *map(str, files), "-o", str(target)]
    seen = 0
    for _ in range(KILLS):
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL) as process:
            deadline = time.monotonic() + 60.0
            while not (target / "runs").exists() or len(list(target.glob("runs/*"))) <= seen:
                assert time.monotonic() < deadline
                if process.poll() is not None:
                    break
                time.sleep(0.002)
            time.sleep(chance.uniform(0.0, 0.02))
            process.send_signal(signal.SIGKILL)
        survey = Survey.open(target)
        seen = len(survey.batches)
        names = [run.name for run in survey.runs.values()]
        assert len(names) == len(set(names))
        assert sum(one.n_readings for one in survey.cells()) == 40 * len(names)
        assert len(survey.rows("262-01-801")) == 40 * len(names)
    subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    assert len(Survey.open(target).runs) == 24
    assert len(Survey.open(target).rows("262-01-801")) == 24 * 40
    assert not list(target.rglob("*.part"))


def test_full_disk_leaves_what_was_there(walks, tmp_path, monkeypatch):
    """A file size limit of this process fails the write in the middle, as a full disk does."""
    import resource

    survey = Survey.open_or_make(tmp_path / "s")
    files = sorted(walks.glob("*.h5"))
    list(add_files(survey, files[:1]))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, before[1]))
    try:
        with pytest.raises(RunFileError, match="what was added before is safe"):
            list(add_files(Survey.open(tmp_path / "s"), files))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert len(Survey.open(tmp_path / "s").runs) == 1
    list(add_files(Survey.open(tmp_path / "s"), files))
    assert len(Survey.open(tmp_path / "s").runs) == 3
    assert len(Survey.open(tmp_path / "s").rows("262-01-801")) == 240


def test_one_change_at_a_time(walks, tmp_path):
    survey = Survey.open_or_make(tmp_path / "s")
    with survey.exclusive(), pytest.raises(RunFileError, match="another program"):
        list(add_files(survey, sorted(walks.glob("*.h5"))))


def test_lost_file_is_noticed(walks, tmp_path, capsys):
    _add(capsys, walks, "-o", tmp_path / "s")
    next((tmp_path / "s" / "readings").rglob("*.parquet")).unlink()
    assert main(["survey", "add", str(walks), "-o", str(tmp_path / "s")]) == 2
    assert "missing or damaged: remove" in capsys.readouterr().err


def test_mistakes_are_one_line(walks, tmp_path, capsys):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "other.txt").write_text("x")
    (tmp_path / "empty").mkdir()
    for arguments, why in (
        ([walks, "-o", tmp_path / "full"], "choose an empty or a new folder"),
        ([tmp_path / "none", "-o", tmp_path / "s"], "no such file or folder"),
        ([tmp_path / "empty", "-o", tmp_path / "s"], "no run and no log"),
        ([walks, "-o", tmp_path / "s", "--logger", ""], "--logger is a name"),
    ):
        assert main(["survey", "add", *map(str, arguments)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert why in line


def test_without_the_libraries(walks, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("postproc.survey.cli.find_spec", lambda name: None)
    assert main(["survey", "add", str(walks), "-o", str(tmp_path / "s")]) == 2
    assert capsys.readouterr().err == (
        f"postproc: pyarrow is missing: {sys.executable} -m pip install 'cellwalk[survey]'\n"
    )


def test_batches_are_bounded(walks, tmp_path, monkeypatch):
    monkeypatch.setattr(parquet_batch, "MOST_ROWS", 100)
    survey = Survey.open_or_make(tmp_path / "s")
    list(add_files(survey, sorted(walks.glob("*.h5"))))
    assert Survey.open(tmp_path / "s").batches == ("000001", "000002")


def test_what_was_added_after_a_survey_was_opened_stays(walks, tmp_path):
    first, *others = sorted(walks.glob("*.h5"))
    opened = Survey.open_or_make(tmp_path / "s")
    list(add_files(Survey.open(opened.folder), others))
    (added,) = add_files(opened, [first])
    assert not added.problem
    assert len(Survey.open(opened.folder).runs) == 3
