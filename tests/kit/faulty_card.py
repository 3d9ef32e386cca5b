"""Cards that fail: a preloaded library that refuses, traces and kills at system calls."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

SOURCE = Path(__file__).with_name("faulty_card.c")


def build_preload_library(folder: Path) -> Path:
    """Compile the fault library."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is needed to make the fault library")
    target = folder / "faulty_card.so"
    subprocess.run(
        ["gcc", "-shared", "-fPIC", "-O1", "-w", "-o", target, SOURCE, "-ldl"], check=True
    )
    return target


class Card:
    """A folder whose system calls fail with the errors that a test sets."""

    def __init__(self, folder: Path, preload: Path) -> None:
        self.folder = folder / "card"
        self.folder.mkdir(exist_ok=True)
        self.trace = folder / "trace"
        self._faults = folder / "faults"
        self._faults.touch()
        self._preload = preload

    def fails(self, **errors: int) -> None:
        """Let these operations fail with these errors from now on; all others work."""
        text = "".join(f"{operation} {number}\n" for operation, number in errors.items())
        new = self._faults.with_suffix(".new")
        new.write_text(text)
        new.replace(self._faults)

    def environment(
        self, *, trace: bool = False, kill_at: int | None = None, bad_at: int | None = None
    ) -> dict[str, str]:
        variables = {
            "LD_PRELOAD": str(self._preload),
            "CARD": str(self.folder),
            "CARD_FAULTS": str(self._faults),
        }
        if trace:
            variables["CARD_TRACE"] = str(self.trace)
        if kill_at is not None:
            variables["CARD_KILL_AT"] = str(kill_at)
        if bad_at is not None:
            variables["CARD_BAD_AT"] = str(bad_at)
        return os.environ | variables


@contextmanager
def small_file_system(folder: Path, options: str) -> Iterator[Path]:
    """Mount a tmpfs; the test is skipped where that is not possible."""
    folder.mkdir()
    mount = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "tmpfs", folder], capture_output=True, check=False
    )
    if mount.returncode:
        pytest.skip("no file system can be mounted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", folder], check=False)
