"""The read-only root and the stop button, exactly as systemd/README.md describes them."""

import pytest

from logger.core.runfile import read_run, sealing_of
from logger.sim.scenario import scenario
from tests.boot.machines import BOARD, BOOT_S, RUNS, image_folder, machine, rig, wait_recording
from tests.boot.overlay import kernel_with_overlay
from tests.boot.partitions import LINUX, MIB, copy_blocks, make_ext4, partition, table
from tests.boot.players import carry

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")]

RUNS_MIB = 256
MOUNTED_BYTES = 8192
"""Superblocks of the root and of its journal, which ext4 writes even when it mounts read-only."""


class Parted:
    """A card with two partitions, root and runs, as the page describes it."""

    def __init__(self, installed_card, folder):
        folder.mkdir()
        root = installed_card.copy(folder / "root.raw")
        self.kernel = kernel_with_overlay(root, folder)
        root.push(_as_the_page_says(root, folder / "tree"))
        self._folder = folder
        self._root_mib = root.path.stat().st_size // MIB
        self.runs_at = (1 + self._root_mib) * MIB
        self.card = rig.Card(folder / "parted.raw")
        with self.card.path.open("wb") as file:
            file.write(table((LINUX, 1, self._root_mib), (LINUX, 1 + self._root_mib, RUNS_MIB)))
            file.truncate(self.runs_at + RUNS_MIB * MIB)
        copy_blocks(root.path, self.card.path, seek=1)
        make_ext4(self.card.path, self.runs_at // MIB, RUNS_MIB)
        root.path.unlink()

    def runs(self):
        """The current content of the folder of the runs."""
        alone = rig.Card(self._folder / "runs.raw")
        copy_blocks(self.card.path, alone.path, skip=1 + self._root_mib)
        alone.pull("/", self._folder / "fetched")
        return self._folder / "fetched"


def _as_the_page_says(root, tree):
    (tree / "etc/systemd/journald.conf.d").mkdir(parents=True)
    fstab = root.pull("/etc/fstab", tree / "etc")
    fstab.write_text(f"{fstab.read_text()}{partition(2)} {RUNS} ext4 noatime,nofail 0 2\n")
    (tree / "etc/systemd/journald.conf.d/volatile.conf").write_text("[Journal]\nStorage=volatile\n")
    return tree


def _written_bytes(m, before):
    """Number of bytes written to the disk before an offset."""
    return sum(length for _, offset, length, _ in m.log.entries() if offset < before)


def _boot(m, overlay):
    m.boot(BOOT_S, append=f"root={partition(1)} overlayroot={overlay}")


def test_a_root_that_is_never_written(installed_card, workplace, capsys):
    packages = (image_folder() / f"packages-{rig.BOARDS[BOARD]['arch']}.txt").read_text()
    if not {"overlayroot", "busybox"} <= set(packages.split()):
        pytest.skip(
            "the rig's image is without overlayroot, which Raspberry Pi OS takes, and busybox; "
            "remove base-*.raw"
        )
    folder = workplace / "read-only"
    parted = Parted(installed_card, folder)
    in_memory = "journalctl -b -u fieldlogger | grep 'stored in memory'"
    with (
        machine(parted.card, folder / "machine", kernel=parted.kernel) as m,
        carry(m, scenario()),
    ):
        # as raspi-config leaves it: every partition of fstab is overlaid
        _boot(m, "tmpfs")
        assert "overlay" in m.run(f"stat -fc %T / {RUNS}; {in_memory}")
        m.poweroff(BOOT_S)
        assert not list(parted.runs().glob("run-*"))

        _boot(m, "tmpfs:recurse=0")
        assert m.run(f"stat -fc %T / {RUNS}").split() == ["overlayfs", "ext2/ext3"]
        assert m.run(in_memory, check=False) == ""
        wait_recording(m, more_fixes=20)
        m.run("touch /etc/written && sync")
        m.cut_power("issued")
        assert _written_bytes(m, parted.runs_at) <= MOUNTED_BYTES

        _boot(m, "tmpfs:recurse=0")
        assert m.run("ls /etc/written", check=False).endswith("No such file or directory")
        wait_recording(m, more_fixes=10)
        m.run("until ! systemctl -q is-active fieldlogger-recover; do sleep 1; done", timeout=120)
        m.qmp("system_powerdown")  # the power key, as which a Pi's kernel reports the button
        m.proc.wait(BOOT_S)
        m.cut_power("issued")
        assert _written_bytes(m, parted.runs_at) <= MOUNTED_BYTES

    runs = parted.runs()
    cut, stopped = (read_run(runs / f"run-{number:06d}.h5") for number in (1, 2))
    with capsys.disabled():
        print(
            f"\ncut: {len(cut.tables['fixes'])} fixes; by the button: "
            f"{len(stopped.tables['fixes'])}, {stopped.end}"
        )
    assert cut.end is None
    assert not cut.damage.missing_frames
    assert stopped.end is not None
    assert sealing_of(stopped.path).holds
    assert len(cut.tables["fixes"]) >= 20
