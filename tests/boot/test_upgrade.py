"""The package is upgraded in the middle of a walk, and removed, under a real systemd."""

import time

import pytest

from logger.core.runfile import read_run, sealing_of
from logger.sim.scenario import scenario
from tests.boot.machines import BOARD, BOOT_S, REPOSITORY, RUNS, machine, rig, wait_recording
from tests.boot.players import carry
from tests.systemd.packages import with_version

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")]


@pytest.fixture(scope="module")
def runs(installed_card, workplace):
    """Runs of a walk during which the package was upgraded and then removed."""
    folder = workplace / "upgrade"
    folder.mkdir()
    arch = rig.BOARDS[BOARD]["arch"]
    (package,) = (REPOSITORY / "dist").glob(f"fieldlogger_*_{arch}.deb")
    newer = with_version(package, "9.0.0", folder)
    card = installed_card.copy(folder / "card.raw")
    with machine(card, folder / "machine", share=folder) as m, carry(m, scenario()):
        m.boot(BOOT_S)
        wait_recording(m, more_fixes=20)
        begun_s = time.monotonic()
        print(m.run(f"dpkg -i /mnt/host/{newer.name}", timeout=300))
        print(f"upgraded in {time.monotonic() - begun_s:.0f} s")
        assert m.run("dpkg-query -W -f '${Version}' fieldlogger") == "9.0.0"
        wait_recording(m, more_fixes=20)
        assert m.run("systemctl is-active fieldlogger") == "active"
        assert m.run("systemctl show -P NRestarts fieldlogger") == "0"
        print(m.run("dpkg -r fieldlogger", timeout=300))
        assert m.run("systemctl is-active fieldlogger", check=False) == "inactive"
        # it was running, but nobody has asked for it to run again
        m.run(f"dpkg -i /mnt/host/{newer.name}", timeout=300)
        assert m.run("systemctl is-active fieldlogger", check=False) == "inactive"
        assert m.run("systemctl is-enabled fieldlogger") == "enabled"
        assert "the runs remain" in m.run("dpkg -P fieldlogger", timeout=300)
        m.poweroff(BOOT_S)
    return card.pull(RUNS, folder / "fetched")


@pytest.mark.parametrize("number", [1, 2])
def test_each_run_is_sealed_and_whole(runs, number):
    run = read_run(runs / f"run-{number:06d}.h5")
    assert run.end is not None
    assert sealing_of(run.path).holds
    assert not run.damage.missing_frames
    assert len(run.tables["fixes"]) >= 20


def test_the_next_run_follows_soon(runs):
    """The times of both runs count from the same boot."""
    before, after = (read_run(runs / f"run-{number:06d}.h5").tables["raw"] for number in (1, 2))
    gap_s = (after["t_ns"].min() - before["t_ns"].max()) / 1e9
    print(f"nothing recorded for {gap_s:.1f} s")
    assert 0.0 < gap_s < 300.0
