"""Power cuts at any recorded write of one boot: in order, reordered, torn.

Each is pulled and recovered.
"""

import os
import random
import re
import shutil
import threading
import time
from bisect import bisect_left
from pathlib import Path

import pytest

from logger.core.runfile import Run, read_run, recover, sealing_of
from logger.sim.scenario import scenario
from tests.boot.machines import BOARD, BOOT_S, RUNS, boottime_zero_s, machine, rig, wait_recording
from tests.boot.players import carry

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")]

CUTS = int(os.environ.get("CELLWALK_CUTS", "30"))
SECTOR = 512
WALK_S = 60
DROP_IN = """\
[Service]
ExecStart=
ExecStart=/usr/bin/python3 /opt/acknowledging.py run --config /etc/cellwalk/site.toml
Environment=PYTHONPATH=/usr/lib/fieldlogger
StandardOutput=journal+console
"""


class Watch(threading.Thread):
    """Length of the log of writes over time, and the acknowledgements of the guest.

    An acknowledgement is stored with the length of the log after it was received: a cut there or
    later must keep the record.
    """

    def __init__(self, m):
        super().__init__(daemon=True)
        self._m = m
        self._ended = threading.Event()
        self.acknowledged: list[tuple[int, str, int]] = []
        self.lengths: list[int] = []
        self.times_s: list[float] = []

    def run(self):
        while not self._ended.wait(0.01):
            said = re.findall(r"synced (run-\d+) (\d+)\n", self._m.console())
            length = self._m.log.path.stat().st_size
            self.lengths.append(length)
            self.times_s.append(time.monotonic())
            self.acknowledged += [
                (length, run, int(n)) for run, n in said[len(self.acknowledged) :]
            ]

    def stop(self):
        self._ended.set()
        self.join()

    def due(self, length: int) -> dict[str, int]:
        """Records of each run that a card must contain after a cut at this length of the log."""
        return {run: n for at, run, n in self.acknowledged if at <= length}

    def latest_s(self, length: int) -> float:
        """Time at which the log certainly had this length; shorter cuts happened before it."""
        return self.times_s[min(bisect_left(self.lengths, length), len(self.times_s) - 1)]


class Cuts:
    """The log of writes, and cuts of it: each makes a card and gives two lengths of the log.

    Everything before the first is on the card; what made the log as long as the second is not, or
    not all of it."""

    def __init__(self, log):
        self._log = log
        entries = list(log.entries())
        self.writes = [(offset, length, at) for _, offset, length, at in entries if length]
        self.flushes = [at for flags, _, _, at in entries if flags & rig.WriteLog.FLUSH]

    def in_order(self, card, n):
        self._log.apply(card, writes=n)
        ends = [at + length for _, length, at in self.writes[n - 1 : n + 1]]
        return ends[0], ends[-1]

    def torn(self, card, n, seed):
        """A cut that keeps only the first sectors of the last write."""
        lengths = self.in_order(card, n)
        offset, length, at = self.writes[n]
        kept = SECTOR * random.Random(seed).randrange(length // SECTOR)
        with self._log.path.open("rb") as log, card.path.open("r+b") as disk:
            log.seek(at)
            disk.seek(offset)
            disk.write(log.read(kept))
        return lengths

    def reorder(self, card, n, seed):
        self._log.apply(card, flushes=n, seed=seed)
        return self.flushes[n - 1], self.flushes[n]

    def at_random(self, card, seed, first, last):
        """A random cut between two lengths of the log."""
        chance = random.Random(seed)
        kind = ("in order", "reordered", "torn")[seed % 3]
        if kind == "reordered":
            n = chance.choice(
                [i for i, at in enumerate(self.flushes[:-1], 1) if first <= at < last]
            )
            return kind, *self.reorder(card, n, seed)
        n = chance.choice(
            [i for i, (_, _, at) in enumerate(self.writes[:-1], 1) if first <= at < last]
        )
        return kind, *(self.in_order(card, n) if kind == "in order" else self.torn(card, n, seed))


class Recorded:
    """One boot with two runs, cut at its end.

    `before` is the card before the boot, `whole` contains everything that was written.
    """

    def __init__(self, installed_card, folder):
        card = installed_card.copy(folder / "cuts.raw")
        tree = folder / "tree"
        drop_in = tree / "etc/systemd/system/fieldlogger.service.d"
        drop_in.mkdir(parents=True)
        (drop_in / "acknowledging.conf").write_text(DROP_IN)
        (tree / "opt").mkdir()
        shutil.copy(Path(__file__).with_name("acknowledging.py"), tree / "opt")
        card.push(tree)
        self.before = card.copy(folder / "before.raw")
        with machine(card, folder / "cuts") as m, carry(m, scenario()):
            m.boot(BOOT_S, wait=False)
            self.watch = Watch(m)
            self.watch.start()
            m.run("systemctl is-system-running --wait", timeout=BOOT_S, check=False)
            wait_recording(m, more_fixes=WALK_S)
            self.zero_s = boottime_zero_s(m)
            m.run("systemctl restart fieldlogger", timeout=180)
            wait_recording(m, more_fixes=WALK_S // 2)
            self.watch.stop()
            m.cut_power("issued")
        self.cuts = Cuts(m.log)
        self.whole = {
            path.stem: texts_of(read_run(path))
            for path in card.pull(RUNS, folder / "whole").glob("*.journal")
        }


def texts_of(run: Run) -> dict[int, tuple[int, str, str]]:
    """Time, source and text of each record, by its number."""
    return {seq: (record.t_ns, record.source, repr(record)) for seq, record in run.records()}


@pytest.fixture(scope="module")
def recorded_card(installed_card, workplace):
    return Recorded(installed_card, workplace)


def lost_s(folder: Path, whole, due: dict[str, int], until_ns: float) -> float:
    """Recover and check a cut card; age in seconds of the oldest received record that is missing.

    Computed records (source "live") do not count, since they can be computed again.
    """
    for one in recover(folder):
        assert not one.error or one.journal.stem not in due, one.error
    oldest_ns = until_ns
    for name, n_due in due.items():
        run = read_run(folder / f"{name}.h5")
        found, all_there = texts_of(run), whole[name]
        assert [seq for seq in range(n_due) if found.get(seq) != all_there[seq]] == [], (
            "acknowledged and lost"
        )
        assert found.keys() <= all_there.keys(), "never recorded"
        assert sealing_of(run.path).broken_at is None or run.damage.missing_frames
        missing_ns = [
            t_ns
            for seq, (t_ns, source, _) in all_there.items()
            if source != "live" and seq not in found
        ]
        oldest_ns = min([oldest_ns, *missing_ns])
    return (until_ns - oldest_ns) / 1e9


def test_what_a_cut_card_holds(recorded_card, workplace):
    watch, cuts = recorded_card.watch, recorded_card.cuts
    first, last = watch.acknowledged[0][0], watch.acknowledged[-1][0]
    worst_s, failures, begun_s = {}, [], time.monotonic()
    for seed in range(CUTS):
        card = recorded_card.before.copy(workplace / "cut.raw")
        kind, length, until = cuts.at_random(card, seed, first, last)
        until_ns = (watch.latest_s(until) - recorded_card.zero_s) * 1e9
        try:
            folder = card.pull(RUNS, workplace / "cut")
            loss_s = lost_s(folder, recorded_card.whole, watch.due(length), until_ns)
        except Exception as failure:  # noqa: BLE001
            failures.append(f"cut {seed}, {kind}: {failure!r}"[:300])
        else:
            worst_s[kind] = max(loss_s, worst_s.get(kind, 0.0))
    print(
        f"{BOARD}: {len(cuts.writes)} writes, {len(cuts.flushes)} flushes, "
        f"{len(watch.acknowledged)} syncs, "
        f"{max(n for _, _, n in watch.acknowledged)} records; {CUTS - len(failures)} of {CUTS} "
        f"cuts recovered in "
        f"{time.monotonic() - begun_s:.0f} s, "
        f"lost at most {', '.join(f'{s:.2f} s {kind}' for kind, s in worst_s.items())}"
    )
    assert failures == []
    assert max(worst_s.values()) <= 2.0
