"""Records of hours at full speed: memory stays flat, and no descriptor is left open."""

import os
import random
from pathlib import Path

import pytest

from benchmarks.recording import second
from logger.core.runfile import RunWriter, convert_journal, read_run
from tests.kit import runs

PAGE_MB = os.sysconf("SC_PAGESIZE") / 1e6


def _memory_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_MB


def _descriptors() -> int:
    return len(os.listdir("/proc/self/fd"))


@pytest.mark.parametrize("hours", [0.02, pytest.param(24, marks=pytest.mark.slow)])
def test_memory_and_descriptors_stay_as_they_are(tmp_path, hours):
    rng = random.Random(1)
    # memory is the question here, not the card
    folder = Path("/dev/shm") if Path("/dev/shm").is_dir() else tmp_path
    path = folder / f"cellwalk-soak-{os.getpid()}.journal"
    seconds, mb, n_records = round(hours * 3600), [], 0
    before = _descriptors()
    try:
        writer = RunWriter(path, runs.meta())
        for k in range(seconds):
            for record in second(k, rng):
                n_records = writer.append(record) + 1
            writer.sync()
            if k % max(1, seconds // 24) == 0:
                mb.append(_memory_mb())
        writer.close(seconds * 10**9, "soak")
        assert _descriptors() == before
        print(f"{n_records} records; {min(mb[1:]):.0f} to {max(mb[1:]):.0f} MB")
        assert max(mb[1:]) - mb[1] < 8
        convert_journal(path, tmp_path / "soak.h5")
        print(
            f"{path.stat().st_size / 1e6:.0f} MB of journal; "
            f"{_memory_mb():.0f} MB after the HDF5 was made"
        )
        assert _descriptors() == before
        if hours < 1:
            assert len(list(read_run(tmp_path / "soak.h5").records())) == n_records
    finally:
        path.unlink(missing_ok=True)
