"""Without numba the loops run as Python, with the same results."""

import subprocess
import sys

import msgspec
import numpy as np
import pytest

from logger.core import shadow_ekf
from logger.core.places import Places
from logger.core.runfile import finish_journal
from logger.core.shadow_ekf import ShadowNoise
from postproc.estimators import machine_code, walker
from postproc.estimators.filters import reference_ekf, shadow_pass
from tests.kit.sample_results import write_run
from tests.kit.walker_tracks import streets, track
from tests.kit.walks import observations

SMOOTH = """
import sys
if sys.argv[1] == "without":
    sys.modules["numba"] = sys.modules["llvmlite"] = None
from postproc.cli import main
sys.exit(main(["smooth", sys.argv[2], "--json"]))
"""


def numbers(value) -> list[float]:
    """All numbers of a result in their order."""
    if isinstance(value, dict):
        return [n for key in sorted(value) if key != "run" for n in numbers(value[key])]
    if isinstance(value, list):
        return [n for item in value for n in numbers(item)]
    is_number = isinstance(value, float | int) and not isinstance(value, bool)
    return [float(value)] if is_number else []


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """The JSON of one run, with and without numba."""
    pytest.importorskip("numba", reason="pip install '.[post]'")
    answers = {}
    for mode in ("with", "without"):
        journal = tmp_path_factory.mktemp(mode) / "run-000017.journal"
        write_run(journal, seconds=120, cells=1)
        run = finish_journal(journal)
        command = [sys.executable, "-c", SMOOTH, mode, str(run)]
        done = subprocess.run(command, capture_output=True, check=True)
        answers[mode] = msgspec.json.decode(done.stdout)
    return answers


def test_numba_changes_no_result(results):
    machine, plain = numbers(results["with"]), numbers(results["without"])
    assert len(machine) > 50
    np.testing.assert_allclose(plain, machine, rtol=1e-6, atol=1e-6)


def passes(obs):
    """States of both filters over a walk."""
    noise = ShadowNoise(5.0, 20.0, 3.0, 5.0)
    state = shadow_ekf.hold(np.array([60.0, 80.0, -30.0, 3.0]), noise, Places.of(0.0, 0.0))
    state = shadow_ekf.release(state, np.diag([2500.0, 2500.0, 100.0, 0.3]))
    paths = reference_ekf(obs), shadow_pass(obs, state, noise).path
    return [values for path in paths for values in (path.x, path.p, path.innovation_db)]


def test_machine_code_changes_no_bit(monkeypatch):
    """A process changes over after many rows: its results must not depend on when."""
    pytest.importorskip("numba", reason="pip install '.[post]'")
    walk = np.linspace(0.0, 400.0, 300)
    level = np.random.default_rng(1).normal(-70.0, 6.0, 300)
    obs = observations(walk, 40.0 * np.sin(walk / 60.0), level, 3.0)
    monkeypatch.setattr(machine_code, "_MANY_ROWS", 10**9)
    plain = passes(obs)
    monkeypatch.setattr(machine_code, "_MANY_ROWS", 0)
    for one, other in zip(plain, passes(obs), strict=True):
        np.testing.assert_array_equal(one, other)


def test_machine_code_smooths_a_track_alike(monkeypatch):
    """But for the last bits: numba multiplies where Python raises to a power."""
    pytest.importorskip("numba", reason="pip install '.[post]'")
    rng = np.random.default_rng(2)
    t_s, xy_m = streets(rng, 300)
    fixes = track(t_s, xy_m + 3.0 * rng.normal(size=xy_m.shape))
    velocity = walker.Velocities(*rng.normal(size=(2, 300)), np.full(300, 0.4))
    monkeypatch.setattr(machine_code, "_MANY_ROWS", 10**9)
    plain = walker.smooth_track(fixes, velocity)
    monkeypatch.setattr(machine_code, "_MANY_ROWS", 0)
    machine = walker.smooth_track(fixes, velocity)
    assert (plain.accel_m2s3, plain.white_share) == (machine.accel_m2s3, machine.white_share)
    for one, other in zip(plain.series, machine.series, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)


def test_few_rows_do_not_import_numba():
    code = (
        "import sys, numpy as np; from postproc.estimators import filters, kernels; "
        "from tests.kit.walks import observations; "
        "filters.reference_ekf(observations(np.arange(9.0), np.zeros(9), np.zeros(9), 3.0)); "
        "sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
