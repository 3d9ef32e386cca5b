"""kill -9 at random moments: of the whole service, and of many recorders at once (`make
test-faults`: 1000).
"""

import os
import random
import time

import pytest

from logger.core.errors import RunFileError
from logger.core.runfile import read_run
from logger.device.recorder import TICK_S
from logger.sim.ptys import PtyDevice, answering
from postproc.cli import main as postproc
from tests.kit import service
from tests.kit.killed_recorders import kill_recorders
from tests.kit.recorded_replies import NmeaPlayer, TranscriptModem

KILLS = int(os.environ.get("CELLWALK_KILLS", "4"))


def test_what_may_be_lost_is_what_comes_between_two_flushes():
    """What comes in a second; how long a flush takes is the card's matter, and printed below."""
    assert TICK_S == 1.0


def _rows(folder):
    """Records that the journal holds at this moment."""
    try:
        return max(
            (len(read_run(path).tables["raw"]) for path in folder.glob("*.journal")), default=0
        )
    except RunFileError:  # begun, and no more
        return 0


@pytest.mark.parametrize("seed", range(KILLS))
def test_kill_9_loses_nothing_that_was_written(tmp_path, seed, capsys):
    player = NmeaPlayer(service.nmea_epochs(10_000, rate_hz=10), bytes_per_s=1500)
    with (
        PtyDevice(player) as gnss,
        PtyDevice(answering(TranscriptModem([service.CENG] * 100_000))) as port,
    ):
        config = service.site_toml(tmp_path, port.path, gnss.path)
        with service.running_service(config) as logger:
            service.wait_for(lambda: _rows(tmp_path / "runs"))
            time.sleep(random.Random(seed).uniform(0.0, 3.0))
            seen = _rows(tmp_path / "runs")
            killed_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
            logger.kill()
            logger.communicate()
        (journal,) = (tmp_path / "runs").glob("*.journal")
        run = read_run(journal)
        lost_s = (killed_ns - int(run.tables["raw"]["t_ns"].max())) / 1e9
        assert run.end is None
        assert run.damage.missing_frames == 0
        assert len(run.tables["raw"]) >= seen
        assert postproc(["info", str(journal)]) == 0
        assert postproc(["smooth", str(journal), "--json"]) == 0
        capsys.readouterr()
        # the next start makes the HDF5 of the run that was cut
        with service.running_service(config, "--duration", "1") as again:
            assert again.communicate(timeout=service.LIMIT_S)[0]
    runs = [read_run(p) for p in (tmp_path / "runs").glob("run-*.h5") if ".post" not in p.name]
    assert sorted(run.end is None for run in runs) == [False, True]
    print(f"lost {lost_s:.2f} s")


@pytest.mark.parametrize("kills", [16, pytest.param(1000, marks=pytest.mark.slow)])
def test_kill_9_of_recorders_loses_nothing_acknowledged(tmp_path, kills):
    """Nothing that was synced is lost; what was received since the last sync is."""
    lost_s, begun = [], 0
    for killed in kill_recorders(tmp_path, kills):
        if not killed.n_durable and not (killed.journal.exists() and killed.journal.stat().st_size):
            continue  # killed before its first write
        begun += 1
        run = read_run(killed.journal)
        mine = run.tables["raw"][run.tables["raw"]["source"] == b"count"]
        counts = [
            int.from_bytes(run.raw_bytes[at : at + 8].tobytes(), "little") for at in mine["offset"]
        ]
        assert counts == list(range(len(counts)))
        assert len(run.tables["raw"]) >= killed.n_durable
        assert not run.damage.missing_frames
        if killed.n_durable:
            lost_s.append((killed.killed_ns - int(mine["t_ns"][-1])) / 1e9)
    print(
        f"{begun} of {begun} journals readable, none acknowledged lost, "
        f"last {max(lost_s):.2f} s not recorded"
    )
    assert begun >= 0.9 * kills - 1
