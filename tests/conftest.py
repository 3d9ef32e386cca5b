"""Settings and shared material for all tests."""

import os
import subprocess
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# before numpy is imported: threads of BLAS would wait for small matrices, and add in another order
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from logger import own_baseline
from postproc import progress

# a slow example on a busy machine is not an error
settings.register_profile("unhurried", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("unhurried")

# short work stays silent however busy the machine is; tests compare what is written on stderr
progress._SILENCE_S = 3600.0
# tests that run `learn` in their own process would leave no processor to those after them
own_baseline.give_way = lambda: None

_leave = subprocess.Popen.__exit__


def _leave_failed(process, kind, error, traceback):
    if kind is not None:
        process.kill()  # a failed test would wait for a program that only a signal ends
    return _leave(process, kind, error, traceback)


subprocess.Popen.__exit__ = _leave_failed

SHARED = Path(__file__).resolve().parents[2] / "shared"


def _folder(name: str) -> Path:
    folder = SHARED / name
    if not folder.is_dir():
        pytest.skip(f"{name}: the shared test material is missing beside this repository")
    return folder


@pytest.fixture(scope="session")
def corpus() -> Path:
    """Recorded modem replies and NMEA logs (not part of the repository)."""
    return _folder("corpus")


@pytest.fixture(scope="session")
def traces() -> Path:
    """Measured walks with surveyed transmitters (not part of the repository)."""
    return _folder("traces")


@pytest.fixture(scope="session")
def cells() -> Path:
    """Logs of legitimate networks in four cities (not part of the repository)."""
    return _folder("cells")
