"""Cards of several partitions, which the boot rig does not make, and the boot partition of a Pi."""

import struct
import subprocess
from pathlib import Path

from tests.boot.machines import BOARD, rig

MIB = 1 << 20
SECTORS = MIB // 512
LINUX, FAT32 = 0x83, 0x0C
BOOT_MIB = 512
BOOT_LABEL, RUNS_LABEL = "bootfs", "cellwalk"
_DISK = rig.BOARDS[BOARD]["disk"]


def partition(number: int) -> str:
    """Device of a partition of the guest's card."""
    return f"{_DISK}p{number}" if _DISK[-1].isdigit() else f"{_DISK}{number}"


def table(*partitions_mib: tuple[int, int, int]) -> bytes:
    """Boot record with partitions of the given kind, start and size."""
    entries = [
        struct.pack("<4xB3xII", kind, start * SECTORS, size * SECTORS)
        for kind, start, size in partitions_mib
    ]
    return bytes(446) + b"".join(entries).ljust(64, b"\0") + b"\x55\xaa"


def copy_blocks(source: Path, target: Path, **blocks: int) -> None:
    """Copy into a file in MiB, at `seek`, from `skip`."""
    where = [f"{name}={number}" for name, number in blocks.items()]
    dd = ["dd", f"if={source}", f"of={target}", "bs=1M", "conv=notrunc,sparse", "status=none"]
    subprocess.run([*dd, *where], check=True)


class BootPartition:
    """The FAT partition at the start of a Pi's card, whose cmdline.txt the Pi's firmware reads.

    QEMU has no such firmware: `arguments` takes its place.
    """

    def __init__(self, card: Path):
        self._card = card
        self._at = f"{card}@@{MIB}"

    def format(self) -> None:
        """Make an empty one."""
        at = ["--offset", str(SECTORS), str(self._card), str(BOOT_MIB * 1024)]
        subprocess.run(
            ["mkfs.vfat", "-F", "32", "-n", BOOT_LABEL, *at],
            check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip

    def write(self, folder: Path) -> None:
        """Copy the content of a folder, as a card reader would."""
        self._mtools("mcopy", "-s", "-o", *sorted(folder.iterdir()), "::")

    def read(self, name: str) -> str:
        """Text of a file."""
        return self._mtools("mtype", f"::{name}")

    def fetch(self, name: str, folder: Path) -> None:
        """Copy a file into a folder."""
        self._mtools("mcopy", "-o", f"::{name}", folder)

    def names(self) -> set[str]:
        """Names of all files."""
        listed = self._mtools("mdir", "-b", "-/", "::").splitlines()
        return {line.removeprefix("::/") for line in listed if line.startswith("::/")}

    def arguments(self) -> str:
        """What the firmware would give the kernel."""
        return self.read("cmdline.txt").strip()

    def _mtools(self, tool: str, *arguments: object) -> str:
        command = [tool, "-i", self._at, *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{command}: {done.stderr}"
        return done.stdout


def make_ext4(card: Path, at_mib: int, size_mib: int, *options: str) -> None:
    """Make an empty file system on a part of a card."""
    where = ["-E", f"offset={at_mib * MIB}"]
    subprocess.run(
        ["mke2fs", "-q", "-t", "ext4", "-F", *options, *where, card, f"{size_mib}M"],
        check=True, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def with_boot_partition(root: Path, target: Path, runs_mib: int = 0) -> BootPartition:
    """Make a card of an empty boot partition and the file system of a root; `root` is removed.

    With `runs_mib`, a partition of that size and with the label `cellwalk` follows.
    """
    root_mib = root.stat().st_size // MIB
    runs_at_mib = 1 + BOOT_MIB + root_mib
    parts = [(FAT32, 1, BOOT_MIB), (LINUX, 1 + BOOT_MIB, root_mib)]
    if runs_mib:
        parts.append((LINUX, runs_at_mib, runs_mib))
    with target.open("wb") as file:
        file.write(table(*parts))
        file.truncate((runs_at_mib + runs_mib) * MIB)
    copy_blocks(root, target, seek=1 + BOOT_MIB)
    root.unlink()
    if runs_mib:
        make_ext4(target, runs_at_mib, runs_mib, "-L", RUNS_LABEL)
    boot = BootPartition(target)
    boot.format()
    return boot
