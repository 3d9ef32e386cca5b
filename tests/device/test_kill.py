"""kill -9 at random moments; `make test-faults` repeats it 50 times."""

import os
import random
import time

import pytest

from logger.core.runfile import read_run
from logger.sim.player import NmeaPlayer, TranscriptModem
from logger.sim.ptys import PtyDevice, answering
from postproc.cli import main as postproc
from tests.kit import service

KILLS = int(os.environ.get("CELLWALK_KILLS", "4"))


@pytest.mark.parametrize("seed", range(KILLS))
def test_kill_9_loses_at_most_two_seconds(tmp_path, seed, capsys):
    player = NmeaPlayer(service.epochs(10_000, rate_hz=10), bytes_per_s=1500)
    with PtyDevice(player) as gnss, PtyDevice(answering(TranscriptModem([service.CENG] * 100_000))) as port:
        config = service.site_toml(tmp_path, port.path, gnss.path)
        with service.running(config) as logger:
            service.wait_for(lambda: any(p.stat().st_size for p in (tmp_path / "runs").glob("*.journal")))
            time.sleep(random.Random(seed).uniform(1.5, 4.5))
            killed_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
            logger.kill()
            logger.communicate()
        (journal,) = (tmp_path / "runs").glob("*.journal")
        run = read_run(journal)
        lost_s = (killed_ns - int(run.tables["raw"]["t_ns"].max())) / 1e9
        assert run.end is None
        assert run.damage.missing_frames == 0
        assert lost_s < 2.0
        assert postproc(["info", str(journal)]) == 0
        assert postproc(["smooth", str(journal), "--json"]) == 0
        capsys.readouterr()
        # the next start makes the HDF5 of the run that was cut
        with service.running(config, "--duration", "1") as again:
            assert again.communicate(timeout=60)[0]
    runs = [read_run(p) for p in (tmp_path / "runs").glob("run-*.h5") if ".post" not in p.name]
    assert sorted(run.end is None for run in runs) == [False, True]
    print(f"lost {lost_s:.2f} s")
