"""A program that adds walks is killed: what was added stays, once; the rest is added later."""

import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

from logger.baseline_file import BaselineFile
from logger.baseline_store import BaselineStore
from tests.kit.card_trace import read_trace
from tests.kit.faulty_card import Card, build_preload_library
from tests.postproc.baseline.test_store import contents
from tests.postproc.baseline.walks import two_cells, write_walk

KILLS = int(os.environ.get("CELLWALK_BASELINE_KILLS", "5"))
ROOT = Path(__file__).parents[3]
N_WALKS = 2000
ADDER = """
import sys
from pathlib import Path
from logger.baseline_store import BaselineStore
from tests.postproc.baseline.test_kill import synthetic_walk

with BaselineStore(Path(sys.argv[1]), create=True) as store:
    print("ready", flush=True)
    for number in range(int(sys.argv[2])):
        store.add(synthetic_walk(number))
        print(number, flush=True)
"""


def synthetic_walk(number):
    """A walk of 40 squares and 10 cells, of which others share most."""
    from logger.baseline_store import HeardRow, WalkSummary

    cells = {f"262-01-1-{number % 7 + k}": "GSM" for k in range(10)}
    heard = [
        HeardRow(square, cell, 3, -60.0 - number % 9, -18_000 - number, 108_000_000)
        for square in range(number % 20, number % 20 + 40)
        for cell in cells
    ]
    visits = [(square, "GSM") for square in range(number % 20, number % 20 + 40)]
    channels = [(cell, 20 + number % 3, k) for k, cell in enumerate(cells)]
    run_id = f"{number:032x}"
    return WalkSummary(
        run_id * 2, run_id, f"{number}.h5", None, 1200, cells, heard, visits, channels
    )


def test_killed_while_it_writes(tmp_path):
    """Kills at any moment of many short transactions."""
    path, chance = tmp_path / "baseline.db", random.Random(5)
    reported, n_restored = 0, 0
    for _ in range(KILLS):
        with subprocess.Popen(
            [sys.executable, "-c", ADDER, str(path), str(N_WALKS)],
            stdout=subprocess.PIPE,
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            text=True,
        ) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            time.sleep(chance.uniform(0.0, 0.5))
            process.send_signal(signal.SIGKILL)
            done = [int(line) for line in process.stdout.read().splitlines() if line]
        reported = max([reported, *(number + 1 for number in done)])
        n_restored += Path(f"{path}-journal").exists()
        with BaselineStore(path) as store:
            walks = store.walks()
        # each number once and in order: what was reported, and perhaps the one that was not
        assert [walk.name for walk in walks] == [f"{i}.h5" for i in range(len(walks))]
        assert reported <= len(walks) <= reported + 1
        _check_sums(path, tmp_path)
    assert reported > KILLS
    print(f"{KILLS} kills, {len(walks)} walks, {n_restored} times a change was rolled back")


def test_killed_command_is_run_again(tmp_path):
    """The command itself with runs: killed, run again, and equal to one that was never killed."""
    runs = [
        write_walk(tmp_path, n, two_cells(-50.0 - n), n=30).with_suffix(".journal")
        for n in range(12)
    ]
    command = [sys.executable, "-m", "postproc.cli", "baseline", "add", *map(str, runs), "-b"]
    card = Card(tmp_path, build_preload_library(tmp_path))
    whole = card.folder / "whole.db"
    traced = card.environment(trace=True)
    subprocess.run([*command, str(whole)], check=True, cwd=ROOT, env=traced)
    n_operations = len(read_trace(card.trace))
    for share in (0.3, 0.9):
        path = card.folder / f"{share}.db"
        killed = card.environment(kill_at=int(share * n_operations))
        ended = subprocess.run([*command, str(path)], check=False, cwd=ROOT, env=killed)
        assert ended.returncode == -signal.SIGKILL
        with BaselineStore(path) as store:
            assert 0 < len(store.walks()) < len(runs)
        subprocess.run([*command, str(path)], check=True, cwd=ROOT)
        assert contents(path) == contents(whole)
        with closing(BaselineFile(path)) as one, closing(BaselineFile(whole)) as other:
            assert one.fingerprint == other.fingerprint


def _check_sums(path, folder):
    """The file is sound, and its sums are those of its walks."""
    with closing(sqlite3.connect(path)) as db:
        assert db.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        n = db.execute("SELECT count(*) FROM walk").fetchone()[0]
    expected = folder / "expected.db"
    with BaselineStore(expected, create=True) as store:
        for number in range(len(store.walks()), n):
            store.add(synthetic_walk(number))
    assert contents(path) == contents(expected)
