"""The device's own baseline: it follows the runs of its folder, whatever ends the program."""

import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace

import pytest

from logger import own_baseline
from logger.baseline_file import OWN_FILE, BaselineFile, configured_file
from logger.core.baseline import baseline_of, has_whole_baseline, square_of
from logger.core.errors import ConfigError
from logger.core.live_settings import LiveSettings
from logger.core.runfile import RunWriter, convert_journal, read_sound_run
from logger.core.suspicion.words import FINDING_CODE
from logger.core.types import Fix, Note, Record, Scan
from logger.device.estimator import Estimator
from logger.device.link import Inbox
from postproc.replay import replay
from postproc.suspicion.run_assessment import assess_runs
from tests.kit.runs import meta
from tests.kit.service import LIMIT_S
from tests.postproc.baseline.test_store import contents
from tests.postproc.baseline.walks import STEP_DEG, cell, name, two_cells

DAY_S = 86_400
LAT_DEG, LON_DEG = 52.5, 13.4
SQUARE = square_of(LAT_DEG, LON_DEG)
RULES = Note("info", "rules", "version 0: none")


def write_run(folder, number, readings_at=None, *, day=0, n=40, notes=(RULES,), origin="walk"):
    """A finished run of `n` scans northwards on a day."""
    journal = folder / f"run-{number:06d}.journal"
    writer = RunWriter(journal, meta(run_id=f"{number:032x}", origin=origin))
    for note in notes:
        writer.append(Record(0, "live", note))
    readings_at = readings_at or two_cells()
    for k in range(n):
        t_ns = k * 2 * 10**9
        utc_ns = (1_790_000_000 + day * DAY_S + 60 * number) * 10**9 + t_ns
        fix = Fix(True, utc_ns, LAT_DEG + k * STEP_DEG, LON_DEG, acc_m=5.0)
        seq = writer.append(Record(t_ns, "gnss", fix))
        writer.append(Record(t_ns + 10**8, "modem", Scan(t_ns, tuple(readings_at(k)), seq, seq)))
    writer.close(n * 2 * 10**9, "test")
    convert_journal(journal, journal.with_suffix(".h5"))
    return journal.with_suffix(".h5")


def learn(folder, **options):
    return dict(own_baseline.learn(folder, **options))


def walks_here(folder):
    with closing(BaselineFile(folder / OWN_FILE)) as baseline:
        return baseline.square(SQUARE)


def finding_note(cell_name, word):
    return Note("info", FINDING_CODE, f"{cell_name}: {word}, 4.0 nats: P1 of nowhere")


def test_a_day_and_a_square_count_once(tmp_path):
    for number, day in enumerate((0, 0, 0, 1), 1):
        write_run(tmp_path, number, day=day)
    assert set(learn(tmp_path).values()) == {"learnt"}
    here = walks_here(tmp_path)
    assert dict(here.n_walks) == {"GSM": 2}
    assert here.cells[name(1)].n_walks == 2
    assert learn(tmp_path) == {}


def test_a_cell_that_only_the_second_walk_of_a_day_heard_is_learnt(tmp_path):
    write_run(tmp_path, 1)
    write_run(tmp_path, 2, lambda k: (*two_cells()(k), cell(3, -70.0)))
    learn(tmp_path)
    here = walks_here(tmp_path)
    assert dict(here.n_walks) == {"GSM": 1}
    assert set(here.cells) == {name(1), name(2), name(3)}


@pytest.mark.parametrize("word", ["unusual", "suspicious"])
def test_a_cell_that_ever_was_conspicuous_is_learnt_only_once_it_is_trusted(tmp_path, word):
    write_run(tmp_path, 1, notes=(RULES, finding_note(name(2), word)))
    write_run(tmp_path, 2, day=1)
    learn(tmp_path)
    assert set(walks_here(tmp_path).cells) == {name(1)}
    with closing(BaselineFile(tmp_path / OWN_FILE)) as baseline:
        assert (baseline.is_doubted(name(1)), baseline.is_doubted(name(2))) == (False, True)
    own_baseline.trust(tmp_path, name(2), "my femtocell")
    write_run(tmp_path, 3, day=2)
    assert learn(tmp_path) == {"run-000003": "learnt"}
    assert walks_here(tmp_path).cells[name(2)].n_walks == 1


def test_without_a_whole_live_estimate_the_words_are_found_now(tmp_path):
    """A network that nobody has, heard again and again at one place."""
    home = [cell(cid, -80.0 - cid, channel=20 + cid) for cid in range(1, 7)]
    foreign = replace(cell(7, -60.0, lac=1201), mcc="310", mnc="260")
    path = write_run(tmp_path, 1, lambda _: [*home, foreign], notes=())
    doubted = own_baseline.conspicuous_cells(read_sound_run(path))
    assert doubted == {"310-260-1201-7"}
    learn(tmp_path)
    assert not doubted & set(walks_here(tmp_path).cells)


def test_runs_that_are_gone_take_what_they_taught(tmp_path):
    first, second = write_run(tmp_path, 1), write_run(tmp_path, 2)
    third = write_run(tmp_path, 3, day=1)
    learn(tmp_path)
    first.unlink()
    assert learn(tmp_path) == {
        "run-000001": "removed, as the run is",
        "run-000002": "learnt",  # it had counted with the other of its day
    }
    assert dict(walks_here(tmp_path).n_walks) == {"GSM": 2}
    second.unlink()
    third.unlink()
    learn(tmp_path, adds=False)
    assert not walks_here(tmp_path).n_walks


def test_forgotten_runs_teach_nothing_again(tmp_path):
    for number in (1, 2):
        write_run(tmp_path, number, lambda k, n=number: [cell(n, -60.0)], day=number)
    learn(tmp_path)
    own_baseline.trust(tmp_path, name(9), "a friend")
    assert own_baseline.forget(tmp_path, "run-000001") == 1
    assert learn(tmp_path) == {}
    assert set(walks_here(tmp_path).cells) == {name(2)}
    assert name(1).encode() not in (tmp_path / OWN_FILE).read_bytes()
    assert own_baseline.forget(tmp_path, "all") == 2
    assert learn(tmp_path) == {}
    for gone in (name(2), name(9)):
        assert gone.encode() not in (tmp_path / OWN_FILE).read_bytes()
    for wrong in ("run-000077", "../x", "1"):
        with pytest.raises(ConfigError):
            own_baseline.forget(tmp_path, wrong)


def test_what_is_no_walk_of_the_device_teaches_nothing(tmp_path):
    write_run(tmp_path, 1, origin="simulated walk block")
    (tmp_path / "run-000002.h5").write_bytes(b"no run")
    learnt = learn(tmp_path)
    assert learnt["run-000001"].startswith("not learnt: it is no walk of this device")
    assert learnt["run-000002"].startswith("not learnt: ")
    assert learn(tmp_path) == {}


def test_the_oldest_walks_give_way(tmp_path, monkeypatch):
    for number in range(1, 5):
        write_run(tmp_path, number, lambda k, n=number: [cell(n * 100 + k, -60.0)], day=number)
    monkeypatch.setattr(own_baseline, "MOST_BYTES", 100_000)
    learn(tmp_path)
    assert (tmp_path / OWN_FILE).stat().st_size <= 110_000
    with closing(BaselineFile(tmp_path / OWN_FILE)) as baseline:
        assert 0 < baseline.n_walks < 4
    assert learn(tmp_path) == {}


def test_a_damaged_file_is_made_anew(tmp_path):
    write_run(tmp_path, 1)
    (tmp_path / OWN_FILE).write_bytes(b"damaged" * 999)
    assert learn(tmp_path) == {"run-000001": "learnt"}
    assert walks_here(tmp_path).cells


def test_killed_at_any_moment_the_file_is_whole_and_the_rest_follows(tmp_path):
    folder, whole = tmp_path / "runs", tmp_path / "whole"
    for path in (folder, whole):
        path.mkdir()
        for number in range(1, 7):
            write_run(path, number, day=number, n=20)
    learn(whole)
    site = tmp_path / "site.toml"
    site.write_text(
        f'[run]\ndirectory = "{folder}"\n[modem]\nport = "/m"\n[gnss]\nport = "/g"\n'
        '[live]\nbaseline = "own"\n'
    )
    command = [sys.executable, "-m", "logger.cli", "learn", "--config", str(site)]
    code = "from logger import own_baseline; own_baseline._AT_ONCE = 1; from logger.cli import main"
    slow = [sys.executable, "-c", f"{code}; main()", *command[3:]]
    chance = random.Random(7)
    for _ in range(int(os.environ.get("CELLWALK_BASELINE_KILLS", "4"))):
        with subprocess.Popen(slow, stdout=subprocess.DEVNULL) as process:
            time.sleep(chance.uniform(0.2, 2.0))
            process.send_signal(signal.SIGKILL)
        if (folder / OWN_FILE).exists():
            with closing(sqlite3.connect(folder / OWN_FILE)) as database:
                assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
            BaselineFile(folder / OWN_FILE).close()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    assert contents(folder / OWN_FILE) == contents(whole / OWN_FILE)
    assert sorted(path.name for path in folder.iterdir() if path.suffix != ".journal") == [
        OWN_FILE,
        *(f"run-{number:06d}.h5" for number in range(1, 7)),
    ]


def test_a_recorder_goes_on_with_what_it_has_opened(tmp_path):
    write_run(tmp_path, 1)
    learn(tmp_path)
    with closing(BaselineFile(tmp_path / OWN_FILE)) as opened:
        write_run(tmp_path, 2, lambda k: [cell(5, -60.0)], day=1)
        learn(tmp_path)
        assert set(opened.square(SQUARE).cells) == {name(1), name(2)}
    assert name(5) in walks_here(tmp_path).cells


def test_replay_and_desk_know_what_the_run_used(tmp_path):
    """Eight walks, then one with a new cell: its word is repeated without the file."""
    for number in range(1, 9):
        write_run(tmp_path, number, day=number)
    learn(tmp_path)
    settings, inbox = LiveSettings(baseline="own"), Inbox()
    records = _walk_with_a_new_cell()
    estimator = Estimator.of(settings, inbox, tmp_path)
    estimator.start()
    journal = tmp_path / "run-000009.journal"
    writer = RunWriter(journal, meta(run_id="9" * 32, origin="walk", live=settings))
    for record in records:
        estimator.give(writer.append(record), record)
    assert estimator.finish(LIMIT_S)
    while (record := inbox.get(0.0)) is not None:
        writer.append(record)
    writer.close(10**12, "test")
    run = read_sound_run(journal)
    (tmp_path / OWN_FILE).unlink()
    assert has_whole_baseline(run)
    assert baseline_of(run).n_walks == 8
    repeated = replay(run)
    assert repeated.n_findings > 1
    assert repeated.equal, repeated.text
    desk = {one.cell: one for one in assess_runs([run]).cells}
    assert "B1" in {finding.rule.id for finding in desk[name(50)].findings}


def _walk_with_a_new_cell():
    records = []
    for k in range(40):
        t_ns = k * 2 * 10**9
        utc_ns = (1_790_000_000 + 20 * DAY_S) * 10**9 + t_ns
        fix = Fix(True, utc_ns, LAT_DEG + k * STEP_DEG, LON_DEG, acc_m=5.0)
        readings = (*two_cells()(k), cell(50, -62.0, channel=29))
        records += [
            Record(t_ns, "gnss", fix),
            Record(t_ns + 10**8, "modem", Scan(t_ns, readings, 2 * k, 2 * k)),
        ]
    return records


def test_names_of_the_setting(tmp_path):
    assert configured_file("own", tmp_path) is None
    (tmp_path / OWN_FILE).touch()
    assert configured_file("own", tmp_path) == tmp_path / OWN_FILE
    assert configured_file("off", tmp_path) is None
    assert configured_file("", tmp_path) is None
