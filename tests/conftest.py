import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# before numpy comes: the matrices are small, and threads of BLAS would only wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# a busy machine is no finding
settings.register_profile("unhurried", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("unhurried")

SHARED = Path(__file__).resolve().parents[2] / "shared"


def _folder(name: str) -> Path:
    folder = SHARED / name
    if not folder.is_dir():
        pytest.skip(f"{name}: the shared test material is not beside this repository")
    return folder


@pytest.fixture(scope="session")
def corpus() -> Path:
    """Recorded modem replies and NMEA logs (not part of the repository)."""
    return _folder("corpus")


@pytest.fixture(scope="session")
def traces() -> Path:
    """Measured walks with surveyed transmitters (not part of the repository)."""
    return _folder("traces")
